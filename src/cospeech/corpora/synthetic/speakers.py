"""Who speaks in a synthetic corpus: the rule-based model's styles, and mixtures of them once these are used up."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...rules import STYLES, Style
from ...rules.styles import mix_styles

__all__ = ["MOST", "Speaker", "choose_speakers", "vary_take"]

MOST = 100  # ours: mixtures beyond that are hard to tell apart
_ORDER = ("lively", "calm", "lecturer", "southpaw", "orator", "reserved", "seated", "storyteller", "restless", "natural")
"""Ours: neighbours differ most, so that a cast of two or four is as varied as one of eight."""
_NAMES = (
    "ada", "ben", "cleo", "dan", "elif", "femi", "gita", "hugo", "ines", "jun", "kofi", "lena", "mila", "noor", "omar", "pia",
    "quinn", "rosa", "sven", "tara", "uma", "vito", "wen", "xenia", "yuri", "zoe",
)  # fmt: skip


_TEMPO, _AMPLITUDE, _HAND = 0.10, 0.16, 0.18  # [ours] standard deviations: of two logarithms, and of a share


def vary_take(style: Style, seed: int, amount: float) -> Style:
    """A style as it is in one take: its tempo, amplitude and preferred hand are drawn once, and nobody can hear them.

    A system that sees the motion so far can tell them; one that hears the speech alone cannot.

    Args:
        style: of the speaker.
        seed: of the take.
        amount: 0 the style as it is, 1 as much as takes usually differ.
    """
    tempo, amplitude, hand = np.random.default_rng([seed, 16]).normal(size=3).clip(-2, 2) * amount
    return replace(
        style,
        tempo=style.tempo * float(np.exp(_TEMPO * tempo)),
        amplitude=style.amplitude * float(np.exp(_AMPLITUDE * amplitude)),
        hand=min(max(style.hand + _HAND * float(hand), 0.0), 1.0),
    )


class Speaker(NamedTuple):
    """A name and how it gestures."""

    name: str
    style: Style


def choose_speakers(count: int, seed: int) -> list[Speaker]:
    """So many speakers: first the styles as they are, then mixtures of three; the same seed, the same cast.

    Raises:
        InputError: none, or more than `MOST`.
    """
    if not 1 <= count <= MOST:
        raise InputError(f"{count} speakers", f"1 … {MOST}")
    rng = np.random.default_rng([seed, 8])
    names = [*(name for name in _ORDER if name in STYLES), *(name for name in STYLES if name not in _ORDER)]
    speakers = []
    for k in range(count):
        if k < len(names):
            style = STYLES[names[k]]
        else:
            parts = rng.choice(len(names), 3, replace=False)
            weights = rng.dirichlet([0.6] * 3)  # 0.6: ours, one part usually leads
            style = mix_styles({names[p]: float(w) for p, w in zip(parts, weights, strict=True)})
        speakers.append(Speaker(_NAMES[k] if k < len(_NAMES) else f"{_NAMES[k % len(_NAMES)]}{k // len(_NAMES) + 1}", style))
    return speakers
