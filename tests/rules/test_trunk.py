"""How the trunk takes part in gestures: it turns to where the hands are, and does not lean to where they go."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

import cospeech
from cospeech import Motion, Speech
from cospeech.audio.speech import example
from cospeech.motion.rotations import Array
from cospeech.motion.skeleton import humanoid

SLOW = 181  # frames of 30 per second: six seconds, over which the way that a body faces is taken off


def measure_trunk(hips: Array, shoulders: Array, wrists: Array) -> tuple[Array, Array]:
    """Yaw per metre that both hands are aside and that one is before the other, and lean per metre ahead and up; degrees.

    Args:
        hips: (T, 3).
        shoulders: (T, 2, 3) left and right.
        wrists: (T, 2, 3).
    """
    across = shoulders[:, 0] - shoulders[:, 1]
    yaw = np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))
    slow = _smooth(yaw)
    side, ahead = (np.stack([f(slow), 0 * slow, g(slow)], -1) for f, g in ((np.cos, lambda a: -np.sin(a)), (np.sin, np.cos)))
    middle = shoulders.mean(1)
    place = wrists - middle[:, None]
    aside, forward = (np.einsum("tki,ti->tk", place, way) for way in (side, ahead))
    up = middle - hips
    lean = np.degrees(np.arctan2(np.einsum("ti,ti->t", up, ahead), up[:, 1]))
    turns = _fit(np.degrees(yaw - slow), aside.mean(1), forward[:, 1] - forward[:, 0])
    return turns, _fit(lean, forward.mean(1), place[..., 1].mean(1))


def _smooth(values: Array) -> Array:
    padded = np.pad(values, SLOW // 2, mode="edge")
    return sliding_window_view(padded, SLOW).mean(-1)


def _fit(value: Array, *by: Array) -> Array:
    columns = np.stack([each - _smooth(each) for each in by], -1)
    return np.linalg.lstsq(columns, value - _smooth(value), rcond=None)[0]


def measure(motion: Motion) -> tuple[Array, Array]:
    points, index = motion.positions().astype(float), humanoid().index
    shoulders, wrists = ([index[side + name] for side in ("left", "right")] for name in ("UpperArm", "Hand"))
    return measure_trunk(points[:, index["hips"]], points[:, shoulders], points[:, wrists])


@pytest.mark.slow
@pytest.mark.parametrize("style", ["natural", "lively", "storyteller"])
def test_the_trunk_turns_to_the_hands_and_does_not_lean_there(style):
    speech, model = Speech.load(example()[0]), cospeech.load("rules")
    takes = [measure(model.generate(speech, style=style, seed=seed, emotion="neutral", parts=("body",))) for seed in range(10)]
    (aside, before), (ahead, _) = (np.mean(values, 0) for values in zip(*takes, strict=True))
    assert 12 < aside < 50
    assert 35 < before < 90
    assert -20 < ahead < 11


def test_a_recorded_speaker_does_so(shared_folder):
    take = np.load(shared_folder / "data/reference_motion/003_Neutral_2.npy", allow_pickle=False)[::2, :, :3].astype(float)
    (aside, before), (ahead, _) = measure_trunk(take[:, 0], take[:, [6, 3]], take[:, [8, 5]])
    assert aside == pytest.approx(32, abs=8)
    assert before == pytest.approx(65, abs=10)
    assert ahead < 0
