"""Some speakers of a store as a store of its own: a view that copies no data, with statistics of these speakers alone."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from ..corpora.store import Store
from ..corpora.store_files import NUMBERED, STATISTICS
from ..corpora.store_writer import RowMoments
from ..errors import InputError, nearest

__all__ = ["of_speakers"]


def of_speakers(store: Store, names: Sequence[str]) -> Store:
    """The store as if it had been written of these speakers' clips; the files stay as they are.

    Args:
        store: the whole one.
        names: of speakers, in the order in which they are to be numbered; a mirrored one, ``ann|mirror``, is one by itself.

    Returns:
        a store with their clips, in the same rows, and with statistics over their training split (over all of their clips
        where there is none).

    Raises:
        InputError: no name, an unknown one, or one twice.
    """
    for name in names:
        if name not in store.speakers:
            raise InputError(f"no speaker of the store {str(store.folder)!r} is called {name!r}", nearest(name, store.speakers))
    if not names or len({*names}) < len(names):
        raise InputError(f"speakers {[*names]}", "one or more, each once")
    some = copy(store)
    some.speakers = tuple(names)
    some.clips = tuple(clip for clip in store.clips if clip.speaker in names)
    train = any(clip.split == "train" for clip in some.clips)
    row = {name: 1 + k for k, name in enumerate(names)}
    some.arrays = dict(store.arrays)
    for array in (name for name in NUMBERED if name in store.arrays):
        moments = RowMoments(1 + len(names), store.arrays[array].shape[1])
        for clip in some.clips:
            if array in clip.has and (clip.split == "train" or not train):
                values = store.clip(clip)[array]
                moments.add(0, values)
                moments.add(row[clip.speaker], values)
        some.arrays |= {f"{array}_{what}": np.array(x) for what, x in zip(STATISTICS, moments.results(), strict=True)}
    return some
