"""Networks that make whole windows as bundles: what a training run writes, and an engine with its statistics out of one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from os import PathLike
from typing import Any

import numpy as np

from ..errors import InputError
from ..rotations import Array
from .bundle import Bundle, pack_arrays, write_bundle
from .manifest import STATISTICS, check_numbers, pose_bounds, read_facts, read_sizes, read_statistics
from .window_engine import WindowEngine, WindowSizes, check_weights

__all__ = ["KIND", "WindowStatistics", "WindowSystem", "half", "open_window", "unpacked", "write_window"]

KIND = "window"
"""What a manifest's ``kind`` says of a bundle of this module."""
_WEIGHTS = "weights.safetensors"
_BY_SPEAKER = ("centres", "made", "gains")


@dataclass(frozen=True)
class WindowStatistics:
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
    centres: Array
    """(S, D) standardised mean pose of each speaker."""
    codes: Array
    """(S, styles) what the network is given for each speaker; of no width where it has no styles."""
    made: Array
    """(S, D) mean of the poses that the network makes in each speaker's style, which the speaker's own takes the place of."""
    gains: Array
    """(S, D) by what they are multiplied, so that they deviate from their mean as the speaker's do; positive."""


@dataclass(frozen=True)
class WindowSystem:
    """A bundle ready to perform."""

    engine: WindowEngine
    statistics: WindowStatistics
    pose: str
    fps: float
    audio: str
    smooth: int
    """How many frames to either side poses are averaged over, with binomial weights."""
    styles: tuple[str, ...]
    """Names of the speakers."""
    style: str
    """The one that is played where nobody says."""
    card: str


def half(weights: Mapping[str, Array]) -> dict[str, Array]:
    """Weights at half the size: float16 but for biases.

    Raises:
        InputError: some are too large for it.
    """
    with np.errstate(over="ignore"):
        small = {name: value.astype(np.float16) if value.ndim > 1 else value for name, value in weights.items()}
    check_weights(unpacked(small))
    return small


def unpacked(weights: Mapping[str, Array]) -> dict[str, Array]:
    """Those in float16 as float32; others as they are."""
    return {name: value.astype(np.float32) if value.dtype == np.float16 else value for name, value in weights.items()}


def write_window(
    path: str | PathLike[str],
    weights: Mapping[str, Array],
    graphs: Mapping[str, bytes],
    sizes: WindowSizes,
    statistics: WindowStatistics,
    *,
    pose: str,
    fps: float,
    audio: str,
    smooth: int = 1,
    facts: Mapping[str, Any],
    card: str = "",
) -> None:
    """Write a network as a bundle.

    Args:
        weights: of the graphs, float32, or some float16 (`half`).
        graphs: see `WindowEngine`.
        sizes: of the network.
        statistics: of the training data.
        pose, fps: representation and rate.
        audio: name of the reduction of audio (`cospeech.features.reduce.REDUCTIONS`).
        smooth: see `WindowSystem`.
        facts: for the manifest; ``styles`` are the names of the speakers, ``style`` one of them.
        card: Markdown.

    Raises:
        InputError: these do not fit together.
    """
    _check_statistics(statistics, sizes, len(facts["styles"]))
    WindowEngine(sizes, unpacked(weights), graphs, *pose_bounds(statistics))
    manifest = {**facts, "kind": KIND, "sizes": asdict(sizes), "pose": pose, "fps": fps, "audio": audio, "smooth": smooth}
    members = {
        _WEIGHTS: pack_arrays(weights),
        STATISTICS: pack_arrays({f.name: getattr(statistics, f.name) for f in fields(WindowStatistics)}),
        **{f"{name}.onnx": graph for name, graph in graphs.items()},
        "card.md": card.encode(),
    }
    write_bundle(path, manifest, members)


def open_window(bundle: Bundle) -> WindowSystem:
    """An engine and all that it needs, out of a bundle.

    Raises:
        InputError: the bundle is of another kind, or its parts do not fit together.
    """
    if bundle.manifest.get("kind") != KIND:
        raise InputError(f"{bundle.name!r} holds a {str(bundle.manifest.get('kind'))[:40]!r}, not a network of windows")
    sizes = read_sizes(bundle, WindowSizes)
    known = read_facts(bundle, sizes.pose, sizes.audio)
    statistics = read_statistics(bundle, WindowStatistics)
    _check_statistics(statistics, sizes, len(known.styles))
    weights = unpacked(bundle.arrays(_WEIGHTS))
    graphs = {name.removesuffix(".onnx"): data for name, data in bundle.members.items() if name.endswith(".onnx")}
    engine = WindowEngine(sizes, weights, graphs, *pose_bounds(statistics))
    card = bundle.members.get("card.md", b"").decode("utf-8", "replace")
    return WindowSystem(engine, statistics, **vars(known), card=card)


def _check_statistics(statistics: WindowStatistics, sizes: WindowSizes, speakers: int) -> None:
    shapes: dict[str, tuple[int, ...]] = {
        f.name: (sizes.audio if f.name.startswith("audio") else sizes.pose,) for f in fields(WindowStatistics)
    }
    check_numbers(statistics, shapes | {"codes": (speakers, sizes.styles)} | dict.fromkeys(_BY_SPEAKER, (speakers, sizes.pose)))
    if statistics.gains.min() <= 0:
        raise InputError("a gain of a style that is not positive", "is the bundle damaged?")
