"""Skeletons with our humanoid's proportions and other names: the place of a joint is given by our joints.

Character files of these kinds differ in size, so that no set of offsets is *the* right one; ours is an adult of 1.72 m. If the
user retargets to an own file, the offsets of that file are kept.
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
    """End of the last bone of a chain in the T-pose, metres."""
    return tuple(a + b for a, b in zip(_POINTS[name], ENDS[name], strict=True))  # type: ignore[return-value]


def between(a: str, b: str, part: float) -> Point:
    """The point at ``part`` (0 … 1) of the way from our joint ``a`` to ``b`` in the T-pose, metres."""
    return tuple(p + (q - p) * part for p, q in zip(_POINTS[a], _POINTS[b], strict=True))  # type: ignore[return-value]


def rows(joints: Iterable[tuple[str, str | None, str | Point]]) -> list[Row]:
    """Make rows ``(name, parent, offset)`` of rows ``(name, parent, our joint's name or a point in metres)``."""
    at: dict[str, Point] = {}
    result: list[Row] = []
    for name, parent, where in joints:
        at[name] = _POINTS[where] if isinstance(where, str) else where
        base = at[parent] if parent else (0.0, 0.0, 0.0)
        x, y, z = (round(a - b, 6) for a, b in zip(at[name], base, strict=True))
        result.append((name, parent, (x, y, z)))
    return result
