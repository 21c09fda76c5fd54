"""Key points over time, for bodies without known rotations."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError
from .rotations import Array

__all__ = ["Points"]


@dataclass(frozen=True, eq=False)
class Points:
    """Key points over time, for corpora that have no joint rotations.

    Args:
        fps: frames per second.
        values: (T, J, 2) or (T, J, 3), in pixels or metres as in the corpus (`layout` says which), but with y *up*, and the
            person's left at +x when seen from the front.
        layout: name of the key-point table: ``"ted"`` (10 joints, 3-D) or ``"pats"`` (52 joints, 2-D).
    """

    fps: float
    values: Array
    layout: str

    def __post_init__(self) -> None:
        if self.values.ndim != 3 or self.values.shape[2] not in (2, 3) or not self.fps > 0:
            raise InputError(f"key points of shape {self.values.shape} at {self.fps} fps")

    def __len__(self) -> int:
        return len(self.values)

    @property
    def duration(self) -> float:
        """Seconds: frames over fps."""
        return len(self) / self.fps
