"""Emotion in a voice: measured against the level of that voice, the same in pieces of any size, and played only if sure."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

from cospeech.audio.features.prosody import Features, analyse
from cospeech.audio.speech import Speech
from cospeech.audio.voice_emotion import (
    CATEGORIES,
    LOOKS,
    ConfidentEmotion,
    RunningLevel,
    VoiceEmotion,
    VoiceLook,
    judge_voice,
    load_weights,
)
from cospeech.audio.voice_functionals import FUNCTIONALS, LEVELS, measure_voice
from cospeech.cli.demo import EXAMPLE


@pytest.fixture(scope="module")
def frames() -> Features:
    return analyse(Speech.load(EXAMPLE, rate=16_000).samples[: 6 * 16_000], mel=True)


def looks_of(voice: VoiceEmotion, end: float = 6.0) -> list[VoiceLook | None]:
    return [voice.look(k * LOOKS) for k in range(1, round(end / LOOKS) + 1)]


def test_functionals_are_finite_and_the_gain_moves_levels_alone(frames):
    row = measure_voice(frames[100:300])
    louder = replace(frames, energy=frames.energy + 6, bands=frames.bands + 6, mel=frames.mel + np.float32(6 * np.log(10) / 10))
    difference = measure_voice(louder[100:300]) - row
    assert row.shape == (FUNCTIONALS,)
    assert np.isfinite(row).all()
    assert difference[list(LEVELS)] == pytest.approx([6, 6], abs=1e-3)
    assert np.abs(np.delete(difference, LEVELS)).max() < 1e-3


def test_nearly_nothing_is_no_voice(frames):
    assert measure_voice(frames[:20]) is None
    assert measure_voice(analyse(np.zeros(32_000, np.float32), mel=True)) is None
    assert VoiceEmotion().look(1.0) is None


def test_the_level_runs_from_that_of_all_voices_to_that_of_this_one():
    weights, rng = load_weights(), np.random.default_rng(0)
    level, rows = RunningLevel(weights), weights.mean + weights.spread * rng.normal(2.0, 0.5, (400, FUNCTIONALS))
    first, *_, last = [level.standardise(row) for row in rows]
    assert first.mean() > 1.2
    assert abs(last.mean()) < 0.3
    assert np.std([level.standardise(row) for row in rows[:60]], 0).mean() == pytest.approx(1, abs=0.3)


def test_pieces_of_any_size_give_the_same(frames):
    whole, parts = VoiceEmotion(), VoiceEmotion()
    whole.push(frames)
    expected = looks_of(whole)
    looks: list[VoiceLook | None] = []
    for at in range(0, len(frames), 25):
        parts.push(frames[at : at + 25])
        if (at + 25) % 50 == 0:
            looks.append(parts.look((at + 25) / 100))
    for one, other in zip(looks, expected, strict=False):
        assert (one is None) == (other is None)
        if one is not None:
            assert one.arousal == other.arousal
            assert one.logits.tobytes() == other.logits.tobytes()


def test_memory_is_bounded(frames):
    voice = VoiceEmotion()
    for k in range(40):
        voice.push(replace(frames[0:100], start=100 * k))
    assert sum(len(piece) for piece in voice._pieces) <= 1300


def surely(name: str, probability: float) -> VoiceLook:
    shares = np.full(len(CATEGORIES), (1 - probability) / (len(CATEGORIES) - 1))
    shares[CATEGORIES.index(name)] = probability
    return VoiceLook(0.0, np.log(shares))


def play_looks(name: str, probability: float, looks: int) -> np.ndarray:
    emotion = ConfidentEmotion()
    for _ in range(looks):
        emotion.follow(surely(name, probability))
    return emotion.played


def test_a_category_is_played_only_where_it_is_sure_and_the_voice_is_known():
    anger = CATEGORIES.index("anger")
    assert play_looks("anger", 0.9, 40)[anger] > 0.95
    assert play_looks("anger", 0.49, 40)[0] == pytest.approx(1)
    assert play_looks("anger", 0.9, 8)[0] == pytest.approx(1)
    assert play_looks("boredom", 0.95, 40)[0] == pytest.approx(1)
    assert play_looks("anger", 0.7, 40).sum() == pytest.approx(1)
    emotion = ConfidentEmotion()
    for look in [*[surely("anger", 0.9)] * 40, *[None] * 60]:
        before, after = emotion.played, emotion.follow(look)
        assert np.abs(after - before).max() <= 0.21  # it never jumps
    assert emotion.played[0] > 0.99


def test_the_weights_are_small_and_tell_acted_anger_from_sadness(shared_folder):
    """On actors of its training data: this checks that it works. The page says how well it works for others."""
    weights = load_weights()
    assert weights.categories.shape == (len(CATEGORIES), FUNCTIONALS + 1)
    with (shared_folder / "data" / "speech_emotion" / "labels.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["speaker"] == "03" and row["emotion"] in ("anger", "sadness")][:12]
    level, arousal = RunningLevel(weights), {"anger": list[float](), "sadness": list[float]()}
    for row in rows:
        sound = Speech.load(shared_folder / "data" / "speech_emotion" / row["file"], rate=16_000)
        functionals = measure_voice(analyse(sound, mel=True))
        arousal[row["emotion"]].append(judge_voice(level.standardise(functionals), weights).arousal)
    assert min(arousal["anger"]) > max(arousal["sadness"])
