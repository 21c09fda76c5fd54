"""From the morph targets of somebody's character back to ARKit's weights: read the face of an animation.

Where the character has VRM's presets or Oculus' visemes, these are found from its targets (least squares), and become ARKit
weights that give the same presets again. So a clip that is read, cut and written for the same character keeps its face. For
another character, it keeps what the smaller alphabet can say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from .tracks import Curve
from .visemes import OCULUS_VOWELS, invert_presets

__all__ = ["Bind", "read_arkit", "read_presets"]

_SWEEPS, _TINY = 40, 1e-6  # ours: over a dozen drivers, of which few share a target
_VOWELS = {f"viseme_{oculus}": vrm for oculus, vrm in OCULUS_VOWELS.items()}
_SHAPES = {
    "lookUp": ("eyeLookUpLeft", "eyeLookUpRight"), "lookDown": ("eyeLookDownLeft", "eyeLookDownRight"),
    "lookLeft": ("eyeLookOutLeft", "eyeLookInRight"), "lookRight": ("eyeLookInLeft", "eyeLookOutRight"),
    "blink": ("eyeBlinkLeft", "eyeBlinkRight"), "blinkLeft": ("eyeBlinkLeft",), "blinkRight": ("eyeBlinkRight",),
    "viseme_PP": ("mouthPressLeft", "mouthPressRight"), "viseme_FF": ("mouthRollLower",),
}  # fmt: skip
"""Driver → the shapes whose weight it gives directly."""


class Bind(NamedTuple):
    """``share`` of a driver's weight goes to a morph target; ``binary`` drivers are on or off."""

    driver: str
    node: int
    target: int
    share: float = 1.0
    binary: bool = False


def read_arkit(binds: Sequence[Bind], curves: Mapping[tuple[int, str], Curve], times: Array) -> Array | None:
    """ARKit weights (T, 52) of a character that has ARKit's targets; None where the animation moves none of them."""
    by_driver: dict[str, Bind] = {}
    for bind in _find_moving(binds, curves):
        by_driver.setdefault(bind.driver, bind)
    face = np.zeros((len(times), len(ARKIT)))
    for name, bind in by_driver.items():
        face[:, ARKIT_INDEX[name]] = _weights_of(bind.node, bind.target, curves, times)
    return np.clip(face, 0, 1) if by_driver else None


def read_presets(
    binds: Sequence[Bind], base: Mapping[int, Array], curves: Mapping[tuple[int, str], Curve], times: Array
) -> Array | None:
    """ARKit weights (T, 52) that look like an animation of VRM's presets or of Oculus' visemes; None where it moves none."""
    moving = _find_moving(binds, curves)
    if not moving:
        return None
    smooth = {(bind.node, bind.target) for bind in moving if not bind.binary}  # a binary driver says little of the weight
    relevant = [bind for bind in moving if not bind.binary or (bind.node, bind.target) not in smooth]
    names, targets = sorted({bind.driver for bind in relevant}), sorted({(bind.node, bind.target) for bind in relevant})
    shares = np.zeros((len(targets), len(names)))
    for bind in relevant:
        shares[targets.index((bind.node, bind.target)), names.index(bind.driver)] += bind.share
    weights = np.stack([_weights_of(*target, curves, times) - base[target[0]][target[1]] for target in targets], 1)
    drivers = dict(zip(names, _solve(shares, weights).T, strict=True))
    face = invert_presets({_VOWELS.get(name, name): value for name, value in drivers.items()}, len(times))
    for name, value in drivers.items():
        for shape in _SHAPES.get(name, (name,) if name in ARKIT_INDEX else ()):
            face[:, ARKIT_INDEX[shape]] = np.minimum(face[:, ARKIT_INDEX[shape]] + value, 1)
    return face


def _solve(shares: Array, weights: Array) -> Array:
    """(T, drivers) least squares, none below 0: ``shares`` (targets, drivers) of each driver, and (T, targets) ``weights``."""
    square, pull = shares.T @ shares, weights @ shares
    solution = np.zeros_like(pull)
    for _ in range(_SWEEPS):
        for k in range(len(square)):
            solution[:, k] = np.maximum(solution[:, k] + (pull[:, k] - solution @ square[k]) / max(square[k, k], _TINY), 0)
    return np.minimum(solution, 1)


def _find_moving(binds: Sequence[Bind], curves: Mapping[tuple[int, str], Curve]) -> list[Bind]:
    """The binds whose target has a curve."""
    pairs = [(bind, curves.get((bind.node, "weights"))) for bind in binds]
    return [bind for bind, curve in pairs if curve is not None and bind.target < curve.values.shape[1]]


def _weights_of(node: int, target: int, curves: Mapping[tuple[int, str], Curve], times: Array) -> Array:
    """(T,) weights of one target; a mesh may have thousands of others."""
    curve = curves[node, "weights"]
    return curve._replace(values=curve.values[:, target : target + 1]).at(times)[:, 0]
