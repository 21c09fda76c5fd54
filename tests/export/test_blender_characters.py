"""Blender imports our GLB and FBX: an armature, a skinned mesh, shape keys by name, moving as our forward kinematics says."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cospeech.export import save
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT
from tests.support.motions import gesturing

SCRIPT = Path(__file__).parents[1] / "blender" / "check_character.py"
FRAMES = (0, 13, 30, 89)


FIRST = {".glb": 0, ".fbx": 1}  # frame on which Blender puts the first


@pytest.fixture(scope="module", params=FIRST)
def blender_import(blender_python, tmp_path_factory, request) -> dict:
    path, first = tmp_path_factory.mktemp("blender") / f"a{request.param}", FIRST[request.param]
    save(gesturing(90), path)
    command = [blender_python, str(SCRIPT), str(path), "30", *(str(frame + first) for frame in FRAMES)]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    lines = [line for line in process.stdout.splitlines() if line.startswith("RESULT ")]
    assert lines, (process.stdout + process.stderr)[-3000:]
    return json.loads(lines[0].removeprefix("RESULT ")) | {"first": first}


def test_armature_mesh_and_shape_keys(blender_import):
    assert len(blender_import["armatures"]) == 1
    ours = {name: mesh for name, mesh in blender_import["meshes"].items() if name != "Icosphere"}  # Blender's own bone shape
    assert all(mesh["skinned"] and mesh["vertices"] > 0 for mesh in ours.values())
    key_names = [mesh["keys"] for mesh in ours.values() if mesh["keys"]]
    assert key_names == [list(ARKIT)]
    assert blender_import["frame_range"] == [blender_import["first"], 89 + blender_import["first"]]


def test_bones_move_as_ours(blender_import):
    positions = gesturing(90).positions()
    for frame, sample in zip(FRAMES, blender_import["samples"], strict=True):
        theirs = np.array([sample["positions"][name] for name in humanoid().names])
        assert np.linalg.norm(theirs - positions[frame], axis=1).max() < 1e-4


def test_shape_keys_move_as_ours(blender_import):
    face = gesturing(90).face
    for frame, sample in zip(FRAMES, blender_import["samples"], strict=True):
        (weights,) = sample["weights"].values()
        np.testing.assert_allclose([weights[name] for name in ARKIT], face[frame], atol=1e-4)


def test_skin_follows_the_bones(blender_import):
    """The raised right hand lifts the figure's right side: the mesh is not left behind, nor inside out."""
    low, high = np.array(blender_import["samples"][0]["boxes"]["body"])
    assert 1.3 < high[1] - low[1] < 1.9  # it stands, metres
    assert 0.3 < high[0] - low[0] < 1.1  # arms hang: far narrower than the T-pose's 1.7 m
    assert abs(low[1]) < 0.06
