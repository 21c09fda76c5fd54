"""What the bundles of every kind of system have in common: facts of a manifest, sizes, statistics of the training data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeVar

import numpy as np

from ..errors import InputError
from ..features.reduce import REDUCTIONS, audio_width
from ..poses import POSES, find_pose
from ..rotations import Array
from .bundle import Bundle

__all__ = ["MARGIN", "STATISTICS", "Facts", "check_numbers", "pose_bounds", "read_facts", "read_sizes", "read_statistics"]

MARGIN = 0.25  # ours: of the range of a number in the training data, beyond either end, that a pose may reach
FRAME_RATES = (1.0, 240.0)
MOST_SMOOTH = 8  # frames; ours
FARTHEST = 1e6  # ours: no pose, no feature comes near
STATISTICS = "statistics.safetensors"
T = TypeVar("T")


@dataclass(frozen=True)
class Facts:
    """What every system says of itself."""

    pose: str
    """Name of the representation of poses."""
    fps: float
    audio: str
    """Name of the reduction of audio."""
    smooth: int
    """How many frames to either side poses are averaged over, with binomial weights."""
    styles: tuple[str, ...]
    """Names of the speakers."""
    style: str
    """The one that is played where nobody says."""


def read_facts(bundle: Bundle, pose_width: int, audio_width_: int) -> Facts:
    """The facts of a manifest.

    Args:
        bundle: whose.
        pose_width: numbers of the network's poses.
        audio_width_: columns of speech that the network hears, but for style controls.

    Raises:
        InputError: some are missing, unknown, absurd, or do not go with the network.
    """
    pose, audio, fps = bundle.fact("pose", str), bundle.fact("audio", str), float(bundle.fact("fps", (int, float)))
    smooth, names, style = bundle.fact("smooth", int), bundle.fact("styles", list), bundle.fact("style", str)
    if style not in names or len({str(name) for name in names}) < len(names) or not all(isinstance(n, str) for n in names):
        raise InputError(f"{bundle.name!r} has no list of styles", "is it damaged?")
    known = pose in POSES and audio in REDUCTIONS
    if not known or find_pose(pose).dimensions != pose_width or audio_width(audio) != audio_width_:
        raise InputError(f"{bundle.name!r} has poses {pose[:40]!r} and audio {audio[:40]!r}", "is it of another version?")
    if not (FRAME_RATES[0] <= fps <= FRAME_RATES[1] and 0 <= smooth <= MOST_SMOOTH):
        raise InputError(f"{bundle.name!r} has {fps} frames per second, smoothed over {smooth}", "is it damaged?")
    return Facts(pose, fps, audio, smooth, tuple(names), style)


def read_sizes(bundle: Bundle, kind: type[T]) -> T:
    """The sizes of a network, by the names of a dataclass; bundles outlive sizes that are added with a default.

    Raises:
        InputError: they are of another network, or absurd.
    """
    given = bundle.fact("sizes", dict)
    every: tuple[Any, ...] = fields(kind)  # type: ignore[arg-type]
    if not {f.name for f in every if f.default is MISSING} <= set(given) <= {f.name for f in every}:
        raise InputError(f"{bundle.name!r} does not tell the sizes of its network", "is it of another version?")
    return kind(**given)


def read_statistics(bundle: Bundle, kind: type[T]) -> T:
    """`STATISTICS`, by the names of a dataclass of arrays; not checked.

    Raises:
        InputError: there are others.
    """
    arrays = bundle.arrays(STATISTICS)
    if set(arrays) != {f.name for f in fields(kind)}:  # type: ignore[arg-type]
        raise InputError(f"{bundle.name!r} has other statistics than its kind", "is it of another version?")
    return kind(**arrays)


def check_numbers(statistics: Any, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Types, shapes and values of arrays, of which all have ``pose_std``, ``audio_std`` and the ranges of both.

    Args:
        statistics: a dataclass of arrays.
        shapes: of all of them.

    Raises:
        InputError: they cannot be used.
    """
    for name, shape in shapes.items():
        value = getattr(statistics, name)
        if value.shape != shape or value.dtype != np.float32:
            raise InputError(f"statistics {name!r} of {value.dtype} {value.shape}", f"float32 {shape}")
        if not np.abs(value).max(initial=0) < FARTHEST:  # not a number fails this too
            raise InputError(f"statistics {name!r} hold numbers that are not finite or absurd")
    if min(statistics.pose_std.min(), statistics.audio_std.min()) <= 0:
        raise InputError("statistics with a deviation that is not positive")
    if (statistics.pose_low > statistics.pose_high).any() or (statistics.audio_low > statistics.audio_high).any():
        raise InputError("statistics with a range whose ends are exchanged")


def pose_bounds(statistics: Any) -> tuple[Array, Array]:
    """(D,) least and greatest numbers of a pose that is made: those of the training data and some more."""
    margin = MARGIN * (statistics.pose_high - statistics.pose_low) + 1e-3
    return statistics.pose_low - margin, statistics.pose_high + margin
