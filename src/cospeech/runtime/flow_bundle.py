"""Flows as bundles: what a training run writes, and an engine with its statistics out of one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from os import PathLike
from typing import Any

import numpy as np

from ..errors import InputError
from ..features.reduce import REDUCTIONS, audio_width
from ..poses import POSES, find_pose
from ..rotations import Array
from .bundle import Bundle, pack_arrays, write_bundle
from .flow_engine import FlowEngine
from .flow_graph import build_graphs
from .flow_weights import FlowSizes, check_weights, pack_weights

__all__ = ["KIND", "FlowSystem", "Statistics", "measure", "open_flow", "write_flow"]

KIND = "flow"
"""What a manifest's ``kind`` says of a bundle of this module."""
MARGIN = 0.25  # ours: of the range of a number in the training data, beyond either end, that a pose may reach
FRAME_RATES = (1.0, 240.0)


@dataclass(frozen=True)
class Statistics:
    """What stands between vectors of a pose or of audio and what the network sees; ranges are standardised."""

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
    histories: Array
    """(M, τ, D) standardised stretches of the training data, with which performances begin."""


def measure(clips: Iterable[tuple[Array, Array]], means: Mapping[str, Array], *, history: int) -> Statistics:
    """Ranges and beginnings of the training data.

    Args:
        clips: standardised poses (T, D) and audio (T, A) of each clip; its first τ poses become a beginning.
        means: ``pose_mean``, ``pose_std``, ``audio_mean``, ``audio_std``.
        history: τ.

    Raises:
        InputError: no clip is as long as a history.
    """
    edges: dict[str, Array] = {}
    histories: list[Array] = []
    for poses, audio in clips:
        for name, rows in (("pose", poses), ("audio", audio)):
            if len(rows):
                low, high = rows.min(0), rows.max(0)
                edges[f"{name}_low"] = np.minimum(edges.get(f"{name}_low", low), low)
                edges[f"{name}_high"] = np.maximum(edges.get(f"{name}_high", high), high)
        if len(poses) >= history and len(histories) < _MOST_HISTORIES:
            histories.append(poses[:history])
    if not histories:
        raise InputError("no clip to begin a performance with", f"at least one of {history} frames")
    arrays = {**means, **edges, "histories": np.stack(histories)}
    return Statistics(**{name: np.ascontiguousarray(value, np.float32) for name, value in arrays.items()})


_MOST_HISTORIES = 16  # ours: enough that takes do not begin alike


@dataclass(frozen=True)
class FlowSystem:
    """A bundle ready to perform."""

    engine: FlowEngine
    statistics: Statistics
    pose: str
    fps: float
    audio: str
    smooth: int
    """How many frames to either side poses are averaged over, with binomial weights."""
    card: str


def write_flow(
    path: str | PathLike[str],
    arrays: Mapping[str, Array],
    sizes: FlowSizes,
    statistics: Statistics,
    *,
    pose: str,
    fps: float,
    audio: str,
    smooth: int = 1,
    facts: Mapping[str, Any],
    card: str = "",
) -> None:
    """Write a flow as a bundle.

    Args:
        arrays: of the network, see `pack_weights`.
        sizes: of the network; ``int8`` says how weights are kept.
        statistics: see `measure`.
        pose, fps: representation and rate.
        audio: name of the reduction of audio (`cospeech.features.reduce.REDUCTIONS`).
        smooth: see `FlowSystem`.
        facts: for the manifest; ``model`` is its registry name.
        card: Markdown.

    Raises:
        InputError: these do not fit together.
    """
    weights = pack_weights(arrays, sizes)
    _check_statistics(statistics, sizes)
    manifest = {**facts, "kind": KIND, "sizes": asdict(sizes), "pose": pose, "fps": fps, "audio": audio, "smooth": smooth}
    members = {
        "weights.safetensors": pack_arrays(weights),
        "statistics.safetensors": pack_arrays({f.name: getattr(statistics, f.name) for f in fields(Statistics)}),
        **{f"{name}.onnx": graph for name, graph in build_graphs(weights, sizes).items()},
        "card.md": card.encode(),
    }
    write_bundle(path, manifest, members)


def open_flow(bundle: Bundle) -> FlowSystem:
    """An engine and all that it needs, out of a bundle.

    Raises:
        InputError: the bundle is of another kind, or its parts do not fit together.
    """
    if bundle.manifest.get("kind") != KIND:
        raise InputError(f"{bundle.name!r} holds a {str(bundle.manifest.get('kind'))[:40]!r}, not a flow")
    given = bundle.fact("sizes", dict)
    if set(given) != {f.name for f in fields(FlowSizes)}:
        raise InputError(f"{bundle.name!r} does not tell the sizes of a flow", "is it of another version?")
    sizes = FlowSizes(**given)
    pose, audio, fps = bundle.fact("pose", str), bundle.fact("audio", str), float(bundle.fact("fps", (int, float)))
    smooth = bundle.fact("smooth", int)
    known = pose in POSES and audio in REDUCTIONS
    if not known or find_pose(pose).dimensions != sizes.pose or audio_width(audio) != sizes.audio:
        raise InputError(f"{bundle.name!r} has poses {pose[:40]!r} and audio {audio[:40]!r}", "is it of another version?")
    if not (FRAME_RATES[0] <= fps <= FRAME_RATES[1] and 0 <= smooth <= 8):
        raise InputError(f"{bundle.name!r} has {fps} frames per second, smoothed over {smooth}", "is it damaged?")
    arrays = bundle.arrays("statistics.safetensors")
    if set(arrays) != {f.name for f in fields(Statistics)}:
        raise InputError(f"{bundle.name!r} has other statistics than a flow", "is it of another version?")
    statistics = Statistics(**arrays)
    _check_statistics(statistics, sizes)
    weights = bundle.arrays("weights.safetensors")
    check_weights(weights, sizes)
    graphs = {name.removesuffix(".onnx"): data for name, data in bundle.members.items() if name.endswith(".onnx")}
    margin = MARGIN * (statistics.pose_high - statistics.pose_low) + 1e-3
    engine = FlowEngine(sizes, weights, graphs, statistics.pose_low - margin, statistics.pose_high + margin)
    card = bundle.members.get("card.md", b"").decode("utf-8", "replace")
    return FlowSystem(engine, statistics, pose, fps, audio, smooth, card)


def _check_statistics(statistics: Statistics, sizes: FlowSizes) -> None:
    for field in fields(Statistics):
        value = getattr(statistics, field.name)
        if field.name == "histories":
            shape: tuple[int, ...] = (max(1, len(value)) if value.ndim else 1, sizes.history, sizes.pose)
        else:
            shape = (sizes.pose if field.name.startswith("pose") else sizes.audio,)
        if value.shape != shape or value.dtype != np.float32:
            raise InputError(f"statistics {field.name!r} of {value.dtype} {value.shape}", f"float32 {shape}")
        if not np.abs(value).max(initial=0) < _FARTHEST:  # not a number fails this too
            raise InputError(f"statistics {field.name!r} hold numbers that are not finite or absurd")
    if min(statistics.pose_std.min(), statistics.audio_std.min()) <= 0:
        raise InputError("statistics with a deviation that is not positive")
    if (statistics.pose_low > statistics.pose_high).any() or (statistics.audio_low > statistics.audio_high).any():
        raise InputError("statistics with a range whose ends are exchanged")


_FARTHEST = 1e6  # ours: no pose, no feature comes near
