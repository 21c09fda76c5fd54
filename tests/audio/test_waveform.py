"""The waveform as features of frames: what each row holds; pieces give the rows of the whole; a store keeps them."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.features.reduce import open_features, reduce_audio
from cospeech.audio.features.waveform import SAMPLES, WaveformFeatures, waveform_rows
from cospeech.audio.speech import Speech

FPS = 15.0


def tone(seconds: float, rate: int = 16_000) -> Speech:
    return Speech((0.5 * np.sin(2 * np.pi * 220 * np.arange(int(seconds * rate)) / rate)).astype(np.float32), rate)


def test_a_row_is_the_sound_of_its_own_frame():
    rows = waveform_rows(tone(1.0), 15, FPS)
    assert rows.shape == (15, SAMPLES)
    times = (np.arange(15 * SAMPLES) / SAMPLES / FPS)[: 14 * SAMPLES]
    np.testing.assert_allclose(rows.ravel()[: 14 * SAMPLES], 0.5 * np.sin(2 * np.pi * 220 * times), atol=1e-3)


@pytest.mark.parametrize("rate", [16_000, 22_050])
def test_pieces_give_the_bits_of_the_whole(rate):
    speech = tone(1.3, rate)
    whole, features = waveform_rows(speech, 20, FPS), WaveformFeatures(FPS)
    parts = [features.push(Speech(speech.samples[k : k + 777], rate)) for k in range(0, len(speech.samples), 777)]
    pieces = np.concatenate([*parts, features.finish()])
    assert pieces.tobytes() == whole.tobytes()


def test_after_the_sound_there_is_silence():
    rows = waveform_rows(tone(0.5), 12, FPS)
    assert rows[:7].any(1).all()
    assert not rows[8:].any()


def test_a_row_is_there_as_soon_as_its_sound_has_been_heard():
    features, speech = WaveformFeatures(FPS), tone(1.0)
    given = 0
    for k in range(100):
        given += len(features.push(Speech(speech.samples[k * 160 : (k + 1) * 160])))
        assert given >= int(((k + 1) / 100 - features.delay) * FPS + 1e-9)


def test_the_waveform_is_not_reduced():
    features = open_features("waveform", FPS)
    rows = np.concatenate([features.push(tone(0.4)), features.finish()])
    assert reduce_audio(rows, "waveform").tobytes() == rows.tobytes()


def test_cepstra_are_the_cosine_transform_of_the_log_powers():
    rows = np.random.default_rng(0).normal(size=(3, 84)).astype(np.float32)
    band = np.arange(80) + 0.5
    expected = [[(row[:80] * np.cos(np.pi * k * band / 80)).sum() * (2 / 80) ** 0.5 for k in range(14)] for row in rows]
    cepstra = reduce_audio(rows, "mfcc14")
    np.testing.assert_allclose(cepstra[:, 1:], np.array(expected)[:, 1:], atol=1e-4)
    np.testing.assert_allclose(cepstra[:, 0], np.array(expected)[:, 0] / 2**0.5, atol=1e-4)
    assert reduce_audio(rows[1:2], "mfcc14").tobytes() == cepstra[1:2].tobytes()
