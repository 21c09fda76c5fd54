"""What a bundle has to know of the data that its network was trained on: ranges, and how each speaker moves for some seconds.

It is taken when a run begins, so that a run folder can become a bundle wherever its store is by then.
"""

from __future__ import annotations

import numpy as np

from ..corpora.store import Entry, Store
from ..motion.rotations import Array
from .batch_loader import ClipNormaliser, Normaliser, Reduce

__all__ = ["SAID", "STRETCH", "STRETCHES", "examples_of"]

STRETCH = 128  # frames; ours: 4 to 9 s, longer than any history and than the stretches that style codes are made of
SAID = {"text": "texts", "emotion": "emotions"}
"""Arrays of a store whose values to the stretches are kept, by the names of these."""
STRETCHES = 8  # of each speaker; ours: enough for a mean, and for takes that do not begin alike


def examples_of(
    store: Store, pose: Normaliser, audio: Normaliser, reduce: Reduce | None, moments: ClipNormaliser | None = None
) -> dict[str, Array]:
    """Standardised ranges and stretches of the training split.

    Args:
        store: the data.
        pose, audio, reduce, moments: as the network is fed.

    Returns:
        ``pose_low``, ``pose_high`` (D,), ``audio_low``, ``audio_high`` (A,), ``stretches`` (speakers, 8, `STRETCH`, D) of
        poses and ``speech`` (speakers, 8, `STRETCH`, A) of the speech to them, ``texts`` and ``emotions`` likewise where the
        store has `SAID` arrays, ``pose_centre`` (speakers, D): the mean pose of each; with ``moments`` also ``pose_spread``
        (speakers, D): the mean deviation within their clips, both of neutral
        clips where there are some, and all poses but the centre by their clips' moments. float32. Shorter clips are held
        at their ends, a speaker without training clips has the stretches of the others.
    """
    clips = [clip for clip in store.clips if clip.split == "train" and {"pose", "audio"} <= {*clip.has}]
    edges: dict[str, Array] = {}
    rows: dict[str, list[Array]] = {name: [] for name in store.speakers}
    whose: dict[str, list[int]] = {name: [] for name in store.speakers}
    for number, clip in enumerate(store.clips):
        if clip not in clips:
            continue
        whose[clip.speaker].append(number)
        arrays = store.clip(clip)
        heard = arrays["audio"] if reduce is None else reduce(arrays["audio"])
        poses = pose(arrays["pose"])
        if moments is not None:
            poses = (poses - moments.centre[number]) / moments.spread[number]
        rows[clip.speaker].append(np.concatenate([poses, audio(heard), *_read_said_arrays(store, clip)], 1))
        for name, values in (("pose", poses), ("audio", audio(heard))):
            low, high = values.min(0), values.max(0)
            edges[f"{name}_low"] = np.minimum(edges.get(f"{name}_low", low), low)
            edges[f"{name}_high"] = np.maximum(edges.get(f"{name}_high", high), high)
    every = [both for found in rows.values() for both in found]
    taken = [found or every for found in rows.values()]
    width = len(edges["pose_low"])
    stretches = np.stack([_stretches(found) for found in taken])
    ends = np.cumsum([width, len(edges["audio_low"]), *(x.shape[1] for x in _read_said_arrays(store, store.clips[0]))])
    names = ("stretches", "speech", *(name for array, name in SAID.items() if array in store.arrays))
    own = dict(zip(names, np.split(stretches, ends[:-1], -1), strict=True))
    if moments is None:
        own["pose_centre"] = np.stack([np.concatenate(found)[:, :width].mean(0) for found in taken])
    else:
        numbers = [found or [n for others in whose.values() for n in others] for found in whose.values()]
        numbers = [_neutral(store, found) or found for found in numbers]
        own["pose_centre"] = np.stack([moments.centre[found].mean(0) for found in numbers])
        own["pose_spread"] = np.stack([moments.spread[found].mean(0) for found in numbers])
    return {name: np.ascontiguousarray(values, np.float32) for name, values in {**edges, **own}.items()}


def _read_said_arrays(store: Store, clip: Entry) -> list[Array]:
    """(T, ·) of each of the `SAID` arrays that there are."""
    found = [store.arrays[array] for array in SAID if array in store.arrays]
    return [array[clip.offset : clip.offset + clip.frames].reshape(clip.frames, -1) for array in found]


def _neutral(store: Store, numbers: list[int]) -> list[int]:
    """The clips that are neutral from beginning to end; none where the store has no emotions."""
    known = store.arrays.get("emotion")
    if known is None:
        return []
    clips = [(number, store.clips[number]) for number in numbers]
    return [n for n, clip in clips if not known[clip.offset : clip.offset + clip.frames].any()]


def _stretches(clips: list[Array]) -> Array:
    """(`STRETCHES`, `STRETCH`, columns), evenly spread over all that there is of a speaker."""
    lengths = np.array([len(clip) for clip in clips])
    places = (np.arange(STRETCHES) + 0.5) / STRETCHES * lengths.sum()
    found = []
    for place in places:
        which = int(np.searchsorted(np.cumsum(lengths), place, "right"))
        clip, start = clips[which], int(place - lengths[:which].sum())
        first = max(0, min(start, len(clip) - STRETCH))
        found.append(clip[np.minimum(first + np.arange(STRETCH), len(clip) - 1)])
    return np.stack(found)
