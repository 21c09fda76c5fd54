"""The rule-based gesturer over 120 random speeches, styles, emotions, seeds and intensities."""

from __future__ import annotations

from itertools import pairwise
from math import ceil

import numpy as np
import pytest

from cospeech import Speech
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, euler_to_quat, quat_identity
from cospeech.rules import EMOTIONS, STYLES, RuleBasedModel
from tests.support.rules_laws import AT, SKELETON, babble, find_broken_laws, wrist_distance

GROUPS, EACH = 20, 6
INTENSITIES = (0.5, 0.8, 1.0, 1.25, 1.5)
FPS = (30.0, 25.0, 60.0)


def combination(number: int) -> tuple[Speech, dict]:
    """Speech and options of the ``number``-th case; styles and emotions take turns, so that each meets each."""
    rng = np.random.default_rng(number)
    styles, emotions = list(STYLES), [*EMOTIONS, "auto"]
    options = {
        "style": styles[number % len(styles)],
        "emotion": emotions[(number // len(styles) + number) % len(emotions)],
        "seed": int(rng.integers(1 << 31)),
        "intensity": float(rng.choice(INTENSITIES)),
        "fps": float(rng.choice(FPS, p=(0.7, 0.15, 0.15))),
    }
    return Speech(babble(number), 16000), options


@pytest.mark.slow
@pytest.mark.parametrize("group", range(GROUPS))
def test_laws_of_the_body(group):
    faults_of_numbers = {}
    for number in range(group * EACH, (group + 1) * EACH):
        speech, options = combination(number)
        motion = RuleBasedModel().generate(speech, **options)
        faults = find_broken_laws(motion, stand=not STYLES[options["style"]].seated)
        if len(motion) != ceil(speech.duration * int(options["fps"])):
            faults.append(f"{len(motion)} frames")
        if faults:
            faults_of_numbers[f"{number}: {options}"] = faults
    assert faults_of_numbers == {}


@pytest.mark.slow
@pytest.mark.parametrize("number", range(300, 306))
def test_the_stream_in_pieces_of_any_size_is_the_whole(number):
    speech, options = combination(number)
    rng = np.random.default_rng(number)
    whole = RuleBasedModel().generate(speech, **options)
    edges = np.unique(np.concatenate([[0, len(speech.samples)], rng.integers(1, len(speech.samples), rng.integers(1, 40))]))
    pieces = [Speech(speech.samples[a:b], speech.rate, start=a / speech.rate) for a, b in pairwise(edges)]
    parts = list(RuleBasedModel().stream(iter(pieces), **options))
    motion = Motion.concatenate(parts)
    assert len(parts) > 1
    assert len(motion) == len(whole)
    assert np.abs(motion.root - whole.root).max() <= 1e-5
    assert np.abs(motion.face - whole.face).max() <= 1e-5
    assert np.abs(motion.rotations - whole.rotations).max() <= 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("style", list(STYLES))
def test_the_same_seed_gives_the_same_bytes_and_another_one_another_performance(style):
    speech = Speech(babble(400, 8.0), 16000)
    options = {"style": style, "emotion": "neutral", "fps": 30.0}
    one, again = (RuleBasedModel().generate(speech, seed=1, **options) for _ in range(2))
    for name in ("rotations", "root", "face"):
        assert getattr(one, name).tobytes() == getattr(again, name).tobytes()
    others = [RuleBasedModel().generate(speech, seed=seed, **options) for seed in (2, 3, 4)]
    assert np.mean([wrist_distance(one, other) for other in others]) > 0.03


def tpose(frames: int = 30) -> Motion:
    """A motionless T-pose: breaks no law."""
    return Motion(30.0, quat_identity(frames, len(SKELETON)), np.tile(SKELETON.offsets[0], (frames, 1)), np.zeros((frames, 52)))


def bend(turns: dict[str, tuple[tuple[float, float, float], float]], root: tuple[float, float, float] = (0, 0, 0)) -> Motion:
    motion = tpose()
    for name, (axis, angle) in turns.items():
        motion.rotations[:, AT[name]] = axis_angle_to_quat(axis, np.radians(angle))
    motion.root[:] += root
    return motion


def test_a_standing_body_breaks_no_law():
    assert find_broken_laws(tpose(), stand=True) == []


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
WRONG = {
    "elbow flexion": {"leftLowerArm": (Y, 30)},  # backward
    "elbow hinge": {"rightLowerArm": (Z, 40)},
    "supination": {"leftLowerArm": (X, 70), "leftHand": (X, 50)},
    "wrist flexion": {"rightHand": (Z, 95)},
    "wrist deviation": {"leftHand": (Y, -40)},
    "knuckle": {"leftIndexProximal": (Z, 50)},
    "middle joint": {"rightRingIntermediate": (Z, -20)},
    "hinges": {"leftLittleDistal": (X, 20)},
    "thumb": {"leftThumbDistal": (Y, 100)},
    "head yaw": {"head": (Y, 80)},
    "head pitch": {"neck": (X, -60)},
    "trunk roll": {"spine": (Z, 40)},
    "upper arm inward": {"leftUpperArm": (Y, -160)},
    "upper arm backward": {"rightUpperArm": (Y, -80)},
    "clavicle": {"leftShoulder": (Z, 50)},
    "knee": {"leftLowerLeg": (X, -20)},
    "inside the torso": {"leftUpperArm": (Z, -80), "leftLowerArm": (Z, -120)},
    "under the ground": {"rightFoot": (X, 20)},
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_pose_is_noticed(what):
    assert any(what in fault for fault in find_broken_laws(bend(WRONG[what]), stand=True))


FACEPALM = (-40, 30, -60, -130)  # degrees: upper arm about Y, Z and X, then the elbow


def _slide(motion: Motion) -> None:
    motion.root[:, 0] += np.arange(len(motion)) * 0.02 / 30


def _jump(motion: Motion) -> None:
    motion.root[10:20, 1] += 0.05


def _whip(motion: Motion) -> None:
    motion.rotations[15:, AT["head"]] = axis_angle_to_quat(Y, np.radians(20))


def _flip(motion: Motion) -> None:
    motion.rotations[10:, AT["jaw"]] *= -1


def _grow(motion: Motion) -> None:
    motion.rotations[5] *= 1.01


def _overdo(motion: Motion) -> None:
    motion.face[3, 7] = 1.2


def _facepalm(motion: Motion) -> None:
    motion.rotations[:, AT["leftUpperArm"]] = euler_to_quat(np.radians(FACEPALM[:3]), "YZX")
    motion.rotations[:, AT["leftLowerArm"]] = axis_angle_to_quat(Y, np.radians(FACEPALM[3]))


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (_slide, "slides"),
        (_jump, "in the air"),
        (_whip, "head turns at"),
        (_flip, "flip their sign"),
        (_grow, "unit length"),
        (_overdo, "face weights"),
        (_facepalm, "inside the head"),
    ],
)
def test_a_wrong_movement_is_noticed(spoil, fault):
    motion = tpose()
    spoil(motion)
    assert any(fault in message for message in find_broken_laws(motion, stand=True))


def test_seated_hips_that_move_are_noticed():
    motion = tpose()
    motion.root[:, 0] += np.linspace(0, 0.05, len(motion))
    assert any("seated" in fault for fault in find_broken_laws(motion, stand=False))


@pytest.mark.slow
def test_babble_is_like_speech():
    for seed in range(5):
        samples = babble(seed)
        energy = np.square(samples[: len(samples) // 800 * 800]).reshape(-1, 800).mean(-1)
        assert 3 * 16000 <= len(samples) <= 6 * 16000
        assert np.isfinite(samples).all()
        assert np.abs(samples).max() <= 0.51
        assert np.median(energy) < 0.5 * energy.max()  # syllables and pauses, not a tone
