"""How clothes follow the skeleton: soft steps along the spine, around the shoulders and along the limbs."""

from __future__ import annotations

import numpy as np

from cospeech.motion.rotations import Array
from cospeech.motion.skeleton import humanoid

from .net import smoothstep
from .sculpture import joint, weights_of

__all__ = ["MELT", "hand_share", "limb_weights", "shirt_weights", "spine_weights"]

ELBOW = 0.051  # metres before and behind the elbow over which a sleeve bends; ours: less and its back is stretched

# How the shirt passes from the trunk to an arm, degrees and metres. Ours: the values of least stretch on 40 frames of
# gesturing, recorded and made, that are as unlike as possible; found by the simplex method of Nelder and Mead.
TILT = 39.6  # of the way along which the arm takes over, below the T-pose's arm
MIDDLE, SINK = 0.0444, -0.0600  # beyond the joint, where the arm has half the weight; farther under the joint than over it
REACH = 0.0819  # before and behind the middle
THICK = 0.0536  # from the arm's axis to the cloth above and under it
FLANK = 1.3495  # height at which the cloth under the arm has half of that
BONE = 1.3216  # height from which the collar bone carries the shirt
SHARE = 0.614  # of the shirt that the collar bone carries at most
MELT = 0.042  # over which the weights flow into one another at last


def spine_weights(y: Array) -> dict[str, Array]:
    """Weights of the spine's joints by height: soft steps around each joint."""
    names = ("hips", "spine", "chest", "upperChest", "neck", "head")
    heights = [joint(n)[1] for n in names]
    above = [np.ones_like(y)]
    for k in range(1, len(names)):
        reach = (0.0, 0.085, 0.070, 0.070, 0.030, 0.030)[k]
        above.append(smoothstep(heights[k] - reach, heights[k] + reach, y))
    above.append(np.zeros_like(y))
    return {n: above[k] * (1 - above[k + 1]) for k, n in enumerate(names)}


def _trunk_weights(p: Array) -> Array:
    """(V, J) weights of points (V, 3) on the trunk: the spine's, and the collar bones' above and beside the chest."""
    weights = weights_of(len(p), **spine_weights(np.minimum(p[:, 1], 1.40)))
    index = humanoid().index
    for sign, side in ((1, "left"), (-1, "right")):
        lift = smoothstep(0.03, 0.16, p[:, 0] * sign) * smoothstep(BONE, 1.42, p[:, 1]) * SHARE
        weights *= (1 - lift)[:, None]
        weights[:, index[side + "Shoulder"]] += lift
    return weights


def shirt_weights(p: Array, sleeve: Array) -> Array:
    """(V, J) weights of the shirt's points (V, 3), of which those of the sleeves (V,) are marked."""
    weights = _trunk_weights(p)
    tilt = np.radians(TILT)
    for sign, side in ((1, "left"), (-1, "right")):
        shoulder, elbow = joint(side + "UpperArm"), joint(side + "LowerArm")
        away, bone = p - shoulder, (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
        along = away @ [sign * np.cos(tilt), -np.sin(tilt), 0]
        height = np.clip(away @ [-sign * bone[1], abs(bone[0]), 0] / THICK, -1, 1)
        middle = MIDDLE + SINK * height
        arm = smoothstep(middle - REACH, middle + REACH, along) * (p[:, 0] * sign > 0.02)
        arm = np.where(sleeve, arm, arm * smoothstep(FLANK - 0.06, FLANK + 0.06, p[:, 1]))
        weights = weights * (1 - arm)[:, None] + limb_weights(p, side) * arm[:, None]
    return weights


def hand_share(x: Array) -> Array:
    """Share of the hand at ``x`` metres beyond the wrist: so its twist runs out over half of the forearm."""
    return 0.40 * smoothstep(-0.150, -0.010, x) + 0.60 * smoothstep(-0.042, 0.020, x)


def limb_weights(p: Array, side: str) -> Array:
    """Upper arm → forearm → hand, by the place along the bones; a share of the hand's twist reaches up the forearm."""
    shoulder, elbow, hand = (joint(side + n) for n in ("UpperArm", "LowerArm", "Hand"))
    upper, lower = elbow - shoulder, hand - elbow
    bisector = upper / np.linalg.norm(upper) + lower / np.linalg.norm(lower)
    bisector /= np.linalg.norm(bisector)
    bend = smoothstep(-ELBOW, ELBOW, (p - elbow) @ bisector)
    twist = hand_share((p - hand) @ lower / np.linalg.norm(lower)) * bend
    return weights_of(len(p), **{side + "UpperArm": 1 - bend, side + "LowerArm": bend - twist, side + "Hand": twist})
