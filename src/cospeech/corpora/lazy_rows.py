"""Rows of a table that are looked up when they are asked for: an array of a store that would be too large to lay out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from ..motion.rotations import Array

__all__ = ["LazyRows"]


@dataclass(frozen=True, eq=False)
class LazyRows:
    """Reads like the array (N, …) whose row n is ``table[index[n]]``.

    Args:
        table: (V, …).
        index: (N,) whole numbers, 0 … V − 1.
    """

    table: Array
    index: Array

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.index), *self.table.shape[1:])

    @property
    def dtype(self) -> np.dtype[Any]:
        return self.table.dtype

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, rows: Any) -> Array:
        """One row, or the rows of a slice or of an array of row numbers."""
        return np.asarray(self.table[self.index[rows]])

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Array:
        return np.asarray(self[:], dtype)
