"""Skeletons that have our humanoid's proportions under other names: where a joint is, said by our joints.

Character files of these kinds differ in size from person to person, so that no set of offsets is *the* right one; ours is
an adult of 1.72 m. Retargeting onto a file of the user's own keeps that file's offsets.
"""

from __future__ import annotations

from collections.abc import Iterable

from .humanoid import ENDS, JOINTS

__all__ = ["Row", "between", "rows", "tip"]

Point = tuple[float, float, float]
Row = tuple[str, str | None, Point]


def _points() -> dict[str, Point]:
    points: dict[str, Point] = {}
    for name, parent, (x, y, z) in JOINTS:
        px, py, pz = points[parent] if parent else (0.0, 0.0, 0.0)
        points[name] = (px + x, py + y, pz + z)
    return points


_POINTS = _points()


def tip(name: str) -> Point:
    """Where the last bone of a chain ends, in metres in the T-pose."""
    return tuple(a + b for a, b in zip(_POINTS[name], ENDS[name], strict=True))  # type: ignore[return-value]


def between(a: str, b: str, part: float) -> Point:
    """The point that lies ``part`` (0 … 1) of the way from our joint ``a`` to ``b``, in metres in the T-pose."""
    return tuple(p + (q - p) * part for p, q in zip(_POINTS[a], _POINTS[b], strict=True))  # type: ignore[return-value]


def rows(joints: Iterable[tuple[str, str | None, str | Point]]) -> list[Row]:
    """Rows ``(name, parent, offset)`` from rows ``(name, parent, our joint's name or a point in metres)``."""
    at: dict[str, Point] = {}
    result: list[Row] = []
    for name, parent, where in joints:
        at[name] = _POINTS[where] if isinstance(where, str) else where
        base = at[parent] if parent else (0.0, 0.0, 0.0)
        x, y, z = (round(a - b, 6) for a, b in zip(at[name], base, strict=True))
        result.append((name, parent, (x, y, z)))
    return result
