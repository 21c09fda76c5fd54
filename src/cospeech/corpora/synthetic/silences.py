"""Silence that is put into speech, so that a network can learn what hands do while nobody speaks.

Recordings that are read aloud have hardly a pause of a second. People who talk to each other have many.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from ...audio.features.mel import RATE
from ...audio.features.prosody import FPS, analyse, find_pauses
from ...audio.speech import Speech
from .voices import pieces_of

__all__ = ["add_silences", "cut_pieces"]

_GAP = (1.0, 4.0)  # s; [ours] longer than the .6 s after which the rules' hands come to rest
_EDGE = (0.4, 2.5)  # s, before and after the speech; [ours]
_PLACE = 0.15  # s; [ours] shortest pause that can be made longer: shorter ones are inside words
_QUIET = 0.10  # quantile of the energy that counts as the sound of the room; [ours]
_DIGITAL = 0.5  # share of speeches whose silence is zeros, as files and microphones with a gate have it; [ours]


def add_silences(speech: Speech, share: float, seed: int) -> Speech:
    """Speech at 16 kHz with silence before it, after it, and in some of its pauses; its words at their new times.

    Args:
        speech: as it is.
        share: of the result that is to be added silence, 0 … 0.8. Speech without pauses gets less.
        seed: draws where the silences are, how long, and whether they are zeros or as loud as the recording's room.
    """
    if share <= 0 or not len(speech):
        return speech
    rng = np.random.default_rng([seed, 16])
    features = analyse(speech)
    silence = float(speech.duration) * share / (1 - share)
    room = 0.0 if rng.uniform() < _DIGITAL else 10 ** (float(np.quantile(features.energy, _QUIET)) / 20)
    middles = [(a + b) / 2 for a, b in find_pauses(features.energy, FPS, shortest=_PLACE)]
    inner = [at for at in middles if _PLACE < at < float(speech.duration) - _PLACE]
    edges = [(0.0, rng.uniform(*_EDGE)), (float(speech.duration), rng.uniform(*_EDGE))]
    gaps = [(at, float(rng.uniform(*_GAP))) for at in rng.permutation(inner).tolist()]
    insertions = list[tuple[float, float]]()
    for at, long in [*edges, *gaps]:
        if sum(each for _, each in insertions) + long <= silence + _GAP[0]:
            insertions.append((at, long))
    return _insert(speech, sorted(insertions), room, rng)


def cut_pieces(speeches: Iterable[Speech], seconds: float, share: float) -> list[Speech]:
    """Pieces of speeches at 16 kHz (`voices.pieces_of`) that last half of ``seconds`` at least, a share of silence in each."""
    long = [piece for piece in pieces_of(speeches, seconds) if float(piece.duration) > seconds / 2]
    return [add_silences(piece, share, k) for k, piece in enumerate(long)]


def _insert(speech: Speech, gaps: list[tuple[float, float]], room: float, rng: np.random.Generator) -> Speech:
    """The speech with a gap of so many seconds at each of these times; ``room``: root of the mean power there."""
    parts, last = list[np.ndarray](), 0
    for at, long in gaps:
        place = min(round(at * RATE), len(speech.samples))
        parts += [speech.samples[last:place], (room * rng.standard_normal(round(long * RATE))).astype(np.float32)]
        last = place
    samples = np.concatenate([*parts, speech.samples[last:]])
    words = speech.words
    if words is not None:
        delays = [sum(long for at, long in gaps if at <= (w.start + w.end) / 2) for w in words]
        words = tuple(replace(w, start=w.start + late, end=w.end + late) for w, late in zip(words, delays, strict=True))
    return replace(speech, samples=samples, words=words, seconds=None, duration=Fraction(len(samples), RATE))
