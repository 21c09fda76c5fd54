"""How wide and how fast the hands move with an emotion, compared with the same speech without it: do gestures show the emotion?

Xu et al. 2024 (section 4) look at pictures: happiness moves outward, sadness and fear inward. Here it is measured: each
speech is performed with the emotion and neutrally, and the ratio of the two is averaged over speeches and seeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array
from .interval import mean_score
from .movement import Track, arms_of, wrist_speeds
from .movement_signal import norm
from .sample import Score

__all__ = ["Wrists", "against", "wrists_of"]

BOX = (5.0, 95.0)  # percentiles; ours: the box of the wrists without its outliers


@dataclass(frozen=True)
class Wrists:
    """Measures of one performance; lengths in metres, relative to the hips, with the slow heading removed."""

    distance: float
    """Mean distance of the wrists from the upright line through the hips."""
    box: float
    """Edge of the cube as large as the box that holds both wrists for 90 % of the time."""
    speed: float
    """Mean speed, m/s, below 6 Hz."""


def wrists_of(motion: Motion) -> Wrists:
    """How wide and how fast the wrists move.

    Raises:
        InputError: another skeleton than our humanoid.
    """
    track = Track.of(motion)
    wrists = arms_of(track)["wrists"]
    low, high = np.percentile(wrists.reshape(-1, 3), BOX, axis=0)
    return Wrists(
        distance=float(norm(wrists[..., [0, 2]]).mean()),
        box=float(np.prod(high - low) ** (1 / 3)),
        speed=float(wrist_speeds(track).mean()),
    )


def against(emotional: Sequence[Wrists], plain: Sequence[Wrists], *, seed: int = 0) -> dict[str, Score]:
    """Measure → geometric mean of emotional / plain over pairs, with its 95 % interval.

    Args:
        emotional: performances with the emotion, one for each speech and seed.
        plain: performances of the same speeches and seeds without it.
        seed: of the bootstrap.

    Raises:
        InputError: no pair, or not as many of each.
    """
    if len(emotional) != len(plain) or not emotional:
        raise InputError(f"{len(emotional)} performances against {len(plain)}", "pairs, and one at least")
    scores = {}
    for part in fields(Wrists):
        a, b = (np.array([getattr(each, part.name) for each in some]) for some in (emotional, plain))
        score = mean_score(_logs(a, b), seed=seed)
        ends = None if score.interval is None else (float(np.exp(score.interval[0])), float(np.exp(score.interval[1])))
        scores[part.name] = Score(float(np.exp(score.value)), ends, score.count)
    return scores


def _logs(a: Array, b: Array) -> list[float]:
    return [float(x) for x in np.log(np.maximum(a, 1e-9) / np.maximum(b, 1e-9))]
