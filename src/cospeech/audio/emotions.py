"""Emotions by name, and emotions that change over a speech: tracks, and the CSV files that hold them."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from os import PathLike, fsdecode
from typing import Protocol, runtime_checkable

import numpy as np

from ..errors import InputError, nearest
from ..files import read_regular
from ..limits import EMOTION_BYTES, EMOTION_ROWS, PLAUSIBLE_SECONDS
from ..motion.named_numbers import read_number
from ..motion.rotations import Array

__all__ = [
    "EMOTIONS",
    "EmotionTrack",
    "Moods",
    "SteeredMoods",
    "emotion_track",
    "read_emotion",
    "read_emotion_track",
    "suggest_emotion",
]

EMOTIONS: tuple[str, ...] = ("neutral", "happiness", "anger", "sadness", "contempt", "surprise", "fear", "disgust")
"""The eight emotions of BEAT in its order."""
BLEND = 0.5
"""Seconds in which a named emotion takes over from the one before it; ours: faces show one in about so long."""

_ALIKE = {
    "joy": "happiness", "fun": "happiness", "sorrow": "sadness", "scared": "fear", "afraid": "fear", "calm": "neutral"
}  # fmt: skip
"""Other names of some emotions, by VRM 0.x and by people; their spelling is not similar."""
_MEMORY = 10.0  # seconds for which moods that were replaced are kept [ours: the longest look-ahead of a session is 2.3]

_SUM = 1e-6  # how far the weights of a moment may be from 1


@runtime_checkable
class Moods(Protocol):
    """What gives the emotions at a time: an `EmotionTrack`, or a detector that hears them in a voice."""

    def at(self, times: Array) -> Array:
        """(…, 8) weights at these times (…) in seconds; they sum to 1."""
        ...


@dataclass(frozen=True, eq=False)
class EmotionTrack:
    """Weights of the emotions over time: linear between the given moments, and constant before the first and after the last.

    >>> track = EmotionTrack([0, 10], [[1, 0, 0, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0, 0, 0]])
    >>> track.at([5, 60])[:, :2].tolist()
    [[0.5, 0.5], [0.0, 1.0]]

    Args:
        times: (n,) seconds, each later than the one before.
        weights: (n, 8) in the order of `EMOTIONS`, 0 … 1, each row with the sum 1.

    Raises:
        InputError: they have other shapes or other values than these.
    """

    times: Array
    weights: Array

    def __post_init__(self) -> None:
        try:
            times, weights = np.array(self.times, float), np.array(self.weights, float)
        except (TypeError, ValueError):
            raise InputError("an emotion track of something else than numbers", "times (n,), weights (n, 8)") from None
        if times.ndim != 1 or not len(times) or weights.shape != (len(times), len(EMOTIONS)):
            problem = f"an emotion track with times {times.shape} and weights {weights.shape}"
            raise InputError(problem, f"(n,) and (n, {len(EMOTIONS)}), n from 1 on")
        if not np.isfinite(times).all() or not (np.diff(times) > 0).all():
            raise InputError("times of an emotion track that do not ascend", "seconds, each later than the one before")
        if not ((weights >= 0) & (weights <= 1)).all() or np.abs(weights.sum(1) - 1).max() > _SUM:
            raise InputError("weights of an emotion track that are no shares", "0 … 1, with the sum 1 at every time")
        for name, value in (("times", times), ("weights", weights)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @classmethod
    def constant(cls, name: str) -> EmotionTrack:
        """One emotion all the time.

        Raises:
            InputError: there is none of that name.
        """
        if name not in EMOTIONS:
            raise InputError(f"no emotion is called {str(name)[:60]!r}", suggest_emotion(str(name)[:60], EMOTIONS))
        return cls(np.zeros(1), np.array([[float(name == one) for one in EMOTIONS]]))

    def without_past(self) -> EmotionTrack:
        """The same from 0 s on, without moments before 0."""
        later = self.times > 0
        if later.all():
            return self
        return EmotionTrack(np.append(0.0, self.times[later]), np.vstack([self.at(np.zeros(1)), self.weights[later]]))

    def at(self, times: Array) -> Array:
        """(T, 8) weights at these times in seconds; they sum to 1."""
        seconds, last = np.asarray(times, float), len(self.times) - 1
        after = np.searchsorted(self.times, seconds, side="right")
        low, high = np.clip(after - 1, 0, last), np.clip(after, 0, last)
        length = np.where(low < high, self.times[high] - self.times[low], 1.0)
        share = np.clip((seconds - self.times[low]) / length, 0.0, 1.0)[..., None]
        return self.weights[low] + share * (self.weights[high] - self.weights[low])


class SteeredMoods:
    """Moods that somebody changes while they are played.

    >>> moods = SteeredMoods(EmotionTrack.constant("neutral"))
    >>> moods.change(EmotionTrack.constant("happiness"), 2.0)
    >>> moods.at(np.array([2.0, 2.25, 9.0]))[:, 1].tolist()
    [0.0, 0.5, 1.0]

    Args:
        first: the moods at the beginning.
    """

    def __init__(self, first: Moods) -> None:
        self._layers: list[tuple[float, Moods]] = [(-np.inf, first)]

    def change(self, moods: Moods, time: float) -> None:
        """Blend to other moods from ``time`` seconds on, within `BLEND`. Times of changes ascend."""
        while len(self._layers) > 1 and self._layers[1][0] < time - _MEMORY:
            del self._layers[0]
        self._layers.append((time, moods))

    def at(self, times: Array) -> Array:
        """(…, 8) weights at these times (…) in seconds, none more than ten seconds before the last change."""
        times = np.asarray(times, float)
        weights = self._layers[0][1].at(times)
        for start, moods in self._layers[1:]:
            share = np.clip((times - start) / BLEND, 0.0, 1.0)[..., None]
            weights = weights + share * (moods.at(times) - weights)
        return weights


def suggest_emotion(word: str, names: Iterable[str]) -> str:
    """A hint for a word that is no emotion: the emotion that is probably meant, and all ``names``.

    >>> suggest_emotion("joy", ["neutral", "happiness"])
    "did you mean 'happiness'? known: neutral, happiness"
    """
    return nearest(_ALIKE.get(word.lower(), word), names)


def emotion_track(emotion: object) -> Moods | None:
    """The moods of a session's option ``emotion``; None for "auto", which follows the arousal of the voice.

    Raises:
        InputError: neither "auto", nor the name of an emotion, nor a track or the ``.csv`` file of one.
    """
    if isinstance(emotion, Moods):
        return emotion
    if isinstance(emotion, PathLike) or (isinstance(emotion, str) and emotion.lower().endswith(".csv")):
        return read_emotion_track(emotion)
    names = ("auto", *EMOTIONS)
    if not isinstance(emotion, str):
        raise InputError(f"an emotion that is {emotion!r:.60}", f"one of {', '.join(names)}, or a track")
    if emotion == "auto":
        return None
    if emotion in EMOTIONS:
        return EmotionTrack.constant(emotion)
    raise InputError(f"no emotion is called {emotion[:60]!r}", suggest_emotion(emotion[:60], names))


def read_emotion_track(path: str | PathLike[str]) -> EmotionTrack:
    """Read the track of a CSV file, in one of two layouts.

    ``time,emotion`` or ``time,emotion,weight``: from its time on, the emotion of a row takes over within half a second (less
    where the next row comes sooner). A weight below 1 leaves the rest to neutral. Before the first row, its emotion holds.

    ``time`` and any names of emotions as columns: weights at that moment, linear in between. Where their sum is below 1, the
    rest is neutral; where it is above 1, they are scaled down.

    Columns may be separated by semicolons or tabs, too; numbers may then have a decimal comma, as spreadsheets of many
    countries write them.

    Args:
        path: UTF-8 text; times in seconds, each later than the one before.

    Raises:
        InputError: it cannot be read, or a row is wrong: the message says which line.
    """
    name = fsdecode(path)[-80:]
    rows = _rows(path, name)
    if not rows:
        raise InputError(f"{name!r} is empty", "a header, time,emotion, and a row for every change")
    header = [cell.strip() for cell in rows[0][1]]
    read = _layout(header, f"{name!r} line {rows[0][0]}")
    keys: list[tuple[float, Array]] = []
    for line, cells in rows[1:]:
        place = f"{name!r} line {line}"
        if len(cells) != len(header):
            raise InputError(f"{place}: {len(cells)} cells", f"{len(header)}, as in the header")
        time = _number(cells[0], f"{place}: time")
        if not 0 <= time <= PLAUSIBLE_SECONDS:
            raise InputError(f"{place}: time {time:g}", f"seconds, 0 … {PLAUSIBLE_SECONDS:,.0f}")
        if keys and time <= keys[-1][0]:
            raise InputError(f"{place}: time {time:g} after {keys[-1][0]:g}", "each row is later than the one before")
        keys.append((time, read(cells[1:], place)))
    if not keys:
        raise InputError(f"{name!r} has a header and no row", "a row for every change")
    return _blend_emotions(keys) if "emotion" in header else EmotionTrack(*map(np.array, zip(*keys, strict=True)))


def _rows(path: str | PathLike[str], name: str) -> list[tuple[int, list[str]]]:
    """(line, cells) of every line that is not blank."""
    try:
        text = read_regular(path, "an emotion track", EMOTION_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{name!r} is no UTF-8 text at byte {error.start}", "save it as CSV in UTF-8") from None
    first = text.lstrip().partition("\n")[0]
    mark = next((each for each in ";\t" if each in first), ",")
    reader, rows = csv.reader(io.StringIO(text, newline=None), delimiter=mark), list[tuple[int, list[str]]]()
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                rows.append((reader.line_num, cells))
            if len(rows) > EMOTION_ROWS + 1 or reader.line_num > 2 * EMOTION_ROWS:  # blank lines count, too
                raise InputError(f"{name!r} has more than {EMOTION_ROWS:,} rows", "is it an emotion track?")
    except csv.Error as error:
        raise InputError(f"{name!r} line {reader.line_num}: {error}", "is it CSV?") from None
    return rows


def _layout(header: list[str], place: str) -> Callable[[list[str], str], Array]:
    """The function that reads the cells behind the time as (8,) weights."""
    hint = f"time,emotion or time,emotion,weight or time and some of {', '.join(EMOTIONS)}"
    if header[0] != "time" or len(header) < 2:
        raise InputError(f"{place}: header {','.join(header)[:80]!r}", hint)
    if header[1:] in (["emotion"], ["emotion", "weight"]):
        return _parse_emotion
    for name in header[1:]:
        if name not in EMOTIONS:
            raise InputError(f"{place}: column {name[:60]!r} is no emotion", suggest_emotion(name[:60], EMOTIONS))
    if len(set(header)) < len(header):
        raise InputError(f"{place}: two columns of one name", hint)
    return lambda cells, where: _shares(header[1:], cells, where)


def _parse_emotion(cells: list[str], place: str) -> Array:
    name = cells[0].strip()
    if name == "auto":
        hint = "a file says all of it; --stretch 120:180:emotion=sadness sets a part, and the rest follows the voice"
        raise InputError(f"{place}: 'auto' is no emotion", hint)
    if name not in EMOTIONS:
        raise InputError(f"{place}: {name[:60]!r} is no emotion", suggest_emotion(name[:60], EMOTIONS))
    weight = _number(cells[1], f"{place}: weight") if len(cells) > 1 and cells[1].strip() else 1.0
    if not 0 <= weight <= 1:
        raise InputError(f"{place}: weight {weight:g}", "0 … 1")
    return weight * EmotionTrack.constant(name).weights[0] + (1 - weight) * EmotionTrack.constant("neutral").weights[0]


def _shares(names: list[str], cells: list[str], place: str) -> Array:
    row = np.zeros(len(EMOTIONS))
    for name, cell in zip(names, cells, strict=True):
        weight = _number(cell, f"{place}: {name}") if cell.strip() else 0.0
        if not 0 <= weight <= 1:
            raise InputError(f"{place}: {name} {weight:g}", "0 … 1")
        row[EMOTIONS.index(name)] = weight
    if row.sum() > 1:
        return row / row.sum()
    row[0] += 1 - row.sum()
    return row


def _number(text: str, place: str) -> float:
    return read_number(text.replace(",", "."), f"{place} {text.strip()[:40]!r} is no number", "such as 12.5")


def _blend_emotions(keys: list[tuple[float, Array]]) -> EmotionTrack:
    """A track of named emotions. Each takes over from its time on, in `BLEND` seconds or until the next one begins."""
    times, weights = [keys[0][0]], [keys[0][1]]
    for k, (time, target) in enumerate(keys[1:], start=1):
        until = keys[k + 1][0] if k + 1 < len(keys) else np.inf
        end = min(time + BLEND, until)
        if time > times[-1]:
            times.append(time)
            weights.append(weights[-1])
        times.append(end)
        weights.append(weights[-1] + min((end - time) / BLEND, 1.0) * (target - weights[-1]))
    return EmotionTrack(np.array(times), np.array(weights))


def read_emotion(emotion: str | PathLike[str] | EmotionTrack) -> tuple[str | EmotionTrack, str | None]:
    """An emotion as a session takes it: the track of a file, or the value as it is; and the name of the file, or None.

    Raises:
        InputError: as of `read_emotion_track`.
    """
    if isinstance(emotion, EmotionTrack):
        return emotion, None
    name = fsdecode(emotion)
    return (read_emotion_track(name), name) if name.lower().endswith(".csv") else (name, None)
