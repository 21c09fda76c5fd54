"""Mouth shapes of phones, and how neighbouring phones share the mouth (coarticulation by dominance functions)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..audio.prosodic_events import Heard
from ..audio.word import is_spoken
from ..motion.rotations import Array
from ..motion.weighted_sum import add_weighted_rows
from .graphemes import graphemes_to_phones

__all__ = ["MOUTH", "VISEMES", "MouthShape", "Phones", "phones_of", "phones_to_mouth", "snap_visemes"]

MOUTH = (
    "jawOpen", "mouthFunnel", "mouthPucker", "mouthStretch", "mouthSmile", "mouthLowerDown", "mouthUpperUp",
    "mouthRollLower", "mouthShrugLower", "tongueOut",
)  # fmt: skip
"""Columns of `MouthShape.shape`: ARKit names without side."""

# The 15 visemes of the Oculus lip-sync set (without silence) → weights of MOUTH, then the share of the mouth that each
# claims for jaw and for lips, and how much it closes the lips. Jaw openings: ours, a least-squares fit to 300 clips of the
# GRID corpus (one speaker, tracked by MediaPipe) as the start, evened out by hand; the rest: ours, by eye.
_VISEMES = {
    #     jaw  fun  puc  str  smi  low  upp  rol  shr  ton   jaw' lips' closed
    "PP": (.03, .00, .00, .00, .00, .00, .00, .10, .08, .00, 1.2, 0.3, 1.0),
    "FF": (.04, .00, .00, .06, .04, .00, .22, .42, .20, .00, 1.2, 1.0, 0.0),
    "TH": (.08, .00, .00, .06, .02, .16, .06, .00, .00, .30, 0.8, 0.5, 0.0),
    "DD": (.14, .00, .00, .06, .02, .14, .06, .00, .00, .00, 0.8, 0.3, 0.0),
    "kk": (.15, .00, .00, .04, .02, .12, .05, .00, .00, .00, 0.5, 0.2, 0.0),
    "CH": (.10, .42, .16, .00, .00, .14, .12, .00, .00, .00, 1.2, 1.2, 0.0),
    "SS": (.05, .00, .00, .22, .10, .20, .06, .00, .00, .00, 1.4, 0.6, 0.0),
    "nn": (.08, .00, .00, .04, .02, .14, .05, .00, .00, .00, 0.7, 0.2, 0.0),
    "RR": (.07, .20, .28, .00, .00, .03, .00, .00, .00, .00, 0.6, 0.8, 0.0),
    "aa": (.34, .00, .00, .06, .04, .24, .10, .00, .00, .00, 1.0, 0.8, 0.0),
    "E": (.28, .00, .00, .16, .10, .22, .10, .00, .00, .00, 1.0, 0.8, 0.0),
    "I": (.19, .00, .00, .24, .18, .20, .08, .00, .00, .00, 0.9, 0.9, 0.0),
    "O": (.26, .44, .48, .00, .00, .05, .00, .00, .00, .00, 1.0, 1.2, 0.0),
    "U": (.08, .20, .92, .00, .00, .00, .00, .00, .00, .00, 0.9, 1.4, 0.0),
}  # fmt: skip
VISEMES = tuple(_VISEMES)
"""Names of the rows that `Phones.viseme` counts."""
_TABLE = np.array([_VISEMES[name] for name in VISEMES])
_SHAPE, _JAW, _LIPS, _CLOSED = _TABLE[:, : len(MOUTH)], _TABLE[:, -3], _TABLE[:, -2], _TABLE[:, -1]
_SNAP = np.array([{"aa": 1.0, "E": 1.0, "O": 1.0, "I": 0.5, "PP": -1.0, "DD": -0.5, "kk": -0.5}.get(n, 0.0) for n in VISEMES])

# Phone → (viseme, how far it is reached, milliseconds); diphthongs are two. Durations: ours, round figures of read English.
_PHONES: dict[str, tuple[tuple[str, float, int], ...]] = {
    "p": (("PP", 1, 85),), "b": (("PP", 1, 75),), "m": (("PP", 1, 70),), "f": (("FF", 1, 100),), "v": (("FF", 0.9, 65),),
    "th": (("TH", 1, 90),), "dh": (("TH", 0.8, 45),), "t": (("DD", 1, 75),), "d": (("DD", 1, 60),), "n": (("nn", 1, 60),),
    "l": (("nn", 1, 65),), "s": (("SS", 1, 110),), "z": (("SS", 1, 85),), "sh": (("CH", 1, 115),), "zh": (("CH", 1, 85),),
    "ch": (("CH", 1, 120),), "jh": (("CH", 1, 100),), "k": (("kk", 1, 85),), "g": (("kk", 1, 70),), "ng": (("kk", 0.9, 70),),
    "hh": (("kk", 0.9, 50),), "y": (("I", 0.9, 55),), "w": (("U", 1, 60),), "r": (("RR", 1, 60),), "er": (("RR", 0.9, 110),),
    "aa": (("aa", 1, 125),), "ae": (("aa", 0.9, 130),), "ah": (("aa", 0.7, 85),), "ax": (("E", 0.6, 55),),
    "ao": (("O", 1, 130),),
    "eh": (("E", 1, 95),), "ih": (("I", 0.9, 75),), "iy": (("I", 1, 110),), "uh": (("U", 0.7, 75),), "uw": (("U", 1, 110),),
    "ey": (("E", 1, 80), ("I", 1, 60)), "ay": (("aa", 1, 95), ("I", 1, 65)), "ow": (("O", 1, 80), ("U", 0.9, 65)),
    "aw": (("aa", 1, 95), ("U", 0.9, 65)), "oy": (("O", 1, 90), ("I", 1, 65)),
}  # fmt: skip

_REACH = 0.45  # s; phones further than this from all times cannot touch the mouth
_FAR = 0.35  # s; where a phone's dominance has fallen to 0, so that the mouth depends only on phones near in time
_SLACK = 0.025  # s; spread of a phone's dominance beyond its own length; ours, by fit
_AHEAD = 1.25  # the mouth prepares a phone for longer than it keeps it (Cohen & Massaro 1993: anticipation)


_SNAP_REACH = np.arange(-3, 4) * 0.02  # s; how far the sound may move a phone
_SNAP_PRIOR = np.exp(-0.5 * (_SNAP_REACH / 0.035) ** 2)
_SNAP_PULL = 4.0  # ours, by fit: weight e^(pull · loudness)


class Phones(NamedTuple):
    """Phones in time: (P,) arrays."""

    centre: Array
    """Seconds."""
    half: Array
    """Half of the length, seconds."""
    viseme: Array
    """Row of the viseme table."""
    reach: Array
    """0 … 1: how far the mouth reaches the shape."""


class MouthShape(NamedTuple):
    """A mouth in time."""

    shape: Array
    """(T, len(MOUTH)) weights 0 … 1."""
    closed: Array
    """(T,) 0 open … 1 lips pressed together, whatever the jaw does."""
    claim: Array
    """(T,) how much is known about the mouth: 0 nothing … 1 everything."""


@lru_cache(maxsize=4096)
def _parts(text: str, language: str) -> tuple[tuple[int, float, float, float], ...]:
    """(viseme, reach, middle, half length) of a word's phones; the last two as shares of the word's length."""
    parts = [part for phone in graphemes_to_phones(text, language) for part in _PHONES[phone]]
    total = sum(part[2] for part in parts)
    out, start = [], 0.0
    for viseme, reach, length in parts:
        out.append((VISEMES.index(viseme), reach, (start + length / 2) / total, length / 2 / total))
        start += length
    return tuple(out)


def phones_of(words: Sequence, start: float, end: float) -> Phones:
    """The phones of ``words`` (with ``text``, ``start``, ``end``, ``language``) that matter between two times in seconds."""
    rows = []
    for word in words:
        length = word.end - word.start
        if word.end > start - _REACH and word.start < end + _REACH and length > 0 and is_spoken(word.text):
            rows += [(word.start + m * length, h * length, v, r) for v, r, m, h in _parts(word.text, word.language)]
    table = np.array(rows, float).reshape(-1, 4)
    return Phones(table[:, 0], table[:, 1], table[:, 2].astype(int), table[:, 3])


def snap_visemes(phones: Phones, speech: Heard) -> Phones:
    """Open vowels moved towards louder moments nearby, closures towards quieter ones, by at most 60 ms."""
    around = speech.at((phones.centre[:, None] + _SNAP_REACH).ravel(), speech.loudness).reshape(-1, len(_SNAP_REACH))
    weight = _SNAP_PRIOR * np.exp(_SNAP_PULL * _SNAP[phones.viseme][:, None] * around)
    return phones._replace(centre=phones.centre + (weight * _SNAP_REACH).sum(1) / weight.sum(1))


def phones_to_mouth(times: Array, phones: Phones) -> MouthShape:
    """Blend the phones' shapes by their dominance (M. Cohen and D. Massaro, "Modeling coarticulation", 1993).

    Each phone claims the jaw and the lips by a bell in time, of its own strength; a shape is the mean of the shapes
    weighted by the claims. The bells are Gaussian (exponent c = 2), so that velocities are continuous.
    """
    if not len(phones.centre):
        return MouthShape(np.zeros((len(times), len(MOUTH))), np.zeros(len(times)), np.zeros(len(times)))
    away = times[:, None] - phones.centre
    spread = 0.6 * np.minimum(phones.half, 0.12) + _SLACK
    distance = np.where(away < 0, away / (_AHEAD * spread), away / spread)
    near = np.maximum(1 - np.square(away / _FAR), 0.0)
    dominance = np.exp(-0.5 * distance * distance) * near
    jaw, lips = dominance * _JAW[phones.viseme], dominance * _LIPS[phones.viseme]
    target = _SHAPE[phones.viseme] * phones.reach[:, None]
    shape = add_weighted_rows(lips, target) / (add_weighted_rows(lips) + 1e-9)
    shape[:, 0] = (add_weighted_rows(jaw, target[:, :1]) / (add_weighted_rows(jaw) + 1e-9))[:, 0]
    flat = np.abs(away) / (np.minimum(phones.half, 0.06) + 0.02)
    closed = (np.exp(-(flat**4)) * _CLOSED[phones.viseme]).max(1)
    claim = add_weighted_rows(dominance)[:, 0]
    return MouthShape(shape, closed, claim / (claim + 0.1))
