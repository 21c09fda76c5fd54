"""Arms that bend as arms do: elbows one way, hands about the forearm and wrists within their limits."""

from __future__ import annotations

import numpy as np
import pytest

import cospeech
from cospeech.audio.speech import Speech, example
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, euler_to_quat, quat_angle, quat_multiply
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.arm_limits import ArmLimits
from tests.support.motions import gesturing
from tests.support.rules_laws import SIDES, _arm_angles

FPS = 30.0
ARMS = [f"{side}{part}" for side in ("left", "right") for part in ("Shoulder", "UpperArm", "LowerArm", "Hand")]


def limit(motion, size=1_000):
    layer = ArmLimits(motion.fps)
    parts = [layer.push(motion.rotations[k : k + size], motion.root[k : k + size])[0] for k in range(0, len(motion), size)]
    parts.append(layer.finish()[0])
    return Motion(motion.fps, np.concatenate(parts), motion.root, motion.face, motion.skeleton)


def worst(motion):
    """Name of an angle of the arms → degrees by which it is beyond its limit, at most."""
    excess = {}
    for side, sign in SIDES:
        for name, (angle, low, high) in _arm_angles(motion, side, sign).items():
            excess[f"{side} {name}"] = float(np.maximum(np.maximum(low - angle, angle - high), 0).max())
    return excess


def turn_upper_arm(motion, side, degrees):
    """Turn an upper arm about its own axis and the forearm back: elbow and wrist stay in their places."""
    index, out = motion.skeleton.index, motion.rotations.astype(float).copy()
    about = axis_angle_to_quat(np.array([1.0, 0.0, 0.0]), np.radians(np.broadcast_to(degrees, (len(motion),))))
    upper, fore = index[f"{side}UpperArm"], index[f"{side}LowerArm"]
    out[:, upper] = quat_multiply(out[:, upper], about)
    out[:, fore] = quat_multiply(about * [-1, -1, -1, 1], out[:, fore])
    return Motion(motion.fps, out.astype(np.float32), motion.root, motion.face, motion.skeleton)


@pytest.fixture(scope="module")
def spoken():
    """Six seconds of the rules."""
    return cospeech.load("rules").generate(Speech.load(example()[0]).window(0, 6), seed=2, style="lively")


def test_arms_within_their_limits_stay_as_they_are(spoken):
    result = limit(spoken)
    degrees = np.degrees(quat_angle(spoken.rotations.astype(float), result.rotations.astype(float))).max(0)
    assert degrees.max() < 6, "the rules allow a hand 4° more about the forearm"
    assert np.degrees(quat_angle(spoken.rotations.astype(float), result.rotations.astype(float))).mean() < 0.05


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("degrees", [-170, -100, -40, 40, 100, 170])
def test_an_elbow_that_bends_the_wrong_way_bends_as_it_can_and_the_hand_stays_in_its_place(spoken, side, degrees):
    wrong = turn_upper_arm(spoken, side, degrees)
    result = limit(wrong)
    names = f"{side} elbow flexion", f"{side} elbow hinge"
    assert max(worst(wrong)[name] for name in names) > 15
    assert all(worst(result)[name] < 4 for name in names), worst(result)
    places = [each.positions()[:, [each.skeleton.index[name] for name in ARMS]] for each in (wrong, result)]
    assert np.abs(places[0] - places[1]).max() < 1e-5


def test_a_turn_that_comes_and_goes_is_followed_below_the_speed_of_an_arm(spoken):
    comes = np.where((spoken.times > 2) & (spoken.times < 4), 150.0, 0.0)
    smooth = np.convolve(np.pad(comes, 15, mode="edge"), np.ones(31) / 31, "valid")
    wrong = turn_upper_arm(spoken, "right", smooth)
    result = limit(wrong)
    joint = result.skeleton.index["rightUpperArm"]
    own, limited_speed = (
        quat_angle(m.rotations[:-1, joint].astype(float), m.rotations[1:, joint].astype(float)).max() * FPS
        for m in (wrong, result)
    )
    assert limited_speed < own + 8.5
    angles = dict(zip(("flexion", "hinge"), (worst(result)[f"right elbow {n}"] for n in ("flexion", "hinge")), strict=True))
    assert max(angles.values()) < 25


@pytest.mark.parametrize("size", [1, 7, 50])
def test_pieces_give_what_the_whole_gives(spoken, size):
    wrong = turn_upper_arm(spoken, "left", np.linspace(-180, 180, len(spoken)))
    assert np.array_equal(limit(wrong).rotations, limit(wrong, size).rotations)


@pytest.mark.parametrize("side", ["left", "right"])
def test_hands_and_wrists_come_within_their_limits(side):
    still, sign = gesturing(60, FPS), 1 if side == "left" else -1
    index, rotations = humanoid().index, still.rotations.astype(float).copy()
    fore, hand = index[f"{side}LowerArm"], index[f"{side}Hand"]
    twist = axis_angle_to_quat(np.array([1.0, 0.0, 0.0]), np.radians(150 * sign))
    rotations[:, fore] = quat_multiply(rotations[:, fore], twist)
    angles = {"supination": (0, 0), "wrist flexion": (0, -110), "wrist deviation": (60, 0)}
    for name, (deviation, flexion) in angles.items():
        rotations[:, hand] = euler_to_quat(np.radians([0.0, deviation * sign, flexion * sign]), "XYZ")
        wrong = Motion(FPS, rotations.astype(np.float32), still.root, still.face, still.skeleton)
        assert worst(wrong)[f"{side} {name}"] > 5, name
        assert worst(limit(wrong))[f"{side} {name}"] < 0.01, name
        assert worst(limit(wrong))[f"{side} supination"] < 0.01, name


def shares(motion):
    """Name of an angle of the arms → share of the frames in which it is beyond its limit by more than 3°."""
    fractions = {}
    for side, sign in SIDES:
        for name, (angle, low, high) in _arm_angles(motion, side, sign).items():
            fractions[f"{side} {name}"] = float(np.mean(np.maximum(low - angle, angle - high) > 3))
    return fractions


@pytest.mark.parametrize("model", ["chain-of-generation", "mix-stage", "stylised-flow"])
def test_files_of_models_that_ship_have_elbows_that_bend_one_way(model):
    player, speech = cospeech.load(model), Speech.load(example()[0])
    excess = shares(player.generate(speech, seed=1, **player.for_files))
    elbows = [excess[f"{side} elbow {name}"] for side in ("left", "right") for name in ("flexion", "hinge")]
    assert max(elbows) < 0.02
    assert max(excess[f"{side} {name}"] for side in ("left", "right") for name in ("supination", "wrist flexion")) < 0.03
    if model == "stylised-flow":
        bare = shares(player.generate(speech, seed=1, **{**player.for_files, "arm_limits": False}))
        assert max(bare.values()) > 0.05, "the network alone breaks them"


def test_the_option_is_true_or_false():
    with pytest.raises(InputError, match="arm_limits is 'yes'"):
        cospeech.load("rules").session(arm_limits="yes")
