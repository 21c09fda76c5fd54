"""The Blender add-on: a sound strip becomes an action of an armature, with shape keys."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import cospeech
from cospeech import Motion, Speech
from cospeech.export import save
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from tests.support.motions import gesturing

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "tests" / "blender" / "check_addon.py"
SOUND = Path(cospeech.__file__).parent / "assets" / "example" / "example.ogg"
FIRST, FRAMES = 11, (11, 40, 70)  # frames of the scene, as check_addon.py has them


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    result = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(result)
    return result


@cache
def usual() -> Motion:
    speech = Speech.load(SOUND)
    return cospeech.load("rules").generate(speech, emotion="happiness", seed=3, style="lively")


def in_blender(blender_python: str, folder: Path, rig: str) -> dict:
    archive = module(ROOT / "tools" / "build_blender.py").build(folder / "addon.zip")
    command = f"{sys.executable} -m cospeech"
    process = subprocess.run(
        [blender_python, str(SCRIPT), str(archive), str(SOUND), rig, command], capture_output=True, text=True, timeout=300
    )
    lines = [line for line in process.stdout.splitlines() if line.startswith("RESULT ")]
    assert lines, (process.stdout + process.stderr)[-3000:]
    return json.loads(lines[0].removeprefix("RESULT "))


@pytest.fixture(scope="module")
def mannequin(blender_python, tmp_path_factory) -> dict:
    folder = tmp_path_factory.mktemp("addon")
    save(gesturing(2), folder / "rig.glb")
    return in_blender(blender_python, folder, str(folder / "rig.glb"))


@pytest.fixture(scope="module")
def a_pose(blender_python, tmp_path_factory) -> dict:
    return in_blender(blender_python, tmp_path_factory.mktemp("addon"), "a-pose")


def find_places(frame: int) -> dict[str, np.ndarray]:
    """Joint → place in Blender's axes."""
    motion = usual()
    places = motion.positions()[frame - FIRST] @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    return dict(zip(motion.skeleton.names, places, strict=True))


@pytest.mark.slow
def test_our_mannequin_moves_as_our_forward_kinematics_says(mannequin):
    assert mannequin["done"] == ["FINISHED"]
    for frame in FRAMES:
        joints = find_places(frame)
        heads = {name: np.array(place) for name, place in mannequin["heads"][str(frame)].items()}
        for name in joints.keys() & heads.keys():
            assert heads[name] - heads["hips"] == pytest.approx(joints[name] - joints["hips"], abs=0.004), (frame, name)
        assert heads["hips"] == pytest.approx(joints["hips"], abs=0.002)


@pytest.mark.slow
def test_shape_keys_have_the_weights_of_the_face(mannequin):
    for frame in FRAMES:
        keys = {name.rsplit("/", 1)[1]: value for name, value in mannequin["keys"][str(frame)].items()}
        face = usual().face[frame - FIRST]
        assert {name: keys[name] for name in ARKIT_INDEX} == pytest.approx(
            {name: face[k] for name, k in ARKIT_INDEX.items()}, abs=2e-3
        )


@pytest.mark.slow
def test_actions_begin_with_the_strip_and_have_a_key_on_each_frame(mannequin):
    assert len(mannequin["actions"]) == 2  # of the armature, and of the shape keys
    for action in mannequin["actions"].values():
        assert action["frames"] == [FIRST, FIRST + len(usual()) - 1]


@pytest.mark.slow
def test_a_turned_rig_in_an_a_pose_moves_where_it_stands(a_pose):
    for frame in FRAMES:
        heads = {name.removeprefix("mixamorig:"): np.array(place) for name, place in a_pose["heads"][str(frame)].items()}
        ours = find_places(frame)
        assert np.abs(heads["Hips"][:2] - (1, 2)).max() < 0.3
        for side in ("Left", "Right"):
            low = side.lower()
            for a, b, c, d in (("Arm", "ForeArm", "UpperArm", "LowerArm"), ("UpLeg", "Leg", "UpperLeg", "LowerLeg")):
                bone = heads[side + b] - heads[side + a]
                ahead = ours[low + d] - ours[low + c]
                direction = np.array([-ahead[1], ahead[0], ahead[2]])  # the rig is turned by a quarter
                cosine = bone @ direction / np.linalg.norm(bone) / np.linalg.norm(direction)
                assert cosine > (0.95 if a == "Arm" else 0.99), (frame, side, a)


@pytest.mark.slow
def test_upper_and_lower_case_of_shape_keys_are_one(a_pose):
    jaw, lid = ([a_pose["keys"][str(frame)][f"Face/{name}"] for frame in FRAMES] for name in ("JawOpen", "eyeBlinkLeft"))
    assert max(jaw) > 0.1
    assert max(lid) > 0.02


@pytest.mark.slow
def test_an_error_of_the_command_is_shown(a_pose):
    assert a_pose["failure"].startswith("Error: no such option: --nonsense")


def test_the_zip_is_an_extension_and_the_same_each_time(tmp_path):
    build = module(ROOT / "tools" / "build_blender.py")
    first, second = (build.build(tmp_path / name).read_bytes() for name in ("a.zip", "b.zip"))
    assert first == second
    assert {path.name for path in build.SOURCE.iterdir() if path.is_file()} == set(build.FILES)


def test_a_rig_goes_through_a_bvh(tmp_path):
    """What the add-on writes, cospeech reads; what cospeech writes, the add-on reads."""
    bvh = module(ROOT / "blender" / "cospeech" / "bvh.py")
    motion = gesturing(5)
    motion.save(tmp_path / "a.bvh")
    frames = bvh.read_bvh((tmp_path / "a.bvh").read_text())
    ours = Motion.load(tmp_path / "a.bvh")
    assert sorted(frames.names) == sorted(ours.skeleton.names)
    assert frames.fps == pytest.approx(30, abs=1e-3)
    assert frames.root == pytest.approx(ours.root, abs=1e-5)
    heads = ours.skeleton.forward(ours.skeleton.rest[None], ours.skeleton.offsets[:1])[0][0]
    text = bvh.rig_to_bvh(list(ours.skeleton.names), list(ours.skeleton.parents), heads, heads + 0.05)
    (tmp_path / "rig.bvh").write_text(text)
    read = Motion.load(tmp_path / "rig.bvh")
    order = [read.skeleton.index[name] for name in ours.skeleton.names]
    assert read.positions()[0, order] == pytest.approx(heads, abs=1e-4)
