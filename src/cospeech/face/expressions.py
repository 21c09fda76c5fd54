"""What the face shows besides speech: the emotion's expression, brows on accents, small friendly signs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..audio.prosodic_events import Accent
from ..motion.noise import hash_uniform
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from ..motion.weighted_sum import add_weighted_rows

__all__ = ["EXPRESSIONS", "IS_MOUTH", "accent_brows", "accent_swell"]

# The apex of each emotion after the action units of EMFACS (Ekman & Friesen 1983), with ARKit's names; "Both" stands
# for Left and Right. The amounts are ours, by eye. Rows in the order of the emotions of `cospeech.rules`.
_APEX: dict[str, dict[str, float]] = {
    "neutral": {},
    "happiness": {  # AU 6 + 12
        "mouthSmileBoth": 0.85, "cheekSquintBoth": 0.62, "eyeSquintBoth": 0.34, "mouthDimpleBoth": 0.12,
        "mouthUpperUpBoth": 0.10, "browOuterUpBoth": 0.12, "browInnerUp": 0.08,
    },
    "anger": {  # AU 4 + 5 + 7 + 23/24
        "browDownBoth": 0.88, "eyeSquintBoth": 0.42, "eyeWideBoth": 0.18, "noseSneerBoth": 0.28, "mouthPressBoth": 0.35,
        "mouthFrownBoth": 0.20, "mouthRollLower": 0.08, "jawForward": 0.15, "mouthUpperUpBoth": 0.06,
    },
    "sadness": {  # AU 1 + 4 + 15
        "browInnerUp": 0.90, "browDownBoth": 0.15, "mouthFrownBoth": 0.72, "eyeBlinkBoth": 0.20, "mouthShrugLower": 0.30,
        "eyeSquintBoth": 0.10, "cheekSquintBoth": 0.06,
    },
    "contempt": {  # AU 12 + 14 on one side
        "mouthSmileLeft": 0.50, "mouthDimpleLeft": 0.60, "eyeSquintBoth": 0.30, "mouthLeft": 0.14, "mouthPressLeft": 0.18,
        "browOuterUpLeft": 0.36, "browDownRight": 0.36, "eyeBlinkBoth": 0.08, "cheekSquintLeft": 0.15,
    },
    "surprise": {  # AU 1 + 2 + 5 + 26
        "browInnerUp": 0.85, "browOuterUpBoth": 0.80, "eyeWideBoth": 0.70, "jawOpen": 0.10, "mouthFunnel": 0.06,
    },
    "fear": {  # AU 1 + 2 + 4 + 5 + 20
        "browInnerUp": 0.95, "browOuterUpBoth": 0.30, "browDownBoth": 0.18, "eyeWideBoth": 0.72, "mouthStretchBoth": 0.58,
        "mouthFrownBoth": 0.20, "mouthLowerDownBoth": 0.10,
    },
    "disgust": {  # AU 9 + 10 + 17
        "noseSneerBoth": 0.90, "mouthUpperUpBoth": 0.42, "browDownBoth": 0.60, "eyeSquintBoth": 0.35, "cheekSquintBoth": 0.28,
        "mouthFrownBoth": 0.38, "mouthShrugLower": 0.26, "mouthShrugUpper": 0.12,
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
_EARLY = 0.24  # s; it starts this long before the energy peak
_KNIT = 0.14  # share of accents with the brows drawn together instead
_ALONE = 0.10  # share of rises of one brow only
_WHICH, _SIDE, _MUCH, _INNER = range(5201, 5205)  # streams of the hash


def accent_brows(times: Array, accents: Sequence[Accent], *, seed: int) -> Array:
    """(T, 4): brow inner up, outer up left, outer up right, down, raised by accents; 0 … about 0.8.

    Some 40 % of strong accents move the brows; how much, which and how evenly is drawn from the seed and the accent's time.
    """
    if not len(accents):
        return np.zeros((len(times), 4))
    when, strength = np.array(accents, float).T
    index = np.rint(when * 1000).astype(np.int64)
    which, side, much, inner = hash_uniform(seed, np.arange(_WHICH, _INNER + 1)[:, None], index)
    chance = np.where(strength < _STRONG, 0.06, 0.18 + 0.32 * strength)
    knit = (which > 1 - _KNIT) & (strength > _STRONG)
    size = (0.55 + 0.6 * much) * (0.18 + 0.5 * strength)
    up = np.where(which < chance, size, 0.0)
    alone = np.where(side < _ALONE / 2, -1.0, np.where(side > 1 - _ALONE / 2, 1.0, 0.5 * (side - 0.5)))
    amount = np.stack([
        up * (0.55 + 0.45 * inner) * (1 - 0.6 * np.abs(alone)),
        up * (0.9 - 0.5 * inner) * (1 + np.minimum(alone, 0)),
        up * (0.9 - 0.5 * inner) * (1 - np.maximum(alone, 0)),
        np.where(knit, 0.8 * size, 0.0),
    ], 1)  # fmt: skip
    since = times[:, None] - (when - _EARLY)
    ramp = np.minimum(since / _RISE, (_RISE + _HOLD + _FALL - since) / _FALL)
    ramp = np.minimum(np.maximum(ramp, 0), 1)
    course = ramp * ramp * (3 - 2 * ramp)
    return np.tanh(add_weighted_rows(course, amount))  # overlapping rises saturate


def accent_swell(times: Array, accents: Sequence[Accent]) -> Array:
    """(T,) 0 … 1: how much is being stressed around each time, slowly; an expression is strongest there."""
    if not len(accents):
        return np.zeros(len(times))
    when, strength = np.array(accents, float).T
    near = np.maximum(1 - np.abs(times[:, None] - when - 0.25) / 1.05, 0)  # from 0.8 s before the accent on
    return np.tanh(add_weighted_rows(near * near * (3 - 2 * near), strength[:, None]))[:, 0]
