"""Emotion in a voice: arousal, and categories with probabilities, judged against how this voice usually sounds.

    frames of prosody ─► functionals of the last 2 s, twice a second ─► against running mean and spread of this voice
        ─► ridge regression ─► arousal
        └► logistic regression ─► probabilities ─► a category that is played, where it is confident

The weights come from `tools/train_voice_emotion.py`. They were trained on *acted* speech: German actors (EmoDB, Burkhardt et
al. 2005, CC0) and voices that act by rule. What was measured stands in docs/emotion_from_speech.md. NumPy alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from ..motion.rotations import Array
from .emotions import EMOTIONS
from .features.mel import FPS
from .features.prosody import Features
from .voice_functionals import measure_voice

__all__ = [
    "CATEGORIES",
    "LOOKS",
    "WINDOW",
    "ConfidentEmotion",
    "RunningLevel",
    "VoiceEmotion",
    "VoiceLook",
    "VoiceWeights",
    "judge_voice",
    "load_weights",
]

CATEGORIES = (*EMOTIONS, "boredom")
"""The categories of the classifier. Boredom is from EmoDB; it is no emotion of ours, and counts as neutral."""
LOOKS = 0.5  # seconds between two looks [ours]
WINDOW = 2.0  # seconds of speech that a look rests on: the length of the clips that it was trained on
_PRIOR = 8.0  # windows that the usual voice of the training data counts for at first [ours: 16 s]
_MEMORY = 60.0  # windows over which the level of a voice runs [ours: 2 min]
_PAST = 12.0  # seconds of frames in memory [ours: a session looks at most 3 s back]
_SMOOTH = 0.8  # per look, of the logits that decide what is played [ours: some 2.5 s]
_LEAST_LOOKS = 12  # looks at speech before a category is played [ours: 6 s of speech]
_SILENT = 0.9  # per look without speech: how much of what is played stays [ours: it fades in some 5 s]
_SURE = (0.5, 0.75)  # probability at which a category begins to be played, and is played in full [ours]


@dataclass(frozen=True)
class VoiceWeights:
    """The trained weights, of F functionals and C categories.

    Args:
        mean, spread: (F,) of the functionals over all voices.
        categories: (C, F + 1) of the logits; the last column is the bias. They are calibrated.
        arousal: (F + 1,).
    """

    mean: Array
    spread: Array
    categories: Array
    arousal: Array


class VoiceLook(NamedTuple):
    """Emotion in a voice at one moment."""

    arousal: float
    """About −1 (sad, bored) … 1 (angry); 0: neutral."""
    logits: Array
    """(C,) logarithms of the probabilities of `CATEGORIES`."""


@cache
def load_weights() -> VoiceWeights:
    """The weights in the package."""
    with files("cospeech").joinpath("assets/voice_emotion.npz").open("rb") as file, np.load(file, allow_pickle=False) as arrays:
        return VoiceWeights(*(np.asarray(arrays[name], float) for name in ("mean", "spread", "categories", "arousal")))


class RunningLevel:
    """Mean and spread of the functionals of one voice so far; at first those of all voices.

    Args:
        weights: they hold the mean and spread of all voices.
    """

    def __init__(self, weights: VoiceWeights) -> None:
        self._mean, self._variance, self._count = weights.mean.copy(), np.square(weights.spread), _PRIOR

    def standardise(self, row: Array, share: float = 1.0) -> Array:
        """Update the level with (F,) functionals, and give them standardised by it.

        Args:
            row: of a window.
            share: how much of it is new; windows of a stream overlap.
        """
        self._count = min(self._count + share, _PRIOR + _MEMORY)
        away = row - self._mean
        self._mean = self._mean + away * (share / self._count)
        self._variance = self._variance + (away * (row - self._mean) - self._variance) * (share / self._count)
        scores: Array = (row - self._mean) / np.sqrt(self._variance)
        return scores


def judge_voice(row: Array, weights: VoiceWeights) -> VoiceLook:
    """The arousal and the logits of a standardised row (F,)."""
    full = np.concatenate([row, [1.0]])
    logits = weights.categories @ full
    logits = logits - logits.max()
    return VoiceLook(min(max(float(weights.arousal @ full), -1.5), 1.5), logits - np.log(np.exp(logits).sum()))


class VoiceEmotion:
    """Listens to one voice; frames come in pieces of any size.

    Args:
        weights: the shipped ones where not given.
    """

    def __init__(self, weights: VoiceWeights | None = None) -> None:
        self._weights = weights or load_weights()
        self._level = RunningLevel(self._weights)
        self._pieces: list[Features] = []

    def push(self, frames: Features) -> None:
        """Take further frames, with mel bands, 100 a second."""
        if len(frames):
            self._pieces.append(frames)
            end = (frames.start + len(frames)) / frames.fps
            while len(self._pieces) > 1 and self._pieces[1].start / frames.fps < end - _PAST:
                del self._pieces[0]

    def look(self, until: float) -> VoiceLook | None:
        """Emotion in the `WINDOW` before ``until`` seconds; None where nothing is said. Call it every `LOOKS` seconds."""
        first, last = (round(time * FPS) for time in (until - WINDOW, until))
        own = [
            piece[max(first - piece.start, 0) : max(last - piece.start, 0)]
            for piece in self._pieces
            if piece.start < last and piece.start + len(piece) > first
        ]
        if not own:
            return None
        row = measure_voice(own[0] if len(own) == 1 else Features.concatenate(own))
        return None if row is None else judge_voice(self._level.standardise(row, LOOKS / WINDOW), self._weights)


class ConfidentEmotion:
    """Chooses which of the heard categories is played: one that is confident, else neutral.

    >>> emotion = ConfidentEmotion()
    >>> emotion.follow(None).tolist()
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """

    def __init__(self) -> None:
        self._logits, self._count, self._looks = np.zeros(len(CATEGORIES)), 0.0, 0
        self.probabilities = _neutral()
        """(8,) of `EMOTIONS`, smoothed over some looks."""
        self.played = _neutral()
        """(8,) weights; one emotion beside neutral at most begins to be played at a time."""

    def follow(self, look: VoiceLook | None) -> Array:
        """(8,) weights to play after one more look; what is played fades where nothing is said."""
        if look is None:
            self.played = _SILENT * self.played + (1 - _SILENT) * _neutral()
            return self.played
        self._logits, self._count = _SMOOTH * self._logits + look.logits, _SMOOTH * self._count + 1
        self._looks += 1
        shares = np.exp(self._logits / self._count)
        self.probabilities = _count_boredom(shares / shares.sum())
        self.played = _SMOOTH * self.played + (1 - _SMOOTH) * self._weigh()
        return self.played

    def _weigh(self) -> Array:
        best = int(self.probabilities.argmax())
        low, high = _SURE
        sure = float(np.clip((self.probabilities[best] - low) / (high - low), 0.0, 1.0))
        weights = _neutral() * (1 - sure)
        weights[best] += sure
        return weights if self._looks >= _LEAST_LOOKS else _neutral()


def _count_boredom(shares: Array) -> Array:
    """(9,) shares of `CATEGORIES` → (8,) of `EMOTIONS`."""
    weights = shares[: len(EMOTIONS)].copy()
    weights[0] += shares[len(EMOTIONS) :].sum()
    return weights


def _neutral() -> Array:
    return np.array([float(name == "neutral") for name in EMOTIONS])
