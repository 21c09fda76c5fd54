"""Movements of the face besides speech: the emotion's expression, brows on accents, small friendly signs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..audio.prosodic_events import Accent
from ..motion.curves import smoothstep
from ..motion.noise import hash_uniform
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from ..motion.weighted_sum import add_weighted_rows

__all__ = ["BROWS_EARLY", "EXPRESSIONS", "IS_MOUTH", "accent_brows", "accent_swell", "couple"]

# The apex of each emotion after the action units of EMFACS (Ekman & Friesen 1983), with ARKit's names; "Both" stands
# for Left and Right. The amounts are ours, by eye. Rows in the order of the emotions of `cospeech.rules`.
_APEX: dict[str, dict[str, float]] = {
    "neutral": {},
    "happiness": {  # AU 6 + 12 + 25: cheeks lift the lower lid, the upper lid stays up, else it looks smug
        "mouthSmileBoth": 1.00, "cheekSquintBoth": 0.90, "eyeSquintBoth": 0.08, "eyeWideBoth": 0.20, "mouthUpperUpBoth": 0.26,
        "mouthLowerDownBoth": 0.16, "browOuterUpBoth": 0.26, "browInnerUp": 0.22,
    },
    "anger": {  # AU 4 + 5 + 7 + 10 + 23/24
        "browDownBoth": 1.00, "eyeSquintBoth": 0.45, "eyeWideBoth": 0.34, "noseSneerBoth": 0.48, "mouthPressBoth": 0.35,
        "mouthFrownBoth": 0.40, "mouthRollLower": 0.08, "jawForward": 0.25, "mouthUpperUpBoth": 0.14,
        "mouthLowerDownBoth": 0.16,
    },
    "sadness": {  # AU 1 + 4 + 15 + 17
        "browInnerUp": 1.00, "browDownBoth": 0.22, "mouthFrownBoth": 1.00, "eyeBlinkBoth": 0.28, "mouthShrugLower": 0.46,
        "eyeSquintBoth": 0.12, "cheekSquintBoth": 0.10,
    },
    "contempt": {  # AU 12 + 14 on one side
        "mouthSmileLeft": 0.62, "mouthDimpleLeft": 0.70, "eyeSquintBoth": 0.34, "mouthLeft": 0.18, "mouthPressLeft": 0.24,
        "browOuterUpLeft": 0.50, "browDownRight": 0.50, "eyeBlinkBoth": 0.14, "cheekSquintLeft": 0.20,
    },
    "surprise": {  # AU 1 + 2 + 5 + 26
        "browInnerUp": 1.00, "browOuterUpBoth": 1.00, "eyeWideBoth": 0.85, "jawOpen": 0.18, "mouthFunnel": 0.12,
    },
    "fear": {  # AU 1 + 2 + 4 + 5 + 20: the brows are drawn together as they rise, the lips drawn apart
        "browInnerUp": 1.00, "browOuterUpBoth": 0.12, "browDownBoth": 0.34, "eyeWideBoth": 0.90, "mouthStretchBoth": 0.90,
        "mouthFrownBoth": 0.42, "mouthLowerDownBoth": 0.24,
    },
    "disgust": {  # AU 9 + 10 + 17
        "noseSneerBoth": 1.00, "mouthUpperUpBoth": 0.50, "browDownBoth": 0.66, "eyeSquintBoth": 0.50, "cheekSquintBoth": 0.36,
        "mouthFrownBoth": 0.50, "mouthShrugLower": 0.34, "mouthShrugUpper": 0.12,
    },
}  # fmt: skip


def _rows() -> Array:
    table = np.zeros((len(_APEX), len(ARKIT)))
    for row, shape in zip(table, _APEX.values(), strict=True):
        for name, amount in shape.items():
            for side in (name.replace("Both", "Left"), name.replace("Both", "Right")):
                row[ARKIT_INDEX[side]] = amount
    return table


EXPRESSIONS = _rows()
"""(8, 52) ARKit weights at the apex of each emotion."""
IS_MOUTH = np.array([name.startswith(("mouth", "jaw", "tongue")) for name in ARKIT])
"""(52,) channels that speech needs."""

_STRONG = 0.35  # accents from this strength on may raise the brows (ours)
_RISE, _HOLD, _FALL = 0.20, 0.14, 0.55  # s; a brow flash: up before the accent's peak, then slowly down (ours)
BROWS_EARLY = 0.24
"""Seconds before the energy peak at which a brow flash starts (ours)."""
SWELL_EARLY, _SWELL_LATE = 0.80, 0.25
"""Seconds before an accent from which an expression swells, and after it at which it is strongest (ours)."""
_STROKE_CHANCE = 0.9  # [ours] chance of a sign of the face with a stroke, at a coupling of 1
_KNIT = 0.14  # share of accents with the brows drawn together instead
_ALONE = 0.10  # share of rises of one brow only
_WHICH, _SIDE, _MUCH, _INNER = range(5201, 5205)  # streams of the hash


def couple(chance: Array | float, has_stroke: Array | bool, coupling: float) -> Array:
    """Chances of a sign of face or head at accents: pulled up where a stroke of the hands goes with them, else down.

    About half of all accents have a stroke; so the number of signs stays about the same.

    Args:
        chance: without any coupling.
        has_stroke: whether a stroke of the hands goes with the accent.
        coupling: 0 none … 1.
    """
    chance = np.asarray(chance, float)
    return np.where(has_stroke, chance + coupling * np.maximum(_STROKE_CHANCE - chance, 0.0), chance * (1 - coupling))


def accent_brows(
    times: Array,
    accents: Sequence[Accent],
    *,
    seed: int,
    amount: float = 1.0,
    strokes: Sequence[float] = (),
    coupling: float = 0.0,
    late: float = 0.0,
) -> Array:
    """(T, 4): brow inner up, outer up left, outer up right, down, raised by accents; 0 … about 0.8.

    Some 40 % of strong accents move the brows, more or fewer by ``amount`` (0: none); how much, which and how evenly is drawn
    from the seed and the accent's time. With ``coupling``, more of those whose times are in ``strokes`` do, and fewer others.
    All brows move ``late`` seconds later.
    """
    if not len(accents):
        return np.zeros((len(times), 4))
    stroke_times = set(strokes)
    has_stroke = tuple(accent.time in stroke_times for accent in accents)
    when, rises = _draw_brows(tuple(accents), has_stroke, seed, amount, coupling * min(amount, 1.0))
    since = times[:, None] - (when - BROWS_EARLY + late)
    ramp = np.minimum(since / _RISE, (_RISE + _HOLD + _FALL - since) / _FALL)
    return np.tanh(add_weighted_rows(smoothstep(ramp), rises))  # overlapping rises saturate


@lru_cache(32)
def _draw_brows(
    accents: tuple[Accent, ...], has_stroke: tuple[bool, ...], seed: int, amount: float, coupling: float
) -> tuple[Array, Array]:
    """(A,) times of accents, and (A, 4) how far each moves the brows; ``has_stroke``: whether each has a stroke. Cached, as a
    stream asks for the same accents many times."""
    when, strength = np.array(accents, float).T
    index = np.rint(when * 1000).astype(np.int64)
    which, side, much, inner = hash_uniform(seed, np.arange(_WHICH, _INNER + 1)[:, None], index)
    chance = np.where(strength < _STRONG, 0.06, 0.18 + 0.32 * strength) * amount
    chance = couple(chance, np.array(has_stroke), coupling)
    knit = (which > 1 - _KNIT * min(amount, 1.0)) & (strength > _STRONG)
    size = (0.55 + 0.6 * much) * (0.18 + 0.5 * strength) * (0.5 + 0.5 * amount)
    up = np.where(which < chance, size, 0.0)
    alone = np.where(side < _ALONE / 2, -1.0, np.where(side > 1 - _ALONE / 2, 1.0, 0.5 * (side - 0.5)))
    rises = np.stack([
        up * (0.55 + 0.45 * inner) * (1 - 0.6 * np.abs(alone)),
        up * (0.9 - 0.5 * inner) * (1 + np.minimum(alone, 0)),
        up * (0.9 - 0.5 * inner) * (1 - np.maximum(alone, 0)),
        np.where(knit, 0.8 * size, 0.0),
    ], 1)  # fmt: skip
    rises.setflags(write=False)
    return when, rises


def accent_swell(times: Array, accents: Sequence[Accent], *, late: float = 0.0) -> Array:
    """(T,) 0 … 1: how strong the accents around each time are, smoothed. An expression swells by it, ``late`` seconds later."""
    if not len(accents):
        return np.zeros(len(times))
    when, strength = np.array(accents, float).T
    near = 1 - np.abs(times[:, None] - (when + late) - _SWELL_LATE) / (SWELL_EARLY + _SWELL_LATE)
    return np.tanh(add_weighted_rows(smoothstep(near), strength[:, None]))[:, 0]
