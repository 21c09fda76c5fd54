"""Our humanoid in 57 numbers: there and back on what the rules make, feet that stay, rows that stand alone."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech import InputError, Motion, Speech, humanoid
from cospeech.motion.kinematics.arms import finger_angles, finger_rotations
from cospeech.motion.kinematics.hands import CHANNELS, HAND_SHAPES
from cospeech.motion.kinematics.legs import SEAT, STANCE, plant
from cospeech.motion.poses.humanoid import HUMANOID, JOINTS, hand_basis
from cospeech.motion.rotations import axis_angle_to_quat, quat_angle, quat_continuous, quat_multiply
from cospeech.motion.skeleton import find_skeleton
from cospeech.rules import STYLES, RuleBasedModel
from tests.support.rules_laws import babble

HIPS_Y = HUMANOID.names.index("hips.y")
INDEX = humanoid().index
_FINGER = ("Proximal", "Intermediate", "Distal")


@pytest.fixture(scope="module")
def motions() -> dict[str, Motion]:
    return {style: RuleBasedModel().generate(Speech(babble(2, 6.0), 16000), style=style, seed=5, fps=20) for style in STYLES}


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES)
def test_there_and_back_on_what_the_rules_make(motions, style):
    motion = motions[style]
    vectors = HUMANOID.encode(motion)
    back = HUMANOID.decode(vectors, motion.fps)
    again = HUMANOID.encode(back)
    others = np.arange(57) != HIPS_Y
    np.testing.assert_allclose(again[:, others], vectors[:, others], atol=1e-5)
    sinking = vectors[:, HIPS_Y] - again[:, HIPS_Y]  # planted feet do not step after the hips
    assert sinking.min() > -1e-5
    assert sinking.max() < 0.016
    np.testing.assert_allclose(HUMANOID.encode(HUMANOID.decode(again)), again, atol=1e-5)
    columns = [INDEX[name] for name in JOINTS]
    assert quat_angle(back.rotations[:, columns], motion.rotations[:, columns]).max() < 1e-5
    fingers = [*humanoid().left_hand, *humanoid().right_hand]
    off = np.degrees(quat_angle(back.rotations[:, fingers], motion.rotations[:, fingers]))
    assert off.mean() < 3
    assert np.percentile(off, 95) < 10
    wrists = [INDEX["leftHand"], INDEX["rightHand"]]
    have, want = (m.positions()[:, wrists] - m.root[:, None] for m in (back, motion))
    np.testing.assert_allclose(have, want, atol=1e-4)


@pytest.mark.parametrize("style", ["lively", "seated"])
def test_feet_stay_on_the_floor_and_knees_bend_forward(motions, style):
    motion = HUMANOID.decode(HUMANOID.encode(motions[style]), 20)
    points = motion.positions()
    feet = points[:, [INDEX["leftFoot"], INDEX["rightFoot"]]]
    assert np.ptp(feet, axis=0).max() < 1e-4
    np.testing.assert_allclose(feet[..., 1], humanoid().tpose[INDEX["leftFoot"], 1], atol=1e-4)
    hips, knees = (points[:, [INDEX[f"left{bone}"], INDEX[f"right{bone}"]]] for bone in ("UpperLeg", "LowerLeg"))
    if style == "seated":
        assert (knees - hips)[..., 2].min() > 0.3
    else:  # in front of the line from hip to ankle
        share = ((hips - knees) / (hips - feet))[..., 1]
        assert (knees - hips - share[..., None] * (feet - hips))[..., 2].min() > 0


def test_legs_of_hips_that_sink_do_not_jump():
    height = np.linspace(0.96, SEAT, 400)
    vectors = np.zeros((400, 57))
    vectors[:, HIPS_Y] = height - humanoid().offsets[0, 1]
    motion = HUMANOID.decode(vectors)
    points = motion.positions()
    assert np.abs(np.diff(points, axis=0)).max() < 0.008  # 1.1 mm of the hips from frame to frame
    assert points[-1, INDEX["leftFoot"], 2] > 0.35
    assert abs(points[0, INDEX["leftFoot"], 2]) < 0.02


def test_hips_higher_than_the_legs_are_lowered_smoothly():
    place = np.stack([np.linspace(-0.3, 0.3, 200), np.full(200, 1.4), np.zeros(200)], -1)
    _, _, hips = plant(np.broadcast_to([0.0, 0, 0, 1], (200, 4)), place)
    assert hips[:, 1].max() < 0.96
    assert np.abs(np.diff(hips[:, 1], 2)).max() < 1e-4  # no kink where the other leg becomes the shorter one
    np.testing.assert_array_equal(place[:, 1], 1.4)


def test_each_frame_is_its_own_row(motions):
    vectors = np.concatenate([HUMANOID.encode(motions[style])[:40] for style in ("orator", "seated")]).astype(np.float32)
    whole = HUMANOID.decode(vectors, 20)
    pieces = Motion.concatenate(HUMANOID.decode(vectors[k : k + 7], 20, start=k / 20) for k in range(0, len(vectors), 7))
    np.testing.assert_array_equal(quat_continuous(whole.rotations), pieces.rotations)
    np.testing.assert_array_equal(whole.root, pieces.root)
    assert whole.rotations.dtype == whole.root.dtype == np.float32
    assert len(HUMANOID.decode(vectors[:0], 20)) == 0
    assert HUMANOID.decode(vectors[:1], 20, start=1.5).start == 1.5


def test_hand_shapes_keep_their_look():
    mean, basis = hand_basis()
    np.testing.assert_allclose(basis @ basis.T, np.eye(6), atol=1e-12)
    table = np.radians([shape.values() for shape in HAND_SHAPES.values()]) - mean
    off = np.degrees(table - table @ basis.T @ basis)
    assert np.sqrt((off**2).mean()) < 2.0
    assert (basis[np.arange(6), np.abs(basis).argmax(1)] > 0).all()


def test_finger_angles_are_read_as_they_are_written():
    channels = np.zeros((200, 2, CHANNELS))
    random = np.random.default_rng(4)
    channels[..., 7:15] = random.uniform(-15, 60, (200, 2, 8))
    channels[..., 15:19] = random.uniform(-20, 40, (200, 2, 4))
    rotations = finger_rotations(channels) * random.choice([-1.0, 1.0], (200, 2, 15, 1))  # signs mean nothing
    angles, visibility = finger_angles(rotations)
    np.testing.assert_allclose(np.degrees(angles), channels[..., 7:19], atol=1e-9)
    assert visibility.min() > 0
    channels[..., 7:11] = 80  # a fist hides the spread
    angles, visibility = finger_angles(finger_rotations(channels))
    assert not visibility.any()
    assert np.isfinite(angles).all()


def test_any_hand_is_encoded_by_the_nearest():
    """Hands of motion capture, twisted a little and not coupled as ours."""
    rotations = np.broadcast_to([0.0, 0, 0, 1], (50, 55, 4)).copy()
    random = np.random.default_rng(1)
    hands = [*humanoid().left_hand, *humanoid().right_hand]
    axis = random.normal(size=(50, 30, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    bend = axis_angle_to_quat(np.array([0.0, 0, 1]), -0.6 * np.r_[np.ones(15), -np.ones(15)])
    rotations[:, hands] = quat_multiply(bend, axis_angle_to_quat(axis, random.uniform(0, 0.1, (50, 30))))
    motion = Motion(20, rotations, np.broadcast_to(humanoid().offsets[0], (50, 3)))
    back = HUMANOID.decode(HUMANOID.encode(motion))
    fingers = [k for k in hands if "Thumb" not in humanoid().names[k]]
    assert np.degrees(quat_angle(back.rotations[:, fingers], rotations[:, fingers])).mean() < 10


def test_left_and_right_are_mirror_images(motions):
    vectors, mirrored = HUMANOID.encode(motions["storyteller"]), HUMANOID.encode(motions["storyteller"].mirror())
    np.testing.assert_allclose(mirrored[:, 45:51], vectors[:, 51:57], atol=1e-5)
    left, right = (HUMANOID.names.index(f"{side}UpperArm.rx") for side in ("left", "right"))
    np.testing.assert_allclose(mirrored[:, left : left + 3], vectors[:, right : right + 3] * [1, -1, -1], atol=1e-5)


def test_wild_numbers_give_motion_all_the_same():
    """The numbers are those of an untrained network."""
    random = np.random.default_rng(3)
    wild = random.normal(size=(500, 57)) * 10.0 ** random.uniform(-9, 1.2, (500, 1))
    motion = HUMANOID.decode(np.clip(wild, -99, 99))
    assert np.isfinite(motion.positions()).all()
    wild[:, 3:45] = 0  # fingers bend as far as hands can
    fingers = [INDEX[side + f + part] for side in ("left", "right") for f in ("Index", "Little") for part in _FINGER]
    rotations = HUMANOID.decode(np.clip(wild, -99, 99)).rotations[:, fingers]
    assert np.degrees(quat_angle(rotations, humanoid().rest[fingers])).max() < 115
    for side in ("left", "right"):  # a hip on its ankle, and straight behind it
        way = humanoid().tpose[INDEX[side + "UpperLeg"]] - humanoid().offsets[0]
        foot = np.array([STANCE if side == "left" else -STANCE, *humanoid().tpose[INDEX["leftFoot"], 1:]])
        ahead = np.array([0.0, 0.0, 0.42])
        turn = np.array([np.sin(np.radians(9)) * (1 if side == "left" else -1), 0.0, np.cos(np.radians(9))])
        places = foot + ahead - way - np.array([0.0, 0.2, 0.4, 1.0])[:, None] * turn
        _, legs, _ = plant(np.broadcast_to([0.0, 0, 0, 1], (4, 4)), places)
        np.testing.assert_allclose(np.linalg.norm(legs, axis=-1), 1, atol=1e-9)


@pytest.mark.parametrize(
    ("vectors", "words"),
    [
        (np.zeros((3, 56)), "57"),
        (np.zeros(57), "57"),
        (np.full((1, 57), np.nan), "not finite"),
        (np.full((1, 57), np.inf), "not finite"),
        (np.full((1, 57), 1e30), "not finite or above"),
    ],
)
def test_bad_vectors_are_told(vectors, words):
    with pytest.raises(InputError, match=words):
        HUMANOID.decode(vectors)


def test_other_skeletons_are_told():
    with pytest.raises(InputError, match="retarget"):
        HUMANOID.decode(np.zeros((1, 57)), 20, find_skeleton("beat"))
    beat = find_skeleton("beat")
    rest = np.broadcast_to(beat.rest, (3, len(beat), 4))
    with pytest.raises(InputError, match="retarget"):
        HUMANOID.encode(Motion(20, rest, np.zeros((3, 3)), skeleton=beat))
