"""Hands that wait beside the body."""

import numpy as np
import pytest

from cospeech.motion.kinematics import arms
from cospeech.motion.kinematics.hands import Channel
from cospeech.motion.rotations import quat_multiply, quat_rotate
from cospeech.rules.rest_poses import RESTS


@pytest.mark.parametrize("name", ["hang", "low"])
@pytest.mark.parametrize("hand", [0, 1])
def test_a_palm_beside_the_hip_faces_the_thigh(name, hand):
    pose = RESTS[name][hand].values()
    _, forearm = arms.solve_arm(arms.reach(pose[None, :3] * arms.arm_lengths().total), np.radians(pose[None, Channel.SWIVEL]))
    pronation, wrist = arms.hand_turns(np.radians(pose[None, 4:7]))
    palm = quat_rotate(quat_multiply(forearm, quat_multiply(pronation, wrist)), np.array([[0.0, -1.0, 0.0]]))[0]
    assert np.degrees(np.arccos(-palm[0])) < 30  # the thigh is at -x of a left hand; the right one is mirrored
