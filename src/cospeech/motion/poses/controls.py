"""Style controls of MoGlow (Alexanderson et al. 2020): height, speed and distance of the hands.

Each is a mean of both wrists over the 4 seconds about a frame, relative to the hips in the orientation of the T-pose (for TED:
to the lowest point): height in metres, speed in metres per second, horizontal distance in metres. A system is trained with the
controls of its data. It generates with constant ones, given as quantiles of the training data: ``hand_height:0.85``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module

import numpy as np

from ...errors import InputError, nearest
from ..motion import Motion
from ..named_numbers import read_named_numbers
from ..points import Points
from ..rotations import Array
from ..skeletons import SKELETONS
from ..skeletons.ted import JOINTS as TED
from . import Pose

__all__ = [
    "CONTROLS",
    "QUANTILES",
    "control_row",
    "read_controls",
    "style_controls",
]

CONTROLS = ("hand_height", "hand_speed", "hand_radius")
"""In the order of the columns; the authors' MG-H, MG-V and MG-R."""
QUANTILES = 101
"""Number of quantiles of a control in a bundle: 0, 0.01 … 1."""
SECONDS = 4.0  # of the running mean; Alexanderson et al. 2020 and the authors' code


def _wrists(vectors: Array, pose: Pose, fps: float) -> Array:
    """(T, 2, 3) left and right wrist from the hips, metres; the hips have the orientation of the T-pose."""
    body = pose.decode(np.asarray(vectors, np.float64), fps)
    if isinstance(body, Points):
        if body.layout != "ted":
            raise InputError(f"style controls of {pose.name}", "they need hands in three dimensions")
        return body.values[:, [TED.index("leftWrist"), TED.index("rightWrist")]] - body.values[:, :1]
    assert isinstance(body, Motion)
    skeleton = body.skeleton
    names = import_module(SKELETONS[skeleton.kind]).NAMES if skeleton.kind in SKELETONS else {}
    hands = [skeleton.index.get(names.get(hand, hand), -1) for hand in ("leftHand", "rightHand")]
    if min(hands) < 0:
        raise InputError(f"style controls of a {skeleton.kind!r} skeleton", "its hands have no names that we know")
    rotations = np.array(body.rotations, np.float64)
    rotations[:, 0] = skeleton.rest[0]
    positions, _ = skeleton.forward(rotations, np.zeros((len(rotations), 3)))
    return positions[:, hands]


def _running_mean(x: Array, frames: int) -> Array:
    """(T, …) means over ``frames // 2`` frames on both sides; fewer at the ends."""
    half, count = frames // 2, len(x)
    sums = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, 0)])
    low, high = np.maximum(np.arange(count) - half, 0), np.minimum(np.arange(count) + half + 1, count)
    return (sums[high] - sums[low]) / (high - low).reshape(-1, *[1] * (x.ndim - 1))


def style_controls(vectors: Array, pose: Pose, fps: float) -> Array:
    """The three controls of every frame.

    Args:
        vectors: (T, D) of a representation with hands in three dimensions, in the form that it decodes.
        pose, fps: representation and rate.

    Returns:
        (T, 3) float32, columns `CONTROLS`.

    Raises:
        InputError: the representation has no such hands.
    """
    if not len(vectors):
        return np.zeros((0, len(CONTROLS)), np.float32)
    wrists = _wrists(vectors, pose, fps)
    steps = np.linalg.norm(np.diff(wrists, axis=0), axis=-1) * fps
    speed = np.concatenate([steps[:1], steps]) if len(steps) else np.zeros((1, 2))
    height, radius = wrists[..., 1], np.linalg.norm(wrists[..., [0, 2]], axis=-1)
    both = np.stack([height.mean(1), speed.mean(1), radius.mean(1)], -1)
    return _running_mean(both, int(SECONDS * fps)).astype(np.float32)


def read_controls(text: str) -> dict[str, float]:
    """Parse ``"hand_height:0.85,hand_speed:0.15"``, as given to ``--style``; returns name → quantile.

    >>> read_controls("hand_height:0.85, hand_speed:0.15")
    {'hand_height': 0.85, 'hand_speed': 0.15}

    Raises:
        InputError: a control is unknown, or a quantile is not in 0 … 1.
    """
    quantiles: dict[str, float] = {}
    hint = "NAME:QUANTILE once, 0 … 1, such as hand_height:0.85"
    for name, value, part in read_named_numbers(
        text, number="quantile", of="style control", hint=hint, is_name=CONTROLS.__contains__
    ):
        if name not in CONTROLS:
            raise InputError(f"no style control is called {name!r}", nearest(name, CONTROLS))
        if value is None or not 0 <= value <= 1 or name in quantiles:
            raise InputError(f"style control {part!r}", hint)
        quantiles[name] = value
    return quantiles


def control_row(style: Mapping[str, float], quantiles: Array, controls: Sequence[str] = CONTROLS) -> Array:
    """The constant values of a performance.

    Args:
        style: name → quantile, 0 … 1; controls that it does not name are at their median.
        quantiles: (101, C), a column for each of ``controls``: those of a run (`control_quantiles`), or the standardised ones
            of a bundle.
        controls: names of the controls that the system has.

    Returns:
        (C,) float32, in the units of the quantiles: metres and metres per second, or standardised.

    Raises:
        InputError: the system does not have a control, or a number is no quantile.
    """
    for name, value in style.items():
        if name not in controls:
            hint = f"it has {', '.join(controls)}" if controls else "it was trained without"
            raise InputError(f"the system has no style control {name!r}", hint)
        if not 0 <= value <= 1:
            raise InputError(f"style control {name} at {value}", "a quantile, 0 … 1")
    grid = np.linspace(0, 1, len(quantiles))
    row = [np.interp(style.get(name, 0.5), grid, column) for name, column in zip(controls, quantiles.T, strict=True)]
    return np.array(row, np.float32)
