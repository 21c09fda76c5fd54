"""Half bodies: legs that are not there rest, legs that are there are found or asked for, and hips move about their place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.errors import CospeechWarning, InputError
from cospeech.export import load, save
from cospeech.export.target_skeleton import find_target
from cospeech.motion.bone_mapping import recognise
from cospeech.motion.rotations import quat_angle
from cospeech.motion.skeleton import Skeleton, humanoid
from cospeech.motion.skeletons.mixamo import NAMES as MIXAMO
from tests.support.motions import gesturing
from tests.support.skeletons import rename_joints, without

LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes")
HALF = without(humanoid(), ".*(Leg|Foot|Toes)")
NO_LEGS = {f"{side}{part}": "" for side in ("left", "right") for part in ("UpperLeg", "LowerLeg")}
LEGS = ", ".join(NO_LEGS)


def with_chain(skeleton: Skeleton, name: str, offset: tuple[float, float, float], count: int = 3) -> Skeleton:
    """A skeleton with one more chain of joints below the hips."""
    names = (*skeleton.names, *(f"{name} {k}" for k in range(count)))
    parents = (*skeleton.parents, 0, *range(len(skeleton), len(skeleton) + count - 1))
    offsets = [*skeleton.offsets, offset, *[(0.0, -0.25, 0.0)] * (count - 1)]
    return Skeleton(names, parents, np.array(offsets), ends=skeleton.ends)


def test_a_half_body_is_recognised():
    assert recognise(HALF) == {name: name for name in HALF.names}
    theirs = rename_joints(HALF, MIXAMO)
    assert recognise(theirs) == {name: MIXAMO.get(name, name) for name in HALF.names}
    below = Skeleton(
        ("Armature", *theirs.names), (-1, *(p + 1 for p in theirs.parents)), np.array([(0, 0, 0), *theirs.offsets])
    )
    assert recognise(below)["hips"] == "mixamorig:Hips"  # by its name: no legs meet there


@pytest.mark.parametrize("stretch", [1.0, 1.7])
def test_legs_under_strange_names_are_found_or_asked_for(stretch):
    """Two legs that are alike are found by the shape; with one of another length, an error asks for the legs alone."""
    strange = {f"{side}{part}": f"{side[0]}q{k}" for side in ("left", "right") for k, part in enumerate(LEG)}
    body = rename_joints(humanoid(), strange)
    body.offsets[body.index["lq1"]] *= stretch
    if stretch == 1:
        bones = recognise(body)
        assert {name: bones[name] for name in ("leftUpperLeg", "rightLowerLeg")} == {
            "leftUpperLeg": "lq0",
            "rightLowerLeg": "rq1",
        }
        return
    with pytest.raises(InputError, match=rf'cannot find {LEGS} among the 55 .*leftUpperLeg = "their name", or ""'):
        recognise(body)
    legs = {name: theirs for name, theirs in strange.items() if "Leg" in name}
    assert recognise(body, legs)["rightLowerLeg"] == "rq1"


def test_what_may_be_legs_is_asked_for_and_a_map_says_that_it_is_none():
    one = with_chain(HALF, "tail", (0.0, 0.0, -0.1))
    assert "leftUpperLeg" not in recognise(one)
    coat = with_chain(with_chain(HALF, "coat a", (0.1, -0.05, 0.0)), "coat b", (-0.1, -0.05, 0.1), 4)
    with pytest.raises(InputError, match=f"cannot find {LEGS} among"):
        recognise(coat)
    assert recognise(coat, NO_LEGS) == recognise(HALF)
    controls = with_chain(with_chain(HALF, "ik a", (0.1, -0.05, 0.0)), "pole b", (-0.1, -0.05, 0.1), 4)
    assert recognise(controls) == recognise(HALF)


@pytest.mark.parametrize(
    ("other", "bones"),
    [
        ({"leftUpperLeg": "q"}, "leftUpperLeg"),
        ({"rightLowerArm": "q"}, "rightLowerArm"),
        ({"leftUpperArm": "q", "leftLowerArm": "r", "leftHand": "s"}, "leftUpperArm, leftLowerArm"),
        ({"head": "q", "neck": "r"}, "head"),
    ],
)
def test_an_error_lists_what_is_not_found_and_nothing_else(other, bones):
    body = rename_joints(humanoid(), other)
    body.offsets[body.index["rightLowerArm" if "rightLowerArm" in body.index else "q"]] *= 1.7  # the shape tells nothing
    body.offsets[body.index["leftLowerLeg"]] *= 1.7
    with pytest.raises(InputError, match=rf"cannot find {bones} among the 55 joints .*\[bones\] {bones.split(',')[0]} = "):
        recognise(body)


def test_one_arm_may_lack_if_a_map_says_so():
    body = without(humanoid(), "left(Shoulder|UpperArm|LowerArm|Hand|Thumb.*|Index.*|Middle.*|Ring.*|Little.*)")
    with pytest.raises(InputError, match="cannot find leftUpperArm, leftLowerArm among"):
        recognise(body)
    bones = recognise(body, {"leftUpperArm": "", "leftLowerArm": ""})
    assert bones == {name: name for name in body.names}
    there = gesturing(10).retarget(replace(body, bone_map=bones))
    wrist, elbow = (there.positions()[:, body.index[name]] for name in ("rightHand", "rightLowerArm"))
    ours = gesturing(10).positions()
    np.testing.assert_allclose(
        wrist - elbow, ours[:, humanoid().index["rightHand"]] - ours[:, humanoid().index["rightLowerArm"]], atol=1e-6
    )


@pytest.mark.parametrize("size", [1.0, 0.3])
def test_hips_without_legs_move_about_their_place(size):
    """By the ratio of the trunks, wherever the rig has its origin; arms and head turn as on a whole body."""
    half = Skeleton(HALF.names, HALF.parents, size * HALF.offsets)
    half.offsets[0] = (0.0, 0.4, 0.0)
    motion = gesturing(40)
    there = motion.retarget(half)
    np.testing.assert_allclose(there.root - half.offsets[0], size * (motion.root - humanoid().offsets[0]), atol=1e-6)
    columns = [humanoid().index[name] for name in half.names]
    assert quat_angle(there.rotations, motion.rotations[:, columns]).max() < 1e-6
    back = there.retarget("humanoid")
    np.testing.assert_allclose(back.root, motion.root, atol=1e-6)
    assert quat_angle(back.rotations[:, columns], motion.rotations[:, columns]).max() < 1e-6
    far = motion.retarget(half, scale_root=False)
    np.testing.assert_allclose(far.root - half.offsets[0], motion.root - humanoid().offsets[0], atol=1e-6)


@pytest.mark.parametrize(("unit", "height"), [(0.01, 0.0), (1.0, 0.0), (0.01, 0.95)])
def test_a_bvh_without_legs_is_read_and_is_a_rig(tmp_path, unit, height):
    """Its unit is that of a person whose trunk is as long, and its T-pose hangs where the hips of the motion are."""
    motion = gesturing(40).retarget(HALF)
    root = motion.root - (0.0, HALF.tpose[0, 1] - height, 0.0)
    skeleton = replace(HALF, offsets=HALF.offsets * 0.01 / unit)  # a writer's numbers are centimetres
    save(replace(motion, skeleton=skeleton, root=root * 0.01 / unit), tmp_path / "half.bvh")
    with pytest.warns(CospeechWarning, match="'half.bvh' has no legs: the lower body does not move") as record:
        read = load(tmp_path / "half.bvh")
    assert len(record) == 1
    np.testing.assert_allclose(read.root, root, atol=1e-3)
    ours = read.retarget("humanoid")
    arms = [k for k, name in enumerate(humanoid().names) if "Arm" in name or name == "head"]
    assert quat_angle(ours.rotations, gesturing(40).rotations)[:, arms].max() < 1e-3
    assert ours.root[:, 1] == pytest.approx(humanoid().tpose[0, 1], abs=0.02)  # it stands, wherever the file's hips are
    with pytest.warns(CospeechWarning, match="has no legs") as record:
        rig = find_target(tmp_path / "half.bvh")
    assert len(record) == 1
    there = gesturing(40).retarget(rig)
    assert {*there.skeleton.names} == {*HALF.names}
    np.testing.assert_allclose(np.ptp(there.root, 0), np.ptp(motion.root, 0), atol=1e-3)


def test_a_motion_without_arms_is_not_recognised():
    with pytest.raises(InputError, match="cannot find leftUpperArm, leftLowerArm, rightUpperArm, rightLowerArm among"):
        recognise(without(humanoid(), "(left|right)(?!.*Leg|Foot|Toes|Eye).*"))
