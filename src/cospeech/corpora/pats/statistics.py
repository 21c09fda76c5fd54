"""The statistics of PATS' speakers that its authors publish: k-means centres for Mode F1, means and variances."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array
from ..hdf5_lmdb import Hdf5LmdbReader

__all__ = ["CENTRES", "load_statistics"]

CENTRES = "centers/8_pose_velocity_speed_0_7_8_9_pose_normalize"
"""The 8 centres (8, 240) by which Mode F1 sorts frames, in the authors' statistics of each speaker."""


def load_statistics(path: str | PathLike[str]) -> dict[str, Array]:
    """The authors' statistics of a speaker, by name: `CENTRES` and others (K, D), or ``pose/data/mean`` … (D,).

    Raises:
        InputError: it cannot be read, or holds no such statistics.
    """
    with Hdf5LmdbReader("hdf5") as reader:
        data, _ = reader.hdf5(Path(path))
    arrays = {name: np.asarray(item.value) for name, item in data.items()}
    for name, array in arrays.items():
        last = name.rpartition("/")[2]
        if array.dtype.kind != "f" or not (name.startswith("centers/") or last in ("mean", "var")) or array.ndim not in (2, 3):
            raise InputError(
                f"{Path(path).name!r}: {name} is {array.dtype} of shape {array.shape}", "means or centres are right"
            )
        if not np.isfinite(array).all() or (last == "var" and array.min(initial=0) < 0):
            raise InputError(f"{Path(path).name!r}: {name} holds values that cannot be", "is it damaged?")
    if not arrays:
        raise InputError(f"{Path(path).name!r} holds no statistics", "name a .kmeans.h5 or a .muvar.h5")
    return {name: array.reshape(-1) if array.ndim == 3 else array for name, array in arrays.items()}
