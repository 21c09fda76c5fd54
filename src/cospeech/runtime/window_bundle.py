"""Networks that make whole windows as bundles: what a training run writes, and an engine with its statistics out of one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .bundle import Bundle
from .manifest import (
    WEIGHTS,
    Normalisation,
    System,
    check_kind,
    check_numbers,
    pose_bounds,
    read_facts,
    read_sizes,
    read_statistics,
    write_system,
)
from .window_engine import WindowEngine, WindowSizes, check_weights

__all__ = ["KIND", "WindowStatistics", "WindowSystem", "halve_weights", "open_window", "unpack_weights", "write_window"]

KIND = "window"
"""What a manifest's ``kind`` says of a bundle of this module."""
_BY_SPEAKER = ("speaker_mean", "model_mean", "style_gain")


@dataclass(frozen=True)
class WindowStatistics(Normalisation):
    """Normalisation, and what stands for each speaker."""

    speaker_mean: Array
    """(S, D) standardised mean pose of each speaker."""
    codes: Array
    """(S, styles) what the network is given for each speaker; of no width where it has no styles."""
    model_mean: Array
    """(S, D) mean of the poses that the network makes in each speaker's style, which the speaker's own takes the place of."""
    style_gain: Array
    """(S, D) by what they are multiplied, so that they deviate from their mean as the speaker's do; positive."""


@dataclass(frozen=True)
class WindowSystem(System):
    """A network of windows ready to perform."""

    engine: WindowEngine
    statistics: WindowStatistics


def halve_weights(weights: Mapping[str, Array]) -> dict[str, Array]:
    """Weights at half the size: float16 but for biases.

    Raises:
        InputError: some are too large for it.
    """
    with np.errstate(over="ignore"):
        small = {name: value.astype(np.float16) if value.ndim > 1 else value for name, value in weights.items()}
    check_weights(unpack_weights(small))
    return small


def unpack_weights(weights: Mapping[str, Array]) -> dict[str, Array]:
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
        weights: of the graphs, float32, or some float16 (`halve_weights`).
        graphs: see `WindowEngine`.
        sizes: of the network.
        statistics: of the training data.
        pose, fps: representation and rate.
        audio: name of the reduction of audio (`cospeech.audio.features.reduce.REDUCTIONS`).
        smooth: see `WindowSystem`.
        facts: for the manifest; ``styles`` are the names of the speakers, ``style`` one of them.
        card: Markdown.

    Raises:
        InputError: these do not fit together.
    """
    _check_statistics(statistics, sizes, len(facts["styles"]))
    WindowEngine(sizes, unpack_weights(weights), graphs, *pose_bounds(statistics))
    known = {**facts, "pose": pose, "fps": fps, "audio": audio, "smooth": smooth}
    write_system(path, KIND, sizes, weights, graphs, statistics, known, card)


def open_window(bundle: Bundle) -> WindowSystem:
    """An engine and all that it needs, out of a bundle.

    Raises:
        InputError: the bundle is of another kind, or its parts do not fit together.
    """
    check_kind(bundle, KIND, "a network of windows")
    sizes = read_sizes(bundle, WindowSizes)
    known = read_facts(bundle, sizes.pose, sizes.audio)
    statistics = read_statistics(bundle, WindowStatistics)
    _check_statistics(statistics, sizes, len(known.styles))
    engine = WindowEngine(sizes, unpack_weights(bundle.arrays(WEIGHTS)), bundle.graphs(), *pose_bounds(statistics))
    return WindowSystem(**vars(known), engine=engine, statistics=statistics)


def _check_statistics(statistics: WindowStatistics, sizes: WindowSizes, speakers: int) -> None:
    shapes = {"codes": (speakers, sizes.styles)} | dict.fromkeys(_BY_SPEAKER, (speakers, sizes.pose))
    check_numbers(statistics, sizes.pose, sizes.audio, shapes)
    if statistics.style_gain.min() <= 0:
        raise InputError("a gain of a style that is not positive", "is the bundle damaged?")
