"""Arms that others move stay out of the body."""

import numpy as np
import pytest

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.kinematics.arm_clearance import keep_arms_out, push_from_body, trunk_frames
from cospeech.motion.kinematics.arms import MIRROR_Q, MIRROR_V, solve_arm, to_parent
from cospeech.motion.rotations import axis_angle_to_quat, quat_conjugate, quat_identity, quat_rotate
from cospeech.motion.skeleton import humanoid
from cospeech.rules.options import LAYERS

NEARLY = 0.006  # metres; pushes are soft


def pose(wrist, bend=0.0):
    """(1, J, 4): both wrists at a place of the T-pose (3,), metres, the right one mirrored; the chest bent by some degrees."""
    s = humanoid()
    q, joint = quat_identity(1, len(s)), s.index
    target = np.array(wrist) - s.tpose[joint["leftUpperArm"]]
    upper, fore = solve_arm(target, np.array(0.0))
    for side, mirror in (("left", 1.0), ("right", MIRROR_Q)):
        q[:, joint[side + "UpperArm"]], q[:, joint[side + "LowerArm"]] = upper * mirror, to_parent(upper, fore) * mirror
    q[:, joint["chest"]] = axis_angle_to_quat(np.array([1.0, 0.0, 0.0]), np.radians(bend))
    return q


def wrists(q):
    """(n, 2, 3) from the upper chest in its frame, the right side mirrored."""
    s = humanoid()
    at, turns = s.forward(q, np.zeros((len(q), 3)) + s.offsets[0])
    chest, back = at[:, s.index["upperChest"]], quat_conjugate(turns[:, s.index["upperChest"]])
    left, right = (quat_rotate(back, at[:, s.index[side + "Hand"]] - chest) for side in ("left", "right"))
    return np.stack([left, right * MIRROR_V], 1)


def depth(q, radius=0.03):
    """(n, 2) metres that the wrists are inside."""
    return np.linalg.norm(push_from_body(wrists(q), radius, trunk_frames(q)), axis=-1)


INSIDE = {
    "belly": (0.08, 1.08, 0.05),
    "flank": (0.12, 1.05, -0.03),
    "back": (0.10, 1.10, -0.07),
    "chest": (0.06, 1.28, 0.06),
    "face": (0.04, 1.60, 0.06),
}
BESIDE = (0.38, 0.85, 0.05)


@pytest.mark.parametrize("bend", [0.0, 25.0])
@pytest.mark.parametrize("name", INSIDE)
def test_a_hand_in_the_body_comes_out(name, bend):
    q = pose(INSIDE[name], bend)
    assert depth(q).max() > 0.02, "the case is one"
    keep_arms_out(q)
    assert depth(q).max() < NEARLY
    assert np.linalg.norm(q, axis=-1) == pytest.approx(1.0)


def test_both_sides_move_alike():
    q = pose(INSIDE["belly"])
    keep_arms_out(q)
    left, right = wrists(q)[0]
    np.testing.assert_allclose(left, right, atol=1e-9)


def test_arms_that_touch_nothing_keep_their_bits():
    q = np.concatenate([pose(BESIDE), pose(INSIDE["belly"]), pose((0.2, 1.2, 0.45))])
    before = q.copy()
    keep_arms_out(q)
    np.testing.assert_array_equal(q[[0, 2]], before[[0, 2]])
    assert np.abs(q[1] - before[1]).max() > 0.01


def test_an_arm_goes_a_share_of_the_way_and_its_hand_and_trunk_stay():
    whole, half, joint = pose(INSIDE["belly"]), pose(INSIDE["belly"]), humanoid().index
    none, before = half.copy(), half.copy()
    keep_arms_out(whole)
    keep_arms_out(half, 0.5)
    keep_arms_out(none, 0.0)
    np.testing.assert_array_equal(none, before)
    assert 0 < depth(half).max() < depth(before).max()
    arms = {joint[side + name] for side in ("left", "right") for name in ("UpperArm", "LowerArm")}
    rest = [k for k in range(len(humanoid())) if k not in arms]
    np.testing.assert_array_equal(whole[:, rest], before[:, rest])


def test_a_way_into_the_body_is_left_without_a_jump():
    """A wrist that goes from the side through the belly to the front moves on in steps of about its own size."""
    ways = np.linspace((0.24, 1.08, -0.06), (0.02, 1.10, 0.20), 81)
    q = np.concatenate([pose(way) for way in ways])
    assert depth(q).max() > 0.02, "the case is one"
    usual = np.linalg.norm(np.diff(wrists(q)[:, 0], axis=0), axis=-1).max()
    keep_arms_out(q)
    assert depth(q).max() < NEARLY
    assert np.linalg.norm(np.diff(wrists(q)[:, 0], axis=0), axis=-1).max() < 3.5 * usual


def test_a_frame_depends_on_itself_alone():
    q = np.concatenate([pose(INSIDE[name]) for name in INSIDE])
    apart = [q[k : k + 1].copy() for k in range(len(q))]
    keep_arms_out(q)
    for part in apart:
        keep_arms_out(part)
    np.testing.assert_array_equal(q, np.concatenate(apart))


@pytest.mark.parametrize("name", ["stylised-flow", "mix-stage", "chain-of-generation"])
def test_hands_of_trained_models_stay_out_of_the_body_in_files(name):
    speech = cospeech.Speech.load(EXAMPLE)
    motion = cospeech.load(name).generate(speech, parts=("body", "hands"), seed=1, **dict.fromkeys(LAYERS, True))
    assert depth(motion.rotations.astype(float)).max() < NEARLY
