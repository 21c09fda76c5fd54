"""FBX of others: pivots, orders of rotation, axes and units by formula; sparse keys; damage; what Blender writes."""

from __future__ import annotations

import json
import struct
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export import load, save
from cospeech.export.character_files import read_character
from cospeech.export.fbx import tree
from cospeech.export.fbx.document import Document, FbxModel
from cospeech.export.fbx.node_writer import NodeWriter
from cospeech.export.fbx.scene_writer import sort_axes
from cospeech.export.fbx.tree import MAGIC, parse_fbx
from cospeech.export.rig import world_matrices
from cospeech.motion.rotations import quat_to_euler
from tests.support.fbx_files import record, wide_file, write_bones
from tests.support.motions import gesturing

SCRIPTS = Path(__file__).parents[1] / "blender"
ODD = [
    ("a", -1, {"Lcl Translation": (1, 2, 3), "Lcl Rotation": (10, 20, 30), "RotationActive": (1,), "PreRotation": (0, 90, 15)}),
    ("b", 0, {"Lcl Translation": (0, 10, 0), "Lcl Rotation": (50, -20, 70), "RotationActive": (1,), "RotationOrder": (3,),
              "PostRotation": (0, 0, 25), "PreRotation": (5, 6, 7)}),
    ("c", 1, {"Lcl Translation": (0, 10, 0), "Lcl Rotation": (15, 25, 35), "RotationPivot": (1, 0, 2),
              "RotationOffset": (0, 1, 0), "ScalingPivot": (0, 2, 0), "Lcl Scaling": (2, 2, 2)}),
    ("d", 2, {"Lcl Translation": (0, 10, 0)}),
]  # fmt: skip


def turn(x: float, y: float, z: float, order: str = "XYZ") -> np.ndarray:
    """(4, 4) of angles in degrees, the first of ``order`` being done first."""
    matrix = np.eye(4)
    for axis in order:
        angle = np.radians({"X": x, "Y": y, "Z": z}[axis])
        k, (i, j) = "XYZ".index(axis), {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
        step = np.eye(4)
        step[i, i] = step[j, j] = np.cos(angle)
        step[j, i], step[i, j] = np.sin(angle), -np.sin(angle)
        assert step[k, k] == 1
        matrix = step @ matrix
    return matrix


def shift(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def test_places_follow_the_formula_of_the_format(tmp_path):
    """T · Roff · Rp · Rpre · R · Rpost⁻¹ · Rp⁻¹ · Soff · Sp · S · Sp⁻¹, by matrices."""
    a = shift(1, 2, 3) @ turn(0, 90, 15) @ turn(10, 20, 30)
    b = a @ shift(0, 10, 0) @ turn(5, 6, 7) @ turn(50, -20, 70, "YXZ") @ np.linalg.inv(turn(0, 0, 25))
    c = b @ shift(0, 10, 0) @ shift(0, 1, 0) @ shift(1, 0, 2) @ turn(15, 25, 35) @ shift(-1, 0, -2)
    c = c @ shift(0, 2, 0) @ np.diag([2, 2, 2, 1]) @ shift(0, -2, 0)
    d = c @ shift(0, 10, 0)
    file = read_character(write_bones(tmp_path / "a.fbx", ODD))
    for matrix, expected in zip(world_matrices(file), (a, b, c, d), strict=False):
        expected[:3] *= 0.01  # centimetres
        np.testing.assert_allclose(matrix, expected, atol=1e-9)


def test_a_place_is_turned_back_into_properties(tmp_path):
    fbx = Document(parse_fbx(write_bones(tmp_path / "a.fbx", ODD).read_bytes(), "a"), "a")
    for node in fbx.of_kind("Model"):
        model = FbxModel(node)
        place, angles = model.still[0], model.still[1]
        where = model.place(*model.still)
        back, rotation = model.properties_at(where.translation, where.rotation)
        np.testing.assert_allclose(back, place, atol=1e-9)
        np.testing.assert_allclose(np.degrees(sort_axes(quat_to_euler(rotation, model.order), model.order)), angles, atol=1e-9)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, (0.01, 0.02, 0.03)),
        ({"UnitScaleFactor": 100.0}, (1, 2, 3)),
        ({"UnitScaleFactor": 2.54}, (0.0254, 0.0508, 0.0762)),
        ({"UpAxis": 2, "FrontAxis": 1, "FrontAxisSign": -1, "CoordAxis": 0}, (0.01, 0.03, -0.02)),  # Z up, as 3ds Max
        ({"UpAxis": 1, "UpAxisSign": 1, "FrontAxis": 1}, (0.01, 0.02, 0.03)),  # one axis named twice: taken as Y up
    ],
)
def test_axes_and_units(tmp_path, settings, expected):
    bones = [("a", -1, {"Lcl Translation": (1, 2, 3)}), ("b", 0, {})]
    file = read_character(write_bones(tmp_path / "a.fbx", bones, settings=settings))
    np.testing.assert_allclose(world_matrices(file)[0, :3, 3], expected, atol=1e-9)


