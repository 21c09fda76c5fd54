"""Stretches of a plan: cutting parts out of them, and laying values over them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .plan_model import Stretch

__all__ = ["cut_out", "lay_over"]


def cut_out(parts: list[tuple[float, float]], holes: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The parts without the holes; each is from and to in seconds."""
    for low, high in holes:
        parts = [
            piece
            for a, b in parts
            for piece in ((a, min(b, low)), (max(a, high), b))
            if piece[0] < piece[1]
        ]  # fmt: skip
    return parts


def lay_over(stretches: list[Stretch], low: float, high: float, values: dict[str, Any]) -> list[Stretch]:
    """Stretches with values from ``low`` to ``high`` seconds, on top of those that they have."""
    result = list[Stretch]()
    for each in stretches:
        for a, b in cut_out([(each.start, each.end)], [(low, high)]):
            result.append(each.model_copy(update={"start": a, "end": b}))
        a, b = max(each.start, low), min(each.end, high)
        if a < b:
            result.append(each.model_copy(update={"start": a, "end": b, **values}))
    gaps = cut_out([(low, high)], ((each.start, each.end) for each in stretches))
    result += [Stretch.model_validate({"from": a, "to": b, **values}) for a, b in gaps]
    return sorted(result, key=lambda each: each.start)
