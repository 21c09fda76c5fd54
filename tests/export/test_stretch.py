"""The mannequin's cloth and skin follow motion without being torn."""

import numpy as np
import pytest
from mannequin.stretch import measure_stretch

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.export import mannequin
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity
from cospeech.motion.skeleton import humanoid


@pytest.mark.slow
def test_gesturing_stretches_few_edges():
    speech = cospeech.Speech.load(EXAMPLE).window(0, 6)
    motion = cospeech.load("rules").generate(speech, seed=3)
    limits = {"shirt": (0.46, 0.005), "trousers": (0.30, 1e-9), "face": (0.30, 1e-9)}
    limits |= dict.fromkeys(("leftHand", "rightHand"), (0.80, 0.03))
    found = measure_stretch(mannequin.build(), motion, limits, every=5)
    for part, (most, ever) in limits.items():
        assert found[part].most < most, (part, found[part])
        assert found[part].ever < ever, (part, found[part])


def test_stretch_of_a_bent_elbow_is_found():
    skeleton = humanoid()
    rotations = np.tile(quat_identity(len(skeleton)), (2, 1, 1))
    rotations[1, skeleton.index["leftLowerArm"]] = axis_angle_to_quat(np.array([0.0, 1.0, 0.0]), np.radians(-150))
    motion = Motion(30.0, rotations, np.tile(skeleton.offsets[0], (2, 1)))
    still, bent = (measure_stretch(mannequin.build(), part, ("shirt",))["shirt"] for part in (motion[:1], motion))
    assert still.most < 1e-3
    assert still.ever == still.mean == 0
    assert 0.2 < bent.most < 0.6
    assert bent.mean == pytest.approx(bent.ever / 2)
