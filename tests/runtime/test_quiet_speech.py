"""Trained models hear quiet speech at a usual level."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cospeech import models
from cospeech.audio.speech import Speech, example
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_angle

pytestmark = pytest.mark.slow

TRAINED = ("stylised-flow", "mix-stage", "chain-of-generation")
BODY = ("body", "hands")


@cache
def load_speech(gain: float) -> Speech:
    """The example, louder by so many dB."""
    speech = Speech.load(example()[0])
    return Speech(speech.samples * np.float32(10 ** (gain / 20)), speech.rate)


def speed(motion: Motion, start: float = 3.0, end: float = 19.0) -> float:
    """Mean step, rad, of the upper arms and forearms between two times, seconds; after three, the level is known."""
    names = ("leftUpperArm", "rightUpperArm", "leftLowerArm", "rightLowerArm")
    arms = motion.rotations[
        round(start * motion.fps) : round(end * motion.fps), [motion.skeleton.names.index(name) for name in names]
    ]
    return float(quat_angle(arms[1:], arms[:-1]).mean())


@pytest.mark.parametrize("name", TRAINED)
def test_quiet_speech_moves_the_arms_as_usual_speech_does(name):
    model = models.load(name)
    usual, quiet = (speed(model.generate(load_speech(gain), seed=1, parts=BODY)) for gain in (0, -24))
    assert quiet > 0.8 * usual  # without level control .44 to .74


@pytest.mark.parametrize("name", [*TRAINED, "speech-to-face"])
def test_pieces_of_quiet_speech_are_the_whole(name):
    speech, model = load_speech(-20).window(0, 5), models.load(name)
    whole = model.generate(speech, seed=1)
    pieces = list(model.stream(speech.chunks(0.13), seed=1))
    assert len(pieces) > 1
    assert np.array_equal(np.concatenate([piece.rotations for piece in pieces]), whole.rotations)
    assert np.array_equal(np.concatenate([piece.face for piece in pieces]), whole.face)


@pytest.mark.parametrize("name", TRAINED)
def test_silence_stays_silence(name):
    """What follows quiet speech is not raised."""
    quiet = load_speech(-24)
    pause = Speech(np.concatenate([quiet.samples, np.zeros(6 * quiet.rate, np.float32)]), quiet.rate)
    motion = models.load(name).generate(pause, seed=1, parts=BODY)
    assert speed(motion, 21.0, 25.0) < 0.2 * speed(motion)
