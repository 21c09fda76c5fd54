"""Flows as bundles: what a training run writes, and an engine with its statistics out of one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.poses.controls import CONTROLS, QUANTILES
from ..motion.rotations import Array
from .bundle import Bundle
from .flow_engine import FlowEngine
from .flow_graph import build_graphs
from .flow_weights import FlowSizes, check_weights, pack_weights
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

__all__ = ["KIND", "FlowSystem", "Statistics", "open_flow", "write_flow"]

KIND = "flow"
"""What a manifest's ``kind`` says of a bundle of this module."""


@dataclass(frozen=True)
class Statistics(Normalisation):
    """Normalisation, and what stands for each speaker."""

    histories: Array
    """(P · M, τ, D) standardised stretches of the training data, with which performances begin: M of each speaker."""
    styles: Array
    """(P, style) code of each speaker; of no width where the network has none."""
    speaker_mean: Array
    """(P, D) standardised mean pose of each speaker."""
    style_gain: Array = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    """(P, D) deviation of each speaker's standardised poses, for a network that knows poses by their recording's own mean and
    deviation; of no width for one that does not. With it, ranges and histories are of such poses."""
    model_mean: Array = field(default_factory=lambda: np.zeros(0, np.float32))
    """(D,) of the poses that the network makes by itself, taken off before ``spreads`` are applied; of no width without."""
    model_std: Array = field(default_factory=lambda: np.zeros(0, np.float32))
    """(D,) their deviation."""
    controls: Array = field(default_factory=lambda: np.zeros((QUANTILES, 0), np.float32))
    """(101, C) standardised quantiles 0, 0.01 … 1 of each style control that the network has, over the training data."""


@dataclass(frozen=True)
class FlowSystem(System):
    """A flow ready to perform."""

    engine: FlowEngine
    statistics: Statistics
    controls: tuple[str, ...]
    """Names of the style controls (`cospeech.motion.poses.controls`) that it was trained with: further columns of the
    speech."""


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
        statistics: of the training data.
        pose, fps: representation and rate.
        audio: name of the reduction of audio (`cospeech.audio.features.reduce.REDUCTIONS`).
        smooth: see `FlowSystem`.
        facts: for the manifest; ``styles`` are the names of the speakers, ``style`` one of them,
            ``controls`` the network's style controls, if it has any.
        card: Markdown.

    Raises:
        InputError: these do not fit together.
    """
    weights = pack_weights(arrays, sizes)
    _check_statistics(statistics, sizes, len(facts["styles"]), len(facts.get("controls", ())))
    known = {**facts, "pose": pose, "fps": fps, "audio": audio, "smooth": smooth}
    write_system(path, KIND, sizes, weights, build_graphs(weights, sizes), statistics, known, card)


def open_flow(bundle: Bundle) -> FlowSystem:
    """An engine and all that it needs, out of a bundle.

    Raises:
        InputError: the bundle is of another kind, or its parts do not fit together.
    """
    check_kind(bundle, KIND, "a flow")
    sizes = read_sizes(bundle, FlowSizes)
    controls = bundle.fact("controls", list) if "controls" in bundle.manifest else []
    if any(controls.count(name) > 1 or name not in CONTROLS for name in controls):
        raise InputError(f"{bundle.name!r} has style controls {str(controls)[:60]}", f"of {', '.join(CONTROLS)}, each once")
    known = read_facts(bundle, sizes.pose, sizes.audio - len(controls))
    statistics = read_statistics(bundle, Statistics)
    _check_statistics(statistics, sizes, len(known.styles), len(controls))
    weights = bundle.arrays(WEIGHTS)
    check_weights(weights, sizes)
    engine = FlowEngine(sizes, weights, bundle.graphs(), *pose_bounds(statistics))
    return FlowSystem(**vars(known), engine=engine, statistics=statistics, controls=tuple(controls))


def _check_statistics(statistics: Statistics, sizes: FlowSizes, speakers: int, controls: int) -> None:
    each = max(1, len(np.atleast_1d(statistics.histories)) // max(speakers, 1))
    shapes: dict[str, tuple[int, ...]] = {
        "histories": (speakers * each, sizes.history, sizes.pose), "styles": (speakers, sizes.style),
        "speaker_mean": (speakers, sizes.pose), "controls": (QUANTILES, controls),
        "style_gain": (len(statistics.style_gain), sizes.pose if statistics.style_gain.shape[-1] else 0),
        **dict.fromkeys(("model_mean", "model_std"), (sizes.pose if statistics.style_gain.size else 0,)),
    }  # fmt: skip
    check_numbers(statistics, sizes.pose, sizes.audio - controls, shapes)
    if statistics.style_gain.size and (len(statistics.style_gain) != speakers or statistics.style_gain.min() <= 0):
        raise InputError("spreads of speakers that are not positive, or not one for each")
    if statistics.model_std.size and statistics.model_std.min() <= 0:
        raise InputError("a deviation of the network's own poses that is not positive")
