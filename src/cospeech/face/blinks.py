"""Blinks: the times at which they happen, as a pure function of time, and the course of one blink."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import floor

import numpy as np

from ..audio.prosodic_events import RATE, Heard
from ..motion.curves import clip, smoothstep
from ..motion.noise import hash_normal, hash_uniform
from ..motion.rotations import Array

__all__ = ["blink_times", "eyelids", "phrase_ends"]

# Width at half height: 74 / 99 / 134 ms at 10 / 50 / 90 % of blinks (motion.md, "Face": phone depth camera).
_MEDIAN_WIDTH, _LOG_SPREAD = 0.099, 0.236
_WIDTHS = (0.060, 0.160)  # s; ours: limits of the width of a blink
_CLOSE, _SHUT, _OPEN = 0.55, 0.20, 1.05  # in widths: half of closing and opening, and the time shut, add up to one width
_TWICE = 0.10  # share of cells with two blinks, and of cells with none (ours: flurries and stares)
_APART = 0.55  # s; a blink that an event asks for is dropped this close to one that is due anyway (ours)
_AT_PHRASE_END, _AT_SHIFT = 0.32, 0.55  # chances; ours: blinks come more often there (Cummins 2012, J. Phonetics 40)
_SPEECH_CUT = 0.30  # share of the other blinks left out while somebody speaks, so that the rate stays (ours)
_AT_STROKE, _STROKE_LEADS = 0.16, 0.1  # [ours] chance at a coupling of 1; seconds before the accent of the stroke
_STROKE_CUT = 0.25  # [ours] more of the other blinks left out at a coupling of 1, so that the rate stays
_LARGE_SHIFT = 0.5  # rad; a gaze shift this large has the full chance
_SPEAKING, _PAUSE = 0.40, 28  # loudness, rows of 1/RATE s: as the phrases in listen.py
PAUSE_KNOWN = (_PAUSE + 2) / RATE
"""Seconds after the last loud moment until it is known to be the end of a phrase."""
_PAIR = np.array([[0], [1]])
_PER_CELL, _WIDTH, _DEPTH, _CHANCE, _SHIFT, _HOLD = 5101 + _PAIR, 5103, 5104, 5105, 5107, 5109  # streams of the hash
_STROKE = 5111  # and of a stroke


def phrase_ends(speech: Heard) -> Array:
    """Absolute rows at which speech falls silent for at least 0.28 s; the end of the window counts as silence."""
    loud = np.zeros(len(speech.loudness) + _PAUSE)
    loud[: len(speech.loudness)] = speech.loudness > _SPEAKING
    fall = np.flatnonzero((loud[:-1] > loud[1:])[: len(speech.loudness)]) + 1
    sofar = np.concatenate([[0.0], np.cumsum(loud)])
    return speech.start + fall[sofar[np.minimum(fall + _PAUSE, len(loud))] == sofar[fall]]


def blink_times(seed: int, rate: float, start: float, end: float) -> tuple[Array, Array, Array]:
    """Blinks without a cause between two times (s), and a little around them: (B,) begin, (B,) identity, and (B,) how surely
    each comes during speech, 0 … 1.

    Time is cut in cells of ``1 / rate`` seconds with one blink each, at a place drawn from the seed and the cell's
    number; a few cells have two or none. No blink depends on those before it, so a late ``start`` costs nothing.
    """
    if rate <= 0:
        return np.zeros(0), np.zeros(0, int), np.zeros(0)
    return _draw_blinks(seed, rate, floor((start - 2.0) * rate), floor((end + 1.0) * rate) + 1)


@lru_cache(64)
def _draw_blinks(seed: int, rate: float, begin: int, end: int) -> tuple[Array, Array, Array]:
    """`blink_times` of these cells; cached, since a stream asks for the same cells many times."""
    cell = np.arange(begin, end)
    place, kind = hash_uniform(seed, _PER_CELL, cell)
    first = (cell + 0.08 + 0.84 * place) / rate
    again = kind < _TWICE
    second = first[again] + 0.45 + 4.0 * kind[again]
    once = kind < 1 - _TWICE
    index = np.concatenate([2 * cell[once], 2 * cell[again] + 1])
    return np.concatenate([first[once], second]), index, hash_uniform(seed, _HOLD, index)


def _draw_caused_blinks(
    seed: int, due: Array, when: Array, index: Array, stream: int, chance: Array | float
) -> tuple[Array, Array]:
    """Blinks at events, with a chance, unless one is due anyway."""
    draw, late = hash_uniform(seed, stream + _PAIR, index)
    keep = draw < chance
    if len(due):
        keep &= np.abs(when[:, None] - due).min(1) > _APART
    return (when + 0.12 * late)[keep], index[keep] + (stream << 40)


def eyelids(
    times: Array,
    speech: Heard,
    *,
    seed: int,
    rate: float,
    shifts: Sequence[tuple[float, float]] = (),
    strokes: Sequence[float] = (),
    coupling: float = 0.0,
    late: float = 0.0,
) -> Array:
    """(T,) how far blinks close the eyes, 0 … 1.

    Args:
        times: (T,) seconds.
        speech: the speech around these times, for blinks at the ends of phrases.
        seed: which schedule.
        rate: blinks per second that come without a cause; events add to them.
        shifts: (time in s, size in rad) of large gaze shifts.
        strokes: times of accents with a stroke of the hands; some come with a blink.
        coupling: how many, 0 … 1.
        late: seconds by which blinks at the ends of phrases come later, where little of the speech ahead is known. The end of
            a phrase then counts once its pause is long enough.
    """
    due, index, sure = blink_times(seed, rate, float(times[0]), float(times[-1]))
    speaking = speech.at(due, speech.loudness) > _SPEAKING
    keep = ~speaking | (sure > _SPEECH_CUT + _STROKE_CUT * coupling)
    begin, index = due[keep], index[keep]
    ends = phrase_ends(speech)
    if late:
        ends = ends[ends + _PAUSE <= speech.start + len(speech.loudness)]
    if len(ends) and rate > 0:
        more = _draw_caused_blinks(seed, due, ends / RATE + late, ends, _CHANCE, _AT_PHRASE_END)
        begin, index = np.concatenate([begin, more[0]]), np.concatenate([index, more[1]])
    if len(shifts) and rate > 0:
        when, size = np.array(shifts, float).T
        chance = _AT_SHIFT * np.minimum(size / _LARGE_SHIFT, 1.0)
        more = _draw_caused_blinks(seed, due, when - 0.03, np.rint(when * 1000).astype(int), _SHIFT, chance)
        begin, index = np.concatenate([begin, more[0]]), np.concatenate([index, more[1]])
    if len(strokes) and rate > 0 and coupling > 0:
        when = np.array(strokes, float)
        numbers = np.rint(when * 1000).astype(int)
        more = _draw_caused_blinks(seed, due, when - _STROKE_LEADS, numbers, _STROKE, _AT_STROKE * coupling)
        begin, index = np.concatenate([begin, more[0]]), np.concatenate([index, more[1]])
    near = (begin > times[0] - 0.5) & (begin < times[-1])
    begin, index = begin[near], index[near]
    if not len(begin):
        return np.zeros(len(times))
    width = clip(_MEDIAN_WIDTH * np.exp(_LOG_SPREAD * hash_normal(seed, _WIDTH, index)), *_WIDTHS)
    depth = 1.0 - 0.25 * hash_uniform(seed, _DEPTH, index) ** 4  # most blinks are complete
    since = (times[:, None] - begin) / width
    ramp = np.minimum(since / _CLOSE, (_CLOSE + _SHUT + _OPEN - since) / _OPEN)
    return (smoothstep(ramp) * depth).max(1)
