"""Silence that is put into speech."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.speech import Speech, Word
from cospeech.corpora.synthetic.silences import add_silences

RATE = 16_000


def talk(level: float = 0.0) -> Speech:
    """Three words of a second with a third of a second between them, over noise of a room."""
    rng = np.random.default_rng(1)
    word = np.sin(2 * np.pi * 140 * np.arange(RATE) / RATE).astype(np.float32) * 0.3
    gap = np.zeros(RATE // 3, np.float32)
    samples = np.concatenate([word, gap, word, gap, word])
    words = tuple(Word(f"w{k}", k * 4 / 3, k * 4 / 3 + 1) for k in range(3))
    return Speech((samples + level * rng.standard_normal(len(samples))).astype(np.float32), RATE, words)


@pytest.mark.parametrize("seed", range(6))
def test_words_go_with_their_sound(seed):
    speech = talk()
    longer = add_silences(speech, 0.6, seed)
    assert 1.3 < longer.seconds / speech.seconds < 3.5
    for before, after in zip(speech.words, longer.words, strict=True):
        old = speech.samples[round(before.start * RATE) + 800 :][:8000]
        new = longer.samples[round(after.start * RATE) + 800 :][:8000]
        assert np.corrcoef(old, new)[0, 1] > 0.99
        assert after.end - after.start == pytest.approx(1)


def test_a_share_of_none_changes_nothing_and_seeds_differ():
    speech = talk()
    assert add_silences(speech, 0.0, 1) is speech
    one, same, other = (add_silences(talk(), 0.5, seed).samples for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert len(one) != len(other)


def test_silence_is_zeros_or_as_loud_as_the_room():
    levels = {round(float(np.abs(add_silences(talk(1e-3), 0.6, seed).samples[:3000]).std() * 1e4)) for seed in range(12)}
    assert 0 in levels
    assert any(2 < level < 20 for level in levels)