@pytest.mark.parametrize(("flags", "middle"), [(2, 0.0), (4, 5.0), (8, 5.0)])
def test_keys_that_are_far_apart(tmp_path, flags, middle):
    """Steps, straight lines, and bends that pass through the keys."""
    keys = {(0, "Lcl Translation", "X"): ([0, 1, 2], [0, 10, 0])}
    path = write_bones(tmp_path / "a.fbx", [("a", -1, {"Lcl Translation": (0, 7, 0)})], keys, {"TimeMode": 11}, flags)
    file = read_character(path)
    curve = file.curves(0)[0, "translation"]
    assert len(curve.times) == 2 * 24 + 1  # the file says 24 frames per second
    np.testing.assert_allclose(curve.values[[0, 24, 48], 0], (0, 10, 0), atol=1e-6)
    np.testing.assert_allclose(curve.values[:, 1], 7)
    assert curve.values[12, 0] == pytest.approx(middle, abs=1.3)
    bends = np.abs(np.diff(curve.values[:24, 0], 2)).max() > 1e-3
    assert bends == (flags == 8)


def test_a_clip_that_moves_nothing_is_none(tmp_path):
    """Mixamo's files have an empty one beside the clip."""
    keys = {(0, "Lcl Translation", "X"): ([0, 1], [0, 10])}
    path = write_bones(tmp_path / "a.fbx", [("a", -1, {})], keys)
    assert [clip["name"] for clip in read_character(path).list("animations")] == ["clip"]
    still = write_bones(tmp_path / "b.fbx", [("a", -1, {})], {}, empty_clip=True)
    assert read_character(still).list("animations") == []


def test_places_of_64_bits():
    root = parse_fbx(wide_file(), "a")
    (model,) = root.find("Objects").nodes
    assert (model.name, model.values[2]) == ("Model", "LimbNode")


