"""Bundles that ship, on speech that they were not trained on: they follow it, and their styles differ in manner.

`benchmarks/models.py --follow` and `benchmarks/styles.py` measure this on more.
"""

from __future__ import annotations

from functools import cache
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("scipy", reason="beat lift needs scipy (the eval extra)")

import cospeech
from cospeech.audio.speech import Speech
from cospeech.experiments.style_judge import StyleJudge
from cospeech.metrics.beat_lift import RATE, energy_envelope
from cospeech.metrics.movement import Track, wrist_speeds

PAUSE = 3.0  # s after each recording
BODY = {"parts": ("body", "hands"), "fps": 30.0, "emotion": "neutral", "stance": False}
PLAYERS = ["chain-of-generation", "chain-of-generation, live", "mix-stage", "stylised-flow"]
MOST_IN_SILENCE = 0.2
"""Speed of the wrists in settled silence, by that in speech; measured .02 to .1 on these recordings."""


@cache
def spoken(folder: Path) -> tuple[Speech, ...]:
    """Three speeches of two recordings each, with a pause after each recording."""
    files = sorted(folder.glob("LJ001-00*.flac"))[:6]
    sounds = [Speech.load(file, rate=16_000).samples for file in files]
    rest = np.zeros(round(PAUSE * 16_000), np.float32)
    return tuple(Speech(np.concatenate([sounds[k], rest, sounds[k + 1], rest])) for k in (0, 2, 4))


@cache
def measure_speeds(folder: Path, player: str) -> tuple[np.ndarray, ...]:
    """(n,) speed of the wrists for each speech, at 100 values a second."""
    name, _, live = player.partition(", ")
    model = cospeech.load(name)
    options = BODY | ({} if live else {"look_ahead": model.for_files.get("look_ahead")})
    tracks = [Track.of(model.generate(speech, seed=1, **options)) for speech in spoken(folder)]
    speeds = [wrist_speeds(track).mean(1) for track in tracks]
    return tuple(
        np.interp(np.arange(int(s.seconds * RATE)) / RATE, np.linspace(0, s.seconds, len(v)), v)
        for s, v in zip(spoken(folder), speeds, strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize("player", PLAYERS)
def test_hands_rest_in_silence(shared_folder, player):
    folder = shared_folder / "data" / "speech" / "ljspeech"
    still, talking = list[np.ndarray](), list[np.ndarray]()
    for speech, speed in zip(spoken(folder), measure_speeds(folder, player), strict=True):
        loud = energy_envelope(speech.samples, speech.rate) > 1e-7
        near = np.convolve(loud, np.ones(280), "full")[140 - 20 :][: len(speed)] > 0.5  # 1.6 s after a voice to 1.2 s before
        still.append(speed[: len(near)][~near[: len(speed)]])
        talking.append(speed[: len(loud)][loud[: len(speed)]])
    assert np.concatenate(still).mean() < MOST_IN_SILENCE * np.concatenate(talking).mean()


@pytest.mark.slow
@pytest.mark.parametrize("player", PLAYERS)
def test_own_speech_beats_anothers(shared_folder, player):
    folder = shared_folder / "data" / "speech" / "ljspeech"
    envelopes = [energy_envelope(speech.samples, speech.rate) for speech in spoken(folder)]
    speeds = measure_speeds(folder, player)
    verdicts = [
        agree(speeds[a], envelopes[a]) > agree(speeds[a], envelopes[b]) for a, b in permutations(range(len(envelopes)), 2)
    ]
    assert sum(verdicts) >= len(verdicts) - 1


@pytest.mark.slow
@pytest.mark.parametrize("player", ["chain-of-generation", "mix-stage"])
def test_styles_differ_in_manner(shared_folder, player):
    """A judge that has seen a network's styles on other speech names them, without mean pose, amplitude or share of an arm."""
    *teaching, test_speech = spoken(shared_folder / "data" / "speech" / "ljspeech")
    model = cospeech.load(player)
    options = BODY | {"look_ahead": model.for_files.get("look_ahead"), "calibrated": False}
    styles = list(enumerate(model.styles))
    judge = StyleJudge(
        ((k, model.generate(speech, style=name, seed=n, **options)) for n, speech in enumerate(teaching) for k, name in styles),
        arms=False,
    )
    guesses = [judge.name(model.generate(test_speech, style=name, seed=9, **options)) for _, name in styles]
    assert (
        sum(guess == k for k, guess in enumerate(guesses)) >= 6
    )  # of 8 or 9; of 8, 6 are right by chance once in 12,000 times


def agree(speed: np.ndarray, envelope: np.ndarray) -> float:
    """The best correlation of speed and loudness, with hands up to 0.4 s early or 0.2 s late."""
    count = min(len(speed), len(envelope)) - 60
    return max(np.corrcoef(speed[40 + lag :][:count], envelope[40:][:count])[0, 1] for lag in range(-40, 21, 4))
