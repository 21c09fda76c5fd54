"""Hands of trained models that hold still between strokes; a stream gives what the whole gives."""

from __future__ import annotations

import numpy as np
import pytest

import cospeech
from cospeech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.kinematics.arms import wrists_in_chest
from cospeech.motion.part_joints import arm_joints
from cospeech.motion.rotations import Array, quat_identity
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.hand_holds import HandHolds
from cospeech.runtime.hand_speeds import HandSpeeds

FPS = 30.0
JOINTS = humanoid().index


def arms(bend: dict[str, Array]) -> tuple[Array, Array]:
    """Elbows that bend by so many radians; a head that nods; fingers of both hands that never rest."""
    frames = len(next(iter(bend.values())))
    at = np.arange(frames) / FPS
    rotations = np.broadcast_to(quat_identity(1), (frames, len(humanoid()), 4)).astype(np.float32).copy()
    bend = bend | {"head": 0.3 * np.sin(at)} | {f"{side}IndexProximal": 0.2 * np.sin(9 * at) for side in ("left", "right")}
    for name, angle in bend.items():
        rotations[:, JOINTS[name], 1], rotations[:, JOINTS[name], 3] = np.sin(angle / 2), np.cos(angle / 2)
    return rotations, np.stack([at, np.ones_like(at), np.zeros_like(at)], -1).astype(np.float32)


def strokes(seconds: float, times: list[float]) -> Array:
    """An elbow that bends by 60 degrees at each time, one way and back, and drifts by 4 degrees meanwhile."""
    at = np.arange(round(seconds * FPS)) / FPS
    bend = np.radians(4) * np.sin(2 * np.pi * 0.7 * at)
    for k, time in enumerate(times):
        bend += (-1) ** k * np.radians(60) / (1 + np.exp(-(at - time) / 0.06))
    return bend


def hold(rotations: Array, root: Array) -> tuple[Array, Array]:
    layer = HandHolds(FPS)
    pieces = [layer.push(rotations, root), layer.finish()]
    whole, places = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    return whole, places


def still(rotations: Array, side: int = 1) -> Array:
    """Whether a wrist moves by less than 5 cm per second, of each pair of frames."""
    steps = np.diff(wrists_in_chest(rotations.astype(float))[:, side], axis=0)
    return np.sqrt(np.square(steps).sum(-1)) * FPS < 0.1  # arm lengths


def test_a_hand_that_drifts_is_held_and_its_strokes_stay():
    times = [3.0, 6.0, 9.0]
    rotations, root = arms({"rightLowerArm": strokes(12, times)})
    result, same = hold(rotations, root)
    np.testing.assert_array_equal(same, root)
    assert still(rotations).mean() < 0.5
    assert still(result).mean() > 0.65
    before, after = (wrists_in_chest(q.astype(float))[:, 1] for q in (rotations, result))
    assert np.linalg.norm(before - after, axis=-1).max() < 0.16
    for time in times:
        around = slice(round((time - 0.1) * FPS), round((time + 0.1) * FPS))
        np.testing.assert_allclose(after[around], before[around], atol=0.02)
    np.testing.assert_array_equal(result[[0, -1]], rotations[[0, -1]])
    finger = JOINTS["rightIndexProximal"]
    assert np.abs(np.diff(result[45:75, finger], axis=0)).max() < 0.2 * np.abs(np.diff(rotations[45:75, finger], axis=0)).max()


def test_each_hand_has_its_own_holds_and_all_else_moves_on():
    rotations, root = arms({"rightLowerArm": strokes(10, [5.0]), "leftLowerArm": np.sin(np.arange(300) / FPS * 4)})
    result, _ = hold(rotations, root)
    mine = [k for k in arm_joints() if humanoid().names[k].startswith("right")]
    others = [k for k in range(len(humanoid())) if k not in mine]
    np.testing.assert_array_equal(result[:, others], rotations[:, others])  # the left hand never stays
    assert np.abs(result[:, mine] - rotations[:, mine]).max() > 0.01


