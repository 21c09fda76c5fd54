"""Stretches of a plan: what is left of one, and values laid over what there is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .plan_model import Stretch

__all__ = ["cut_out", "lay_over"]


def cut_out(parts: list[tuple[float, float]], taken: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Stretches without those that are taken."""
    for low, high in taken:
        parts = [
            piece
            for a, b in parts
            for piece in ((a, min(b, low)), (max(a, high), b))
            if piece[0] < piece[1]
        ]  # fmt: skip
    return parts


def lay_over(stretches: list[Stretch], low: float, high: float, values: dict[str, Any]) -> list[Stretch]:
    """Values over a stretch, on top of what there is."""
    laid = list[Stretch]()
    for each in stretches:
        for a, b in cut_out([(each.start, each.end)], [(low, high)]):
            laid.append(each.model_copy(update={"start": a, "end": b}))
        a, b = max(each.start, low), min(each.end, high)
        if a < b:
            laid.append(each.model_copy(update={"start": a, "end": b, **values}))
    gaps = cut_out([(low, high)], ((each.start, each.end) for each in stretches))
    laid += [Stretch.model_validate({"from": a, "to": b, **values}) for a, b in gaps]
    return sorted(laid, key=lambda each: each.start)
