"""Meshes of FBX files: what several share is read once, and what would fill memory or time is refused."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export.character_files import read_character
from cospeech.export.fbx import mesh_reader
from cospeech.export.fbx.node_writer import Long
from tests.support.fbx_files import Tree, write_objects

PICTURE = b"\x89PNG" + bytes(1000)
HANG = 60.0  # seconds; what is done once for each pair takes longer
SQUARE = np.array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], float)


def write_mesh(path: Path, polygons: list[int], layers: list[Tree], more: list[Tree], connections: list[tuple]) -> Path:
    """A square with the number 2, on the model 1."""
    corners = np.array(polygons, np.int32)
    own = [("Vertices", [SQUARE], []), ("PolygonVertexIndex", [corners], []), *layers]
    objects = [("Model", [Long(1), "m", "Mesh"], []), ("Geometry", [Long(2), "g", "Mesh"], own), *more]
    return write_objects(path, objects, [("OO", Long(1), Long(0)), ("OO", Long(2), Long(1)), *connections])


def layer(kind: str, mapping: str, *values: Tree) -> Tree:
    nodes = [("MappingInformationType", [mapping], []), ("ReferenceInformationType", ["IndexToDirect"], []), *values]
    return (f"LayerElement{kind}", [0], nodes)


def test_materials_that_share_a_picture_share_its_bytes(tmp_path):
    more = [("Video", [Long(5), "v", "Clip"], [("Content", [PICTURE], [])])]
    links = []
    for k in range(20):
        more += [("Material", [Long(100 + k), "m", ""], []), ("Texture", [Long(200 + k), "t", ""], [])]
        links += [("OO", Long(100 + k), Long(1)), ("OP", Long(200 + k), Long(100 + k), "DiffuseColor")]
        links += [("OO", Long(5), Long(200 + k))]
    file = read_character(write_mesh(tmp_path / "a.fbx", [0, 1, ~2], [], more, links))
    assert len(file.list("materials")) == 20
    assert len(file.list("images")) == 1


def test_materials_that_are_not_there_cost_nothing(tmp_path):
    count = 50_000
    materials = layer("Material", "ByPolygon", ("Materials", [np.arange(count, dtype=np.int32)], []))
    more = [("Material", [Long(100 + k), f"m{k}", ""], []) for k in range(2)]
    links = [("OO", Long(100 + k), Long(1)) for k in range(2)]
    begin = time.process_time()
    file = read_character(write_mesh(tmp_path / "a.fbx", [0, 1, ~2] * count, [materials], more, links))
    assert time.process_time() - begin < HANG
    parts = file.list("meshes")[0]["primitives"]
    counts = {part.get("material"): len(file.accessor(part["indices"], 1)) // 3 for part in parts}
    assert counts == {None: count - 2, 0: 1, 1: 1}


def test_meshes_that_would_fill_the_memory(tmp_path, monkeypatch):
    path = write_mesh(tmp_path / "a.fbx", [0, 1, ~2] * 10, [], [], [])
    read_character(path)
    monkeypatch.setattr(mesh_reader, "FBX_CORNERS", 29)
    with pytest.raises(InputError, match="more than 29 corners"):
        read_character(path)


def test_a_mesh_that_many_models_share_counts_for_each(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_reader, "FBX_SHAPE_POINTS", 200_000)
    more = [("Model", [Long(100 + k), "m", "Mesh"], []) for k in range(10)]
    links = [("OO", Long(2), Long(100 + k)) for k in range(10)]
    read_character(write_mesh(tmp_path / "a.fbx", [0, 1, ~2], [], more[:9], links[:9]))
    with pytest.raises(InputError, match="more than 200,000 points"):
        read_character(write_mesh(tmp_path / "b.fbx", [0, 1, ~2], [], more, links))


def test_stacks_that_share_a_layer_are_looked_through_once(tmp_path):
    count = 2000
    objects: list[Tree] = [("Model", [Long(1), "m", "LimbNode"], []), ("AnimationLayer", [Long(2), "l", ""], [])]
    links: list[tuple] = []
    for k in range(count):
        objects += [
            ("AnimationStack", [Long(10_000 + k), "s", ""], []),
            ("AnimationCurveNode", [Long(20_000 + k), "n", ""], []),
        ]
        links += [("OO", Long(2), Long(10_000 + k)), ("OO", Long(20_000 + k), Long(2))]
    begin = time.process_time()
    assert read_character(write_objects(tmp_path / "a.fbx", objects, links)).list("animations") == []
    assert time.process_time() - begin < HANG


def test_corners_without_a_place_on_the_texture(tmp_path):
    """Maya says -1 where a polygon has no texture coordinates."""
    places = ("UV", [np.array([0.25, 0.5, 0.75, 0.5])], []), ("UVIndex", [np.array([0, 1, -1], np.int32)], [])
    file = read_character(write_mesh(tmp_path / "a.fbx", [0, 1, ~2], [layer("UV", "ByPolygonVertex", *places)], [], []))
    coordinates = file.accessor(file.list("meshes")[0]["primitives"][0]["attributes"]["TEXCOORD_0"], 2)
    np.testing.assert_allclose(coordinates, [(0.25, 0.5), (0.75, 0.5), (0, 1)])


def test_a_shape_that_no_clip_moves_stays_as_it_was_saved(tmp_path):
    """For example shapes of a body: a motion of the face must not reset them. A shape that a clip moves rests at 0."""
    more = [("Deformer", [Long(10), "b", "BlendShape"], [])]
    links = [("OO", Long(10), Long(2))]
    shape = [("Indexes", [np.array([0], np.int32)], []), ("Vertices", [np.ones(3)], [])]
    for k, percent in enumerate((70.0, 0.0, 40.0)):
        more.append(("Deformer", [Long(100 + k), f"s{k}", "BlendShapeChannel"], [("DeformPercent", [percent], [])]))
        more.append(("Geometry", [Long(200 + k), f"s{k}", "Shape"], shape))
        links += [("OO", Long(100 + k), Long(10)), ("OO", Long(200 + k), Long(100 + k))]
    keys = [("KeyTime", [np.arange(3) * 1_539_538_600], []), ("KeyValueFloat", [np.array([10, 20, 30], np.float32)], [])]
    more += [("AnimationStack", [Long(20), "c", ""], []), ("AnimationLayer", [Long(21), "c", ""], [])]
    more += [("AnimationCurveNode", [Long(22), "n", ""], []), ("AnimationCurve", [Long(23), "n", ""], keys)]
    links += [("OO", Long(21), Long(20)), ("OO", Long(22), Long(21)), ("OP", Long(22), Long(102), "DeformPercent")]
    links += [("OP", Long(23), Long(22), "d|DeformPercent")]
    file = read_character(write_mesh(tmp_path / "a.fbx", [0, 1, ~2], [], more, links))
    np.testing.assert_allclose(file.list("meshes")[0]["weights"], [0.7, 0, 0])
    np.testing.assert_allclose(file.curves(0)[0, "weights"].values, [(0.7, 0, 0.1), (0.7, 0, 0.2), (0.7, 0, 0.3)], atol=1e-6)
