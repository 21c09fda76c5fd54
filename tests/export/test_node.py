"""Khronos' validator, three.js and @pixiv/three-vrm-animation, under plain Node, look at what we wrote."""

from __future__ import annotations

import json
import subprocess
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import CospeechWarning
from cospeech.export import save
from cospeech.export.avatar import load_avatar
from cospeech.export.visemes import vrm_presets
from cospeech.export.vrma import PRESETS
from cospeech.motion.rotations import quat_to_euler
from cospeech.motion.skeleton import Skeleton, humanoid
from cospeech.motion.skeletons.arkit import ARKIT
from tests.support.motions import gesturing

FOLDER = Path(__file__).parents[1] / "node"
FRAMES = (0, 7, 30, 61, 89)


def run(node: str, script: str, *arguments: object) -> list[dict]:
    """One JSON object per line of a script's output."""
    assert (FOLDER / "node_modules").is_dir(), "run `npm ci` in tests/node (`make test` does)"
    command = [node, str(FOLDER / script), *map(str, arguments)]
    process = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert process.returncode == 0, process.stderr[-2000:]
    return [json.loads(line) for line in process.stdout.splitlines()]


def write_skeleton(skeleton: Skeleton, path: Path) -> Path:
    bones = [
        {"name": name, "parent": skeleton.names[p] if p >= 0 else None, "offset": skeleton.offsets[k].tolist()}
        for k, (name, p) in enumerate(zip(skeleton.names, skeleton.parents, strict=True))
    ]
    path.write_text(json.dumps({"bones": bones}), encoding="utf-8")
    return path


def test_validator_finds_no_fault(node, tmp_path):
    motion = gesturing(90)
    paths = [tmp_path / "a.glb", tmp_path / "a.vrma", tmp_path / "one.glb", tmp_path / "presets.vrma", tmp_path / "looks.vrma"]
    save(motion, paths[0])
    save(motion, paths[1])
    save(gesturing(1), paths[2])
    save(motion, paths[3], arkit=False)
    save(motion, paths[4], look_at=False)
    for report in run(node, "validate_gltf.mjs", *paths):
        faults = [m for m in report["messages"] if m["severity"] < 2]
        assert (report["numErrors"], report["numWarnings"]) == (0, 0), faults[:5]
        assert report["info"]["hasSkins"] == report["path"].endswith(".glb")


def test_validator_would_notice(node, tmp_path):
    save(gesturing(5), tmp_path / "a.glb")
    data = bytearray((tmp_path / "a.glb").read_bytes())
    data[-400:] = b"\xff" * 400  # not numbers
    (tmp_path / "b.glb").write_bytes(data)
    (report,) = run(node, "validate_gltf.mjs", tmp_path / "b.glb")
    assert report["numErrors"] > 0


def test_three_vrm_plays_the_clip(node, tmp_path):
    motion = gesturing(90)
    save(motion, tmp_path / "a.vrma")
    skeleton = humanoid()
    times = [k / 30 for k in FRAMES]
    (result,) = run(node, "check_vrma.mjs", tmp_path / "a.vrma", write_skeleton(skeleton, tmp_path / "h.json"), *times)
    assert result["duration"] == pytest.approx(89 / 30, abs=1e-5)
    ours, presets = motion.positions(), vrm_presets(motion.face)
    look = np.degrees(quat_to_euler(motion.rotations[:, skeleton.index["leftEye"]], "YXZ"))
    for k, sample in zip(FRAMES, result["samples"], strict=True):
        theirs = np.array([sample["positions"][name] for name in skeleton.names])
        assert np.linalg.norm(theirs - ours[k], axis=1).max() < 1e-4
        for name in PRESETS:
            assert sample["expressions"][name] == pytest.approx(presets[name][k], abs=1e-4)
        for column, name in enumerate(ARKIT):
            if name.startswith("eyeLook"):  # an avatar with such expressions would turn its eyes twice
                assert name not in sample["expressions"]
            else:
                assert sample["expressions"][name] == pytest.approx(motion.face[k, column], abs=1e-4)
        assert sample["lookAt"]["yaw"] == pytest.approx(look[k, 0], abs=0.02)
        assert sample["lookAt"]["pitch"] == pytest.approx(look[k, 1], abs=0.02)


def test_three_vrm_plays_a_gaze_of_expressions_alone(node, tmp_path):
    motion = gesturing(90)
    save(motion, tmp_path / "a.vrma", look_at=False)
    times = [k / 30 for k in FRAMES]
    (result,) = run(node, "check_vrma.mjs", tmp_path / "a.vrma", write_skeleton(humanoid(), tmp_path / "h.json"), *times)
    for k, sample in zip(FRAMES, result["samples"], strict=True):
        for column, name in enumerate(ARKIT):
            assert sample["expressions"][name] == pytest.approx(motion.face[k, column], abs=1e-4)
        assert (sample["lookAt"]["yaw"], sample["lookAt"]["pitch"]) == (0, 0)


def test_three_moves_the_mannequin(node, tmp_path):
    motion = gesturing(90)
    save(motion, tmp_path / "a.glb")
    (result,) = run(node, "check_glb.mjs", tmp_path / "a.glb", *(k / 30 for k in FRAMES))
    ours = motion.positions()
    for k, sample in zip(FRAMES, result["samples"], strict=True):
        theirs = np.array([sample["positions"][name] for name in humanoid().names])
        assert np.linalg.norm(theirs - ours[k], axis=1).max() < 1e-4
        faces = [mesh for mesh in sample["meshes"].values() if mesh["names"]]
        assert faces
        for face in faces:
            assert face["names"] == list(ARKIT)
            np.testing.assert_allclose(face["weights"], motion.face[k], atol=1e-4)


AVATARS = ("Godette_vrm_v4_CC-BY-3.0.vrm", "KayKit_Mage_CC0.glb", "avatar_mpfb_male_arkit52_viseme15.glb")


@pytest.mark.parametrize("name", AVATARS)
def test_three_moves_the_avatars_of_others(node, shared_folder, tmp_path, name):
    """No new faults, and in three.js the arms of the character are where its skeleton, retargeted, has them."""
    path, out = shared_folder / "data" / "avatars" / name, tmp_path / "a.glb"
    motion = gesturing(90)
    avatar = load_avatar(path)
    clips = avatar.file.list("animations")
    with pytest.warns(CospeechWarning, match=f"{len(clips)} clips of its own") if clips else nullcontext():
        avatar.animate(motion, out)
    before, after = run(node, "validate_gltf.mjs", path, out)
    assert (after["numErrors"], after["numWarnings"]) == (before["numErrors"], before["numWarnings"])
    body = motion.retarget(avatar.skeleton)
    points = body.positions() - avatar.rig.shift
    (result,) = run(node, "check_glb.mjs", out, *(k / 30 for k in FRAMES))
    back = np.array([-1, 1, -1]) if name.endswith(".vrm") else np.ones(3)  # VRM 0.x faces −Z
    for k, sample in zip(FRAMES, result["samples"], strict=True):
        for bone in ("leftHand", "rightHand", "head", "leftFoot", "rightLowerArm"):
            joint = avatar.rig.bones[bone]
            node_name = avatar.file.json["nodes"][avatar.rig.nodes[joint]]["name"]
            three = node_name.replace(".", "").replace(" ", "_")  # three.js cleans names
            np.testing.assert_allclose(sample["positions"][three], points[k, joint] * back, atol=2e-4)