def test_a_hand_that_stays_briefly_goes_on():
    at = np.arange(300) / FPS
    rotations, root = arms({"rightLowerArm": np.sin(2 * np.pi * 0.9 * at)})
    mine = [k for k in arm_joints() if humanoid().names[k].startswith("right")]
    np.testing.assert_array_equal(hold(rotations, root)[0][:, mine], rotations[:, mine])


def test_a_long_stay_is_several_holds_in_their_own_poses():
    slow = 0.12 * np.arange(600) / FPS  # a hand that wanders through 2.4 radians in 20 s
    rotations, root = arms({"rightLowerArm": slow})
    before, after = (wrists_in_chest(q.astype(float))[:, 1] for q in (rotations, hold(rotations, root)[0]))
    assert np.linalg.norm(before - after, axis=-1).max() < 0.16


@pytest.mark.parametrize("seed", range(4))
def test_pieces_of_any_size_give_the_whole_and_wait_as_long_as_said(seed):
    random = np.random.default_rng(seed)
    steps = random.normal(0, 1, (400, len(humanoid()), 4))
    walk = np.cumsum(steps * random.choice([0.002, 0.03], (400, 1, 1), p=[0.7, 0.3]), 0) + [0, 0, 0, 1]
    rotations = (walk / np.linalg.norm(walk, axis=-1, keepdims=True)).astype(np.float32)
    root = random.normal(0, 1, (400, 3)).astype(np.float32)
    expected, places = hold(rotations, root)
    assert (expected != rotations).any()
    layer, pieces, at, late = HandHolds(FPS), [], 0, 0
    while at < len(rotations):
        end = min(at + int(random.integers(0, 9)), len(rotations))
        pieces.append(layer.push(rotations[at:end], root[at:end]))
        at = end
        late = max(late, at - sum(len(piece) for piece, _ in pieces))
    pieces.append(layer.finish())
    np.testing.assert_array_equal(np.concatenate([piece for piece, _ in pieces]), expected)
    np.testing.assert_array_equal(np.concatenate([piece for _, piece in pieces]), places)
    assert late / FPS <= layer.look_ahead + 1e-9
    assert layer.look_ahead < 2.5


@pytest.mark.parametrize("frames", [0, 1, 2, 30])
def test_short_motion_comes_back_whole(frames):
    rotations, root = (rows[:frames] for rows in arms({"rightLowerArm": strokes(2, [])}))
    result, places = hold(rotations, root)
    assert result.shape == rotations.shape
    assert places.shape == root.shape


def test_speeds_are_those_of_the_wrist():
    turn = 2.0 * np.arange(90) / FPS  # 2 radians a second about the elbow
    rotations, _ = arms({"rightLowerArm": turn})
    hands = HandSpeeds(FPS)
    wrists, speeds = hands.push(rotations)
    assert wrists.shape == (90, 2, 3)
    assert len(speeds) == 90 - hands.delay
    fore = np.linalg.norm(humanoid().offsets[JOINTS["rightHand"]])
    total = fore + np.linalg.norm(humanoid().offsets[JOINTS["rightLowerArm"]])
    np.testing.assert_allclose(speeds[10:70, 1], 2.0 * fore / total, rtol=0.01)
    assert not speeds[:, 0].any()
    assert len(hands.finish()) == hands.delay + hands.wide + 1  # and some of the stillness after them


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mix-stage", "chain-of-generation", "stylised-flow"])
def test_trained_models_hold_their_hands_longer(name):
    model, speech = cospeech.load(name), Speech.load(EXAMPLE, rate=16_000)
    options = {"seed": 1, "fps": 30, "parts": ("body", "hands"), "emotion": "neutral"}
    plain, with_holds = (model.generate(speech, holds=on, **options).rotations for on in (False, True))
    others = [k for k in range(len(humanoid())) if k not in arm_joints()]
    np.testing.assert_array_equal(plain[:, others], with_holds[:, others])
    before, after = (np.mean([still(rotations, side) for side in (0, 1)]) for rotations in (plain, with_holds))
    assert after > before + 0.02
