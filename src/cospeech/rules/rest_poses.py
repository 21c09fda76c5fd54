"""Where hands rest between gestures and in pauses; ours, in the units of `repertoire`."""

from __future__ import annotations

from .repertoire import HandPose as P

__all__ = ["RESTS"]

RESTS: dict[str, tuple[P, P]] = {
    "hang": (P(0.13, -0.97, 0.0, 2, 4, 4, "relaxed"), P(0.13, -0.965, 0.02, 4, 6, 3, "relaxed")),
    "low": (P(0.12, -0.90, 0.20, 6, 6, 2, "relaxed"), P(0.12, -0.90, 0.19, 4, 8, 0, "relaxed")),
    "waist": (P(-0.01, -0.62, 0.38, 24, 8, 0, "relaxed"), P(0.0, -0.60, 0.39, 30, 4, 3, "soft_open")),
    "folded": (P(-0.20, -0.66, 0.45, 42, 8, 0, "soft_open"), P(-0.17, -0.60, 0.51, 48, 10, 0, "loose_fist")),
    "steeple": (P(-0.15, -0.56, 0.48, 6, -6, 0, "flat"), P(-0.15, -0.56, 0.48, 6, -6, 0, "flat")),
    "lap": (P(-0.06, -0.72, 0.62, 64, 4, 0, "relaxed"), P(-0.08, -0.71, 0.64, 60, 6, 2, "relaxed")),
}
"""Resting places, left and right hand each in its own gesture space."""
