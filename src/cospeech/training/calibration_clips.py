"""Data of the training that a bundle needs: ranges, and some seconds of the motion and the speech of each speaker.

They are taken when a run begins, so that a run folder can become a bundle without its store.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..corpora.store import Store
from ..motion.rotations import Array
from .batch_loader import ClipNormaliser, Normaliser, Reduce

__all__ = ["LABEL_ARRAYS", "STRETCH", "STRETCHES", "examples_of"]

STRETCH = 128  # frames; ours: 4 to 9 s, longer than any history and than the stretches that style codes are made of
LABEL_ARRAYS = {"text": "texts", "emotion": "emotions"}
"""Array of a store that is kept for the stretches → its name there."""
STRETCHES = 8  # of each speaker; ours: enough for a mean, and for takes with different beginnings
MOST_NUMBERS = (
    1 << 27
)  # of all stretches; ours, half a gigabyte: with more speakers, or samples of sound, each has fewer stretches


def examples_of(
    store: Store, pose: Normaliser, audio: Normaliser, reduce: Reduce | None, moments: ClipNormaliser | None = None
) -> dict[str, Array]:
    """Standardised ranges and stretches of the training split.

    Args:
        store: the data.
        pose, audio, reduce, moments: as the network is fed.

    Returns:
        ``pose_low``, ``pose_high`` (D,), ``audio_low``, ``audio_high`` (A,), ``stretches`` (speakers, `STRETCHES` or fewer,
        `STRETCH`, D) of poses and ``speech`` (…, A) of the speech to them; ``texts`` and ``emotions`` likewise, where the
        store has these `LABEL_ARRAYS`; ``pose_centre`` (speakers, D): the mean pose of each speaker. With ``moments``, also
        ``pose_spread`` (speakers, D): the mean deviation within the speaker's clips. Both are then of neutral clips, where
        there are some, and all poses but the centre are standardised by the moments of their clips. float32. A clip that is
        too short holds its last pose; a speaker without training clips has the stretches of the others.
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
    per_speaker = [clips or numbers for clips in whose.values()]
    widths = [len(edges["pose_low"]), len(edges["audio_low"]), *(text.shape[1] for text in rows.texts(numbers[0]))]
    count = int(np.clip(MOST_NUMBERS // (len(per_speaker) * STRETCH * sum(widths)), 1, STRETCHES))
    stretches = np.stack([_stretches(rows, np.array(clips), count) for clips in per_speaker])
    names = ("stretches", "speech", *(name for array, name in LABEL_ARRAYS.items() if array in store.arrays))
    own = dict(zip(names, np.split(stretches, np.cumsum(widths)[:-1], -1), strict=True))
    if moments is None:
        every = [poses for parts in totals.values() for poses in parts]
        own["pose_centre"] = np.stack([np.concatenate(parts or every).mean(0) for parts in totals.values()])
    else:
        neutral = [_neutral(store, clips) or clips for clips in per_speaker]
        own["pose_centre"] = np.stack([moments.centre[clips].mean(0) for clips in neutral])
        own["pose_spread"] = np.stack([moments.spread[clips].mean(0) for clips in neutral])
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
        """(T, ·) of each of the `LABEL_ARRAYS` of the store."""
        clip = self.store.clips[number]
        arrays = [self.store.arrays[array] for array in LABEL_ARRAYS if array in self.store.arrays]
        return [array[clip.offset : clip.offset + clip.frames].reshape(clip.frames, -1) for array in arrays]

    def whole(self, number: int) -> Array:
        """Poses, speech and `LABEL_ARRAYS`, side by side."""
        return np.concatenate([self.poses(number), self.speech(number), *self.texts(number)], 1)


def _neutral(store: Store, numbers: list[int]) -> list[int]:
    """The clips that are neutral from beginning to end; none where the store has no emotions."""
    emotion = store.arrays.get("emotion")
    if emotion is None:
        return []
    clips = [(number, store.clips[number]) for number in numbers]
    return [n for n, clip in clips if not emotion[clip.offset : clip.offset + clip.frames].any()]


def _stretches(rows: _Rows, numbers: Array, count: int) -> Array:
    """(count, `STRETCH`, columns), evenly spread over the clips of a speaker, which have these numbers."""
    lengths = np.array([rows.store.clips[number].frames for number in numbers])
    ends = np.cumsum(lengths)
    stretches = []
    for place in (np.arange(count) + 0.5) / count * ends[-1]:
        which = int(np.searchsorted(ends, place, "right"))
        clip, start = rows.whole(int(numbers[which])), int(place - (ends[which] - lengths[which]))
        first = max(0, min(start, len(clip) - STRETCH))
        stretches.append(clip[np.minimum(first + np.arange(STRETCH), len(clip) - 1)])
    return np.stack(stretches)
