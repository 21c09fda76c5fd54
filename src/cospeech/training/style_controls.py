"""The style controls of a store's recordings (`cospeech.motion.poses.controls`) as an array that a recipe can ask for."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from ..corpora.store import Store
from ..errors import InputError
from ..motion.poses import find_pose
from ..motion.poses.controls import CONTROLS, QUANTILES, style_controls
from ..motion.rotations import Array

__all__ = ["control_quantiles", "with_controls"]

_TINY = 1e-6  # a control that varies by less is constant, and has deviation 1 as in a store


def with_controls(store: Store) -> Store:
    """The same store with the array ``control`` (N, 3), computed from its poses, and its statistics; the files stay.

    Raises:
        InputError: see `style_controls`.
    """
    if "control" in store.arrays:
        return store
    pose = find_pose(store.pose)
    parts = [style_controls(store.clip(clip)["pose"], pose, store.fps) for clip in store.clips]
    train = any(clip.split == "train" for clip in store.clips)
    means, stds = [], []
    for speaker in (None, *store.speakers):
        own = [part for clip, part in zip(store.clips, parts, strict=True)
               if (clip.split == "train" or not train) and speaker in (None, clip.speaker)]  # fmt: skip
        rows = np.concatenate(own or parts).astype(np.float64)
        means.append(rows.mean(0))
        stds.append(np.where(rows.std(0) < _TINY, 1, rows.std(0)))
    control = np.full((len(store.arrays["pose"]), len(CONTROLS)), np.nan, np.float32)  # of rows that belong to no clip
    for clip, part in zip(store.clips, parts, strict=True):
        control[clip.offset : clip.offset + clip.frames] = part
    more = copy(store)
    more.arrays = store.arrays | {
        "control": control,
        "control_mean": np.array(means, np.float32),
        "control_std": np.array(stds, np.float32),
    }
    more.clips = tuple(replace(clip, has=(*clip.has, "control")) for clip in store.clips)
    return more


def control_quantiles(store: Store) -> Array:
    """(101, 3) quantiles 0, 0.01 … 1 of each control over the training split of a store `with_controls`."""
    rows = [store.clip(clip)["control"] for clip in store.clips if clip.split == "train"]
    if not rows:
        raise InputError(f"the store {str(store.folder)!r} has no training clips")
    return np.quantile(np.concatenate(rows), np.linspace(0, 1, QUANTILES), axis=0).astype(np.float32)