HEAD = MAGIC + struct.pack("<I", 7400)
BOMB = b"d" + struct.pack("<III", 1 << 28, 1, 1000) + zlib.compress(bytes(1 << 20), 9)[:1000].ljust(1000, b"\0")
BAD_FILES = {
    "text": (b"; FBX 7.3.0 project file\n", "FBX as text"),
    "no FBX": (b"hello there, this is not it", "not a binary FBX"),
    "old": (MAGIC + struct.pack("<I", 6100) + bytes(200), "version 6.1"),
    "cut off": (MAGIC, "cut off"),
    "empty": (HEAD + bytes(13), "holds no character"),
    "node beyond its parent": (HEAD + record(b"Objects", b"", 0, bytes(5), 500), "ends beyond"),
    "fewer values": (HEAD + record(b"Objects", b"", 3, b"", len(HEAD)), "fewer values"),
    "kind of value": (HEAD + record(b"Objects", b"?1234", 1, b"", len(HEAD)), "a value of kind"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_damage_is_told_in_a_line(tmp_path, name):
    data, message = BAD_FILES[name]
    (tmp_path / "a.fbx").write_bytes(data)
    with pytest.raises(InputError, match=message) as refusal:
        load(tmp_path / "a.fbx")
    assert "\n" not in str(refusal.value)


def test_a_small_file_cannot_fill_the_memory():
    root = parse_fbx(HEAD + record(b"Vertices", BOMB, 1, b"", len(HEAD)) + bytes(13), "a")
    with pytest.raises(InputError, match=r"more than 64 MiB"):
        root.array("Vertices")
    short = b"d" + struct.pack("<III", 1000, 1, 20) + zlib.compress(bytes(10))[:20].ljust(20, b"\0")
    with pytest.raises(InputError, match="cut off"):
        parse_fbx(HEAD + record(b"Vertices", short, 1, b"", len(HEAD)) + bytes(13), "a").array("Vertices")


def test_nodes_that_are_too_deep_or_too_many(monkeypatch):
    data = b""
    for depth in reversed(range(70)):
        data = record(b"N", b"", 0, data, len(HEAD) + 14 * depth)
    root = parse_fbx(HEAD + data, "a")
    for _ in range(tree.FBX_DEPTH + 1):
        root = root.nodes[0]
    with pytest.raises(InputError, match="nested too deeply"):
        _ = root.nodes
    monkeypatch.setattr(tree, "FBX_NODES", 3)
    many = b"".join(record(b"N", b"", 0, b"", len(HEAD) + 14 * k) for k in range(5))
    with pytest.raises(InputError, match="more than 3 nodes"):
        _ = parse_fbx(HEAD + many, "a").nodes


def test_a_bone_that_hangs_on_itself(tmp_path):
    path = write_bones(tmp_path / "a.fbx", [("a", 1, {}), ("b", 0, {})])
    with pytest.raises(InputError, match="hangs on itself"):
        read_character(path)


def run_blender(python: str, script: str, *arguments: object) -> str:
    command = [python, str(SCRIPTS / script), *map(str, arguments)]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert process.returncode == 0, (process.stdout + process.stderr)[-3000:]
    return process.stdout


AXES = [("-Z", "Y", "FBX_SCALE_NONE"), ("-Y", "Z", "FBX_SCALE_ALL")]


@pytest.mark.parametrize(("forward", "up", "scale"), AXES)
def test_what_blender_writes_is_read(blender_python, tmp_path, forward, up, scale):
    """Our figure, carried into Blender as GLB and out as FBX with other axes and scales."""
    motion = gesturing(40)
    save(motion, tmp_path / "a.glb")
    run_blender(blender_python, "export_fbx.py", tmp_path / "a.glb", tmp_path / "b.fbx", len(motion), forward, up, scale)
    again = load(tmp_path / "b.fbx")
    joints = [again.skeleton.index[name] for name in motion.skeleton.names]
    assert (again.fps, len(again)) == (30.0, 40)
    np.testing.assert_allclose(again.positions()[:, joints], motion.positions(), atol=1e-5)
    np.testing.assert_allclose(again.face, motion.face, atol=1e-5)


def test_blender_shows_a_copied_character_as_its_glb(blender_python, tmp_path):
    """A character that Blender saved in another pose than that of its skin: our motion on it is the same in FBX and GLB."""
    save(gesturing(20), tmp_path / "a.glb")
    run_blender(blender_python, "export_fbx.py", tmp_path / "a.glb", tmp_path / "b.fbx", 20, "-Z", "Y", "FBX_SCALE_NONE")
    boxes = []
    for suffix, first in ((".fbx", 1), (".glb", 0)):
        with pytest.warns(UserWarning, match="clip"):
            save(gesturing(60), tmp_path / f"c{suffix}", avatar=tmp_path / "b.fbx")
        text = run_blender(blender_python, "check_character.py", tmp_path / f"c{suffix}", 30, first + 45)
        (line,) = [line for line in text.splitlines() if line.startswith("RESULT ")]
        (sample,) = json.loads(line.removeprefix("RESULT "))["samples"]
        boxes.append([sample["boxes"][name] for name in ("body", "face")])
    np.testing.assert_allclose(*boxes, atol=1e-4)


def test_a_part_without_a_curve_is_what_its_clip_says(tmp_path):
    """The clip counts and not the bone: two clips may hold the part differently."""
    keys = {(0, "Lcl Translation", "X"): ([0, 1], [0, 10])}
    bones = [("a", -1, {"Lcl Translation": (0, 7, 3)})]
    curve = read_character(write_bones(tmp_path / "a.fbx", bones, keys, constants={"Y": 5.0})).curves(0)[0, "translation"]
    assert set(curve.values[:, 1]) == {5.0}
    assert set(curve.values[:, 2]) == {3.0}


def test_a_clip_that_moves_no_bone_and_no_shape_is_none(tmp_path):
    keys = {(0, "", "X"): ([0, 1], [0, 10])}
    assert read_character(write_bones(tmp_path / "a.fbx", [("a", -1, {})], keys)).list("animations") == []


def test_only_the_pose_of_the_skin_says_where_bones_rest(tmp_path):
    path = write_bones(tmp_path / "a.fbx", [("a", -1, {"Lcl Translation": (1, 2, 3)})], poses={"RestPose": (9, 9, 9)})
    np.testing.assert_allclose(world_matrices(read_character(path))[0, :3, 3], (0.01, 0.02, 0.03))
    path = write_bones(tmp_path / "a.fbx", [("a", -1, {"Lcl Translation": (1, 2, 3)})], poses={"BindPose": (9, 9, 9)})
    np.testing.assert_allclose(world_matrices(read_character(path))[0, :3, 3], (0.09, 0.09, 0.09))


def test_a_name_that_is_no_text_is_damage(tmp_path):
    (tmp_path / "a.fbx").write_bytes(HEAD + record(b"Obj\xff", b"", 0, b"", len(HEAD)) + bytes(13))
    with pytest.raises(InputError, match="no name that can be read"):
        load(tmp_path / "a.fbx")


def test_a_copied_node_keeps_an_empty_block(tmp_path):
    inner = record(b"Properties70", b"", 0, bytes(13), len(HEAD) + 20)
    node = parse_fbx(HEAD + record(b"Objects", b"", 0, inner + bytes(13), len(HEAD)) + bytes(13), "a").find("Objects")
    with (tmp_path / "b.fbx").open("wb") as file:
        NodeWriter(file).copy(node)
    copy = parse_fbx((tmp_path / "b.fbx").read_bytes() + bytes(13), "b").find("Objects")
    assert copy.nodes[0].has_block
    assert not copy.nodes[0].nodes
