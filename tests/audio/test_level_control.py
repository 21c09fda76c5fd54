"""The gain that quiet speech gets before a network hears it."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.features.frames import AUDIO_NAMES, audio_features
from cospeech.audio.level_control import MOST, USUAL, LevelControl
from cospeech.audio.speech import Speech, example

FPS = 12.0
SIZES = (1, 7, 2, 30, 1, 1000)


def read_example(gain: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Energy and voicing of the example, louder by so many dB."""
    speech = Speech.load(example()[0])
    speech = Speech(speech.samples * np.float32(10 ** (gain / 20)), speech.rate)
    rows = audio_features(speech, round(speech.duration * FPS), FPS)
    return rows[:, AUDIO_NAMES.index("energy")], rows[:, AUDIO_NAMES.index("voicing")]


def test_speech_of_a_usual_level_is_left_alone():
    gains = LevelControl(FPS).follow(*read_example())
    assert not gains[24:].any()
    assert gains.max() < 6  # a weak first word


@pytest.mark.parametrize("less", [12.0, 24.0])
def test_quiet_speech_is_brought_to_the_usual_level_and_stays_there(less):
    energy, voicing = read_example(-less)
    loudest = read_example()[0].max()
    gains = LevelControl(FPS).follow(energy, voicing)[60:]
    assert np.ptp(gains) < 6
    assert abs(gains.mean() - (less - (loudest - USUAL))) < 6


def test_the_gain_has_an_end_and_needs_a_voice():
    energy, voicing = read_example(-45.0)
    assert LevelControl(FPS).follow(energy, voicing).max() == MOST
    assert not LevelControl(FPS).follow(energy, 0 * voicing).any()


def test_a_loud_word_ends_the_gain_at_once():
    quiet, loud = np.full(60, -40.0), np.full(6, -10.0)
    gains = LevelControl(FPS).follow(np.concatenate([quiet, loud]), np.ones(66))
    assert gains[59] == pytest.approx(20, abs=0.5)
    assert not gains[62:].any()


def test_pieces_have_the_gains_of_the_whole():
    energy, voicing = read_example(-20.0)
    whole, control, at, parts = LevelControl(FPS).follow(energy, voicing), LevelControl(FPS), 0, []
    for size in SIZES:
        parts.append(control.follow(energy[at : at + size], voicing[at : at + size]))
        at += size
    assert np.array_equal(np.concatenate(parts), whole)
