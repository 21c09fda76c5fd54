"""Blender opens our BVH as animators do, and its bones are where ours are. Needs a Python with ``bpy``."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_continuous, rotvec_to_quat
from cospeech.motion.skeleton import find_skeleton
from tests.support.motions import gesturing

SCRIPT = Path(__file__).parents[1] / "blender" / "check_bvh.py"
TOLERANCE = 1e-3  # centimetres; design/interface: "forward kinematics equal to ours within 1e-3 cm"


def in_blender(python: str, motion: Motion, folder: Path) -> dict:
    motion.save(folder / "talk.bvh")
    np.savez(
        folder / "positions.npz",
        names=np.array(motion.skeleton.names),
        positions=motion.positions() * 100,
        rest=(motion.skeleton.tpose - motion.skeleton.tpose[0]) * 100,
    )
    command = [python, str(SCRIPT), str(folder / "talk.bvh"), str(folder / "positions.npz")]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert process.returncode == 0, process.stderr[-2000:]
    return json.loads(process.stdout.strip().splitlines()[-1])


def wandering(name: str) -> Motion:
    skeleton, rng = find_skeleton(name), np.random.default_rng(5)
    turns = rotvec_to_quat(np.cumsum(rng.normal(0, 0.06, (45, len(skeleton), 3)), 0))
    root = np.cumsum(rng.normal(0, 0.01, (45, 3)), 0) + skeleton.offsets[0]
    return Motion(fps=30, rotations=quat_continuous(turns), root=root, skeleton=skeleton)


@pytest.mark.parametrize("name", ["humanoid", "mixamo", "beat"])
def test_bvh_in_blender_has_our_bones_where_ours_are(blender_python, tmp_path, name):
    motion = gesturing(60) if name == "humanoid" else wandering(name)
    result = in_blender(blender_python, motion, tmp_path)
    assert result["bones"] == sorted(motion.skeleton.names)
    assert result["frames"] == len(motion)
    assert result["fps"] == pytest.approx(30, rel=1e-6)
    assert result["largest_error"] < TOLERANCE
    assert result["rest_error"] < TOLERANCE  # the rest pose in Blender is the T-pose


def test_bvh_check_would_notice(blender_python, tmp_path):
    """The same comparison fails where a single bone is off by a hundredth of a degree at the shoulder."""
    motion = gesturing(5)
    rotations = motion.rotations.copy()
    rotations[:, motion.skeleton.index["leftUpperArm"], 2] += 1e-4
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    motion.save(tmp_path / "talk.bvh")
    other = Motion(fps=30, rotations=rotations, root=motion.root)
    rest = (motion.skeleton.tpose - motion.skeleton.tpose[0]) * 100
    np.savez(tmp_path / "p.npz", names=np.array(motion.skeleton.names), positions=other.positions() * 100, rest=rest)
    command = [blender_python, str(SCRIPT), str(tmp_path / "talk.bvh"), str(tmp_path / "p.npz")]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert json.loads(process.stdout.strip().splitlines()[-1])["largest_error"] > TOLERANCE
