"""What the bundles of every kind of system have in common: facts, sizes, statistics of the training data, members.

A kind is a module with its ``KIND``, its `System` and its `Normalisation`, a function that checks and writes (`write_system`)
and one that opens; `cospeech.runtime.systems` and `cospeech.runtime.backends` list the kinds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from os import PathLike
from typing import Any, TypeVar

import numpy as np

from ..audio.features.reduce import REDUCTIONS, audio_width
from ..errors import InputError
from ..motion.poses import POSES, find_pose
from ..motion.rotations import Array
from .bundle import Bundle, pack_arrays, write_bundle

__all__ = [
    "MARGIN", "STATISTICS", "WEIGHTS", "Facts", "Normalisation", "System", "check_kind", "check_numbers", "pose_bounds",
    "read_facts", "read_sizes", "read_statistics", "write_system",
]  # fmt: skip

MARGIN = 0.25  # ours: of the range of a number in the training data, beyond either end, that a pose may reach
FRAME_RATES = (1.0, 240.0)
MOST_SMOOTH = 8  # frames; ours
FARTHEST = 1e6  # ours: no pose, no feature comes near
STATISTICS, WEIGHTS = "statistics.safetensors", "weights.safetensors"
_CARD = "card.md"
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
    card: str
    """Markdown."""


@dataclass(frozen=True)
class Normalisation:
    """What stands between vectors of a pose or of audio and what a network sees; ranges are standardised."""

    pose_mean: Array
    """(D,)"""
    pose_std: Array
    audio_mean: Array
    """(A,)"""
    audio_std: Array
    pose_low: Array
    """(D,) least standardised value in the training data."""
    pose_high: Array
    audio_low: Array
    audio_high: Array


@dataclass(frozen=True)
class System(Facts):
    """A bundle ready to perform; those of a kind say which engine and which statistics."""

    engine: Any
    statistics: Any
    """`Normalisation`, and more."""


def check_kind(bundle: Bundle, kind: str, what: str) -> None:
    """Whether a bundle is of a kind, which is ``what`` in words.

    Raises:
        InputError: it is of another.
    """
    found = bundle.manifest.get("kind")
    if found != kind:
        raise InputError(f"{bundle.name!r} holds a {str(found)[:40]!r}, not {what}")


def read_facts(bundle: Bundle, pose_width: int, audio_width_: int) -> Facts:
    """The facts of a manifest, and the card.

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
    card = bundle.members.get(_CARD, b"").decode("utf-8", "replace")
    return Facts(pose, fps, audio, smooth, tuple(names), style, card)


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


def check_numbers(statistics: Normalisation, pose: int, audio: int, more: Mapping[str, tuple[int, ...]]) -> None:
    """Types, shapes and values of arrays.

    Args:
        statistics: all of them.
        pose, audio: D and A.
        more: shapes of those that are not in `Normalisation`.

    Raises:
        InputError: they cannot be used.
    """
    every = {f.name: (audio if f.name.startswith("audio") else pose,) for f in fields(Normalisation)} | dict(more)
    for name, shape in every.items():
        value = getattr(statistics, name)
        if value.shape != shape or value.dtype != np.float32:
            raise InputError(f"statistics {name!r} of {value.dtype} {value.shape}", f"float32 {shape}")
        if not np.abs(value).max(initial=0) < FARTHEST:  # not a number fails this too
            raise InputError(f"statistics {name!r} hold numbers that are not finite or absurd")
    if min(statistics.pose_std.min(), statistics.audio_std.min()) <= 0:
        raise InputError("statistics with a deviation that is not positive")
    if (statistics.pose_low > statistics.pose_high).any() or (statistics.audio_low > statistics.audio_high).any():
        raise InputError("statistics with a range whose ends are exchanged")


def pose_bounds(statistics: Normalisation) -> tuple[Array, Array]:
    """(D,) least and greatest numbers of a pose that is made: those of the training data and some more."""
    margin = MARGIN * (statistics.pose_high - statistics.pose_low) + 1e-3
    return statistics.pose_low - margin, statistics.pose_high + margin


def write_system(
    path: str | PathLike[str],
    kind: str,
    sizes: Any,
    weights: Mapping[str, Array],
    graphs: Mapping[str, bytes],
    statistics: Normalisation,
    facts: Mapping[str, Any],
    card: str,
) -> None:
    """Write a system that was checked.

    Args:
        path: of the bundle.
        kind: of the system.
        sizes: of the network, a dataclass.
        weights: of the graphs.
        graphs: name → ONNX.
        statistics: of the training data.
        facts: for the manifest, those of `Facts` among them.
        card: Markdown.

    Raises:
        InputError: it cannot be written.
    """
    members = {
        WEIGHTS: pack_arrays(weights),
        STATISTICS: pack_arrays(vars(statistics)),
        **{f"{name}.onnx": graph for name, graph in graphs.items()},
        _CARD: card.encode(),
    }
    write_bundle(path, {**facts, "kind": kind, "sizes": asdict(sizes)}, members)
