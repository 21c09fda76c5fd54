"""Batches for a network: windows of a store, the audio reduced, both standardised with statistics of the training split."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..corpora.store import Store
from ..errors import InputError
from ..motion.rotations import Array
from .windows import Windows, is_mirror_image

__all__ = [
    "POSE_FLOOR", "SPREAD_FLOOR", "BatchLoader", "ClipNormaliser", "Normaliser", "check_mirror", "clip_moments",
    "pool_columns", "standard_audio", "standard_pose",
]  # fmt: skip

POSE_FLOOR = 0.01
"""Least deviation of a pose number, ours: a number that moves by less than a centimetre, or half a degree, counts less."""
SPREAD_FLOOR = 0.1
"""Least deviation of a number within a clip, relative to that over all clips; ours: stillness is not magnified."""
_TINY = 1e-6  # an audio column that varies by less is constant, and has deviation 1 as in a store

Reduce = Callable[[Array], Array]
"""(T, 84) audio columns of a store → (T, A)."""


class Normaliser(NamedTuple):
    """(D,) mean and (D,) deviation: x → (x − mean) / std."""

    mean: Array
    std: Array

    def __call__(self, x: Array) -> Array:
        values: Array = ((x - self.mean) / self.std).astype(np.float32)
        return values


class ClipNormaliser(NamedTuple):
    """(C, D) mean and (C, D) deviation of the standardised poses of every clip of a store."""

    centre: Array
    spread: Array

    def __call__(self, x: Array, clips: Array) -> Array:
        """Windows (B, T, D) of clips (B,), standardised by the moments of their own clips."""
        values: Array = (x - self.centre[clips][:, None]) / self.spread[clips][:, None]
        return values


def clip_moments(store: Store, pose: Normaliser) -> ClipNormaliser:
    """Mean and standard deviation of each clip by itself, so that no split learns from another."""
    rows = [pose(store.clip(clip)["pose"]) for clip in store.clips]
    centre = np.stack([poses.mean(0) for poses in rows])
    return ClipNormaliser(centre, np.stack([np.maximum(poses.std(0), np.float32(SPREAD_FLOOR)) for poses in rows]))


def standard_pose(store: Store) -> Normaliser:
    """The normaliser of poses, from the statistics of the store."""
    mean, std = store.statistics("pose")
    return Normaliser(mean, np.maximum(std, np.float32(POSE_FLOOR)))


def standard_audio(store: Store, reduce: Reduce | None) -> Normaliser:
    """The normaliser of audio, from the statistics of the store; where the audio is reduced, over its training clips.

    Raises:
        InputError: the store has no audio.
    """
    if "audio" not in store.arrays:
        raise InputError(f"the store {str(store.folder)!r} has no audio", "was it prepared from a corpus with speech?")
    if reduce is None:
        mean, std = store.statistics("audio")
        return Normaliser(mean, np.where(std < _TINY, np.float32(1), std))
    count, total, square = 0, np.zeros(()), np.zeros(())
    clips = [clip for clip in store.clips if clip.split == "train" and "audio" in clip.has]
    if not clips:
        raise InputError(f"no training clip of the store {str(store.folder)!r} has audio")
    shift = reduce(store.clip(clips[0])["audio"]).astype(float).mean(0)  # near the mean, so that no digits cancel
    for clip in clips:
        rows = reduce(store.clip(clip)["audio"]).astype(float) - shift
        count, total, square = count + len(rows), total + rows.sum(0), square + np.square(rows).sum(0)
    mean = total / count
    std = np.sqrt(np.maximum(square / count - mean**2, 0))
    return Normaliser((mean + shift).astype(np.float32), np.where(std < _TINY, 1, std).astype(np.float32))


def pool_columns(each: Normaliser) -> Normaliser:
    """One mean and one deviation for all columns: those of all numbers together."""
    mean = each.mean.astype(float).mean()
    std = np.sqrt((np.square(each.std.astype(float)) + np.square(each.mean - mean)).mean())
    return Normaliser(np.full_like(each.mean, mean), np.full_like(each.std, std))


class BatchLoader:
    """Batches of standardised windows, by step.

    Args:
        windows: to draw from.
        standards: array name → its normaliser; other arrays stay as in the store.
        reduce: reduction of the audio, before it is standardised.
        moments: of the clips; with them, the poses of each clip have mean 0 and deviation 1.
    """

    def __init__(
        self, windows: Windows, standards: dict[str, Normaliser], reduce: Reduce | None, moments: ClipNormaliser | None = None
    ) -> None:
        self.windows, self._standards, self._reduce, self._moments = windows, standards, reduce, moments

    def at(self, batch: int, seed: int, step: int, *, rank: int = 0, parts: int = 1) -> dict[str, Array]:
        """As `Windows.at`; whole numbers as int64."""
        arrays = self.windows.at(batch, seed, step, rank=rank, parts=parts)
        if self._reduce is not None and "audio" in arrays:
            columns = arrays["audio"]
            rows = self._reduce(columns.reshape(-1, columns.shape[-1]))
            arrays["audio"] = rows.reshape(*columns.shape[:2], -1)
        inputs = {name: self._convert(name, array) for name, array in arrays.items()}
        if self._moments is not None:
            inputs["pose"] = self._moments(inputs["pose"], arrays["clip"])
        return inputs

    def _convert(self, name: str, array: Array) -> Array:
        if name in self._standards:
            return self._standards[name](array)
        return array.astype(np.float32 if array.dtype.kind == "f" else np.int64, copy=False)


def check_mirror(store: Store, mirror: bool | None) -> None:
    """Check that the store has the mirrored clips that a recipe needs.

    Raises:
        InputError: it has none.
    """
    if mirror and not any(is_mirror_image(clip.name) for clip in store.clips):
        raise InputError(f"the store {str(store.folder)!r} has no mirrored clips", "prepare it with --mirror")
