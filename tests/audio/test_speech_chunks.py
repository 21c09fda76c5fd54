"""A file as pieces: nothing of it is lost, whatever its rate, and silence follows it where a tail is asked for."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import soundfile

from cospeech.audio.speech import Word, open_speech
from cospeech.audio.speech_chunks import MOST_AT_ONCE, speech_chunks


@pytest.fixture
def path(tmp_path):
    noise = np.random.default_rng(0).normal(0, 0.1, 431_001).astype(np.float32)
    soundfile.write(tmp_path / "talk.wav", noise, 44_100, subtype="FLOAT")
    return tmp_path / "talk.wav"


@pytest.mark.parametrize("tail", [Fraction(0), Fraction(1, 3), Fraction(20)])
@pytest.mark.parametrize("rate", [16_000, 44_100])
def test_durations_add_up_and_the_sound_is_the_files(path, rate, tail):
    with open_speech(path, rate=rate) as source:
        whole = np.concatenate(list(source.blocks()))
        pieces = list(speech_chunks(source, tail))
    assert sum(piece.duration for piece in pieces) == Fraction(431_001, 44_100) + tail
    assert all(len(piece) <= MOST_AT_ONCE * rate for piece in pieces)
    samples = np.concatenate([piece.samples for piece in pieces])
    np.testing.assert_array_equal(samples[: len(whole)], whole)
    assert not samples[len(whole) :].any()
    assert len(samples) == -(-(Fraction(431_001, 44_100) + tail) * rate // 1)


def test_each_word_travels_once(path):
    words = tuple(Word(str(k), k * 0.5, k * 0.5 + 0.4) for k in range(22))  # the last ones after the end of the sound
    with open_speech(path) as source:
        source.words = words
        pieces = list(speech_chunks(source, Fraction(2)))
    assert [word for piece in pieces for word in piece.words] == list(words)
    assert all(word.start >= piece.start for piece in pieces for word in piece.words)
