"""What a bundle has to know of the data that its network was trained on: ranges, and how each speaker moves for some seconds.

It is taken when a run begins, so that a run folder can become a bundle wherever its store is by then.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..corpora.store import Store
from ..motion.rotations import Array
from .batch_loader import ClipNormaliser, Normaliser, Reduce

__all__ = ["SAID", "STRETCH", "STRETCHES", "examples_of"]

STRETCH = 128  # frames; ours: 4 to 9 s, longer than any history and than the stretches that style codes are made of
SAID = {"text": "texts", "emotion": "emotions"}
"""Arrays of a store whose values to the stretches are kept, by the names of these."""
STRETCHES = 8  # of each speaker; ours: enough for a mean, and for takes that do not begin alike
MOST_NUMBERS = (
    1 << 27
)  # of all stretches; ours, half a gigabyte: of more speakers, or of samples, there are fewer stretches of each


def examples_of(
    store: Store, pose: Normaliser, audio: Normaliser, reduce: Reduce | None, moments: ClipNormaliser | None = None
) -> dict[str, Array]:
    """Standardised ranges and stretches of the training split.

    Args:
        store: the data.
        pose, audio, reduce, moments: as the network is fed.

    Returns:
        ``pose_low``, ``pose_high`` (D,), ``audio_low``, ``audio_high`` (A,), ``stretches`` (speakers, `STRETCHES` or fewer,
        `STRETCH`, D) of poses and ``speech`` (…, A) of the speech to them, ``texts`` and ``emotions`` likewise where the
        store has `SAID` arrays, ``pose_centre`` (speakers, D): the mean pose of each; with ``moments`` also ``pose_spread``
        (speakers, D): the mean deviation within their clips, both of neutral
        clips where there are some, and all poses but the centre by their clips' moments. float32. Shorter clips are held
        at their ends, a speaker without training clips has the stretches of the others.
    """
    numbers = [k for k, clip in enumerate(store.clips) if clip.split == "train" and {"pose", "audio"} <= {*clip.has}]
    rows = _Rows(store, pose, audio, reduce, moments)
    whose: dict[str, list[int]] = {name: [] for name in store.speakers}
    edges: dict[str, Array] = {}
    totals: dict[str, list[Array]] = {name: [] for name in store.speakers}
    for number in numbers:
        speaker, poses = store.clips[number].speaker, rows.poses(number)
        whose[speaker].append(number)
        totals[speaker].append(poses)
        for name, values in (("pose", poses), ("audio", rows.speech(number))):
            low, high = values.min(0), values.max(0)
            edges[f"{name}_low"] = np.minimum(edges.get(f"{name}_low", low), low)
            edges[f"{name}_high"] = np.maximum(edges.get(f"{name}_high", high), high)
    taken = [found or numbers for found in whose.values()]
    widths = [len(edges["pose_low"]), len(edges["audio_low"]), *(said.shape[1] for said in rows.texts(numbers[0]))]
    count = int(np.clip(MOST_NUMBERS // (len(taken) * STRETCH * sum(widths)), 1, STRETCHES))
    stretches = np.stack([_stretches(rows, np.array(found), count) for found in taken])
    names = ("stretches", "speech", *(name for array, name in SAID.items() if array in store.arrays))
    own = dict(zip(names, np.split(stretches, np.cumsum(widths)[:-1], -1), strict=True))
    if moments is None:
        every = [poses for found in totals.values() for poses in found]
        own["pose_centre"] = np.stack([np.concatenate(found or every).mean(0) for found in totals.values()])
    else:
        neutral = [_neutral(store, found) or found for found in taken]
        own["pose_centre"] = np.stack([moments.centre[found].mean(0) for found in neutral])
        own["pose_spread"] = np.stack([moments.spread[found].mean(0) for found in neutral])
    return {name: np.ascontiguousarray(values, np.float32) for name, values in {**edges, **own}.items()}


class _Rows(NamedTuple):
    """Standardised rows of the clips of a store, by their numbers."""

    store: Store
    pose: Normaliser
    audio: Normaliser
    reduce: Reduce | None
    moments: ClipNormaliser | None

    def poses(self, number: int) -> Array:
        poses = self.pose(self.store.clip(self.store.clips[number])["pose"])
        return poses if self.moments is None else (poses - self.moments.centre[number]) / self.moments.spread[number]

    def speech(self, number: int) -> Array:
        rows = self.store.clip(self.store.clips[number])["audio"]
        return self.audio(rows if self.reduce is None else self.reduce(rows))

    def texts(self, number: int) -> list[Array]:
        """(T, ·) of each of the `SAID` arrays that there are."""
        clip = self.store.clips[number]
        found = [self.store.arrays[array] for array in SAID if array in self.store.arrays]
        return [array[clip.offset : clip.offset + clip.frames].reshape(clip.frames, -1) for array in found]

    def whole(self, number: int) -> Array:
        """Poses, speech, and what is said, side by side."""
        return np.concatenate([self.poses(number), self.speech(number), *self.texts(number)], 1)


def _neutral(store: Store, numbers: list[int]) -> list[int]:
    """The clips that are neutral from beginning to end; none where the store has no emotions."""
    known = store.arrays.get("emotion")
    if known is None:
        return []
    clips = [(number, store.clips[number]) for number in numbers]
    return [n for n, clip in clips if not known[clip.offset : clip.offset + clip.frames].any()]


def _stretches(rows: _Rows, numbers: Array, count: int) -> Array:
    """(count, `STRETCH`, columns), evenly spread over all that there is of a speaker, whose clips have these numbers."""
    lengths = np.array([rows.store.clips[number].frames for number in numbers])
    ends = np.cumsum(lengths)
    found = []
    for place in (np.arange(count) + 0.5) / count * ends[-1]:
        which = int(np.searchsorted(ends, place, "right"))
        clip, start = rows.whole(int(numbers[which])), int(place - (ends[which] - lengths[which]))
        first = max(0, min(start, len(clip) - STRETCH))
        found.append(clip[np.minimum(first + np.arange(STRETCH), len(clip) - 1)])
    return np.stack(found)
