"""The mannequin's cloth and skin follow motion without being torn."""

import numpy as np
import pytest
from mannequin.stretch import LIMIT, measure_stretch

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.export import mannequin
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity
from cospeech.motion.skeleton import humanoid
from cospeech.rules import STYLES

PARTS = ("shirt", "pocket", "trousers", "face", "leftHand", "rightHand", "leftShoe", "rightShoe", "leftSole", "rightSole")


def speak(style, seconds):
    speech = cospeech.Speech.load(EXAMPLE).window(0, seconds)
    return cospeech.load("rules").generate(speech, style=style, seed=3)


@pytest.mark.parametrize("style", ["natural", "seated"])
def test_no_edge_is_stretched_by_30_percent(style):
    by_part = measure_stretch(mannequin.build(), speak(style, 4), PARTS, every=5)
    for part, stretch in by_part.items():
        assert stretch.most < LIMIT, (part, stretch)


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES)
def test_no_edge_is_stretched_by_30_percent_in_any_style(style):
    by_part = measure_stretch(mannequin.build(), speak(style, 19), PARTS, every=3)
    for part, stretch in by_part.items():
        assert stretch.most < LIMIT, (part, stretch)


JOINTS_BENT = {  # about which axis, degrees, and the stretch of any edge of the part that follows; ours
    "leftUpperLeg": ((-1.0, 0.0, 0.0), 110, {"trousers": 0.45}),
    "leftLowerLeg": ((1.0, 0.0, 0.0), 120, {"trousers": 0.45}),
    "leftLowerArm": ((0.0, -1.0, 0.0), 140, {"shirt": 0.45}),
    "leftUpperArm": ((0.0, 0.0, -1.0), 80, {"shirt": 0.45}),
    "leftIndexProximal": ((0.0, 0.0, -1.0), 80, {"leftHand": 0.3}),
    "rightRingProximal": ((0.0, 0.0, 1.0), 80, {"rightHand": 0.3}),
    "leftThumbMetacarpal": ((0.0, 1.0, 0.0), 75, {"leftHand": 0.3}),
    "head": ((0.0, 1.0, 0.0), 60, {"face": 0.45}),
    "leftToes": ((-1.0, 0.0, 0.0), 40, {"leftShoe": 0.3, "leftSole": 0.3}),
}


@pytest.mark.parametrize("joint", JOINTS_BENT)
def test_a_joint_near_its_limit_stretches_its_part_little(joint):
    axis, degrees, limits = JOINTS_BENT[joint]
    skeleton = humanoid()
    rotations = np.tile(quat_identity(len(skeleton)), (1, 1, 1))
    rotations[0, skeleton.index[joint]] = axis_angle_to_quat(np.array(axis), np.radians(degrees))
    by_part = measure_stretch(mannequin.build(), Motion(30.0, rotations, skeleton.offsets[:1]), limits)
    for part, most in limits.items():
        assert by_part[part].most < most, (part, by_part[part])


def test_stretch_of_a_bent_elbow_is_found():
    skeleton = humanoid()
    rotations = np.tile(quat_identity(len(skeleton)), (2, 1, 1))
    rotations[1, skeleton.index["leftLowerArm"]] = axis_angle_to_quat(np.array([0.0, 1.0, 0.0]), np.radians(-150))
    motion = Motion(30.0, rotations, np.tile(skeleton.offsets[0], (2, 1)))
    still, elbow = (measure_stretch(mannequin.build(), part, ("shirt",))["shirt"] for part in (motion[:1], motion))
    assert still.most < 1e-3
    assert still.ever == still.mean == 0
    assert 0.2 < elbow.most < 0.6
    assert elbow.mean == pytest.approx(elbow.ever / 2)
