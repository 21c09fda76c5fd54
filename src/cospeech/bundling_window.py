"""A run of a network that makes whole windows as a bundle."""

from __future__ import annotations

from dataclasses import fields
from os import PathLike
from typing import Any

import numpy as np
import torch

from .errors import InputError
from .models.lowering import Lowered, lower
from .rotations import Array
from .runtime.manifest import pose_bounds
from .runtime.window_bundle import WindowStatistics, half, unpacked, write_window
from .runtime.window_engine import WindowEngine

__all__ = ["bundle_window"]

DIGITS = 6  # of the measured error


def bundle_window(
    path: str | PathLike[str],
    model: Any,
    statistics: dict[str, torch.Tensor],
    examples: dict[str, torch.Tensor],
    *,
    small: bool,
    facts: dict[str, Any],
    card: str,
    **options: Any,
) -> None:
    """Write the bundle of a network by windows.

    Args:
        path: file to write.
        model: `cospeech.nn.windowed.Windowed`.
        statistics, examples: of the run folder.
        small: keep weights in float16; the manifest and the card then say by how much that moves its poses (``rounding``).
        facts: for the manifest.
        card: Markdown.
        options: of `write_window`.

    Raises:
        InputError: it was trained on poses by their recording's own mean and deviation, or is from before runs kept speech.
    """
    if "pose_spread" in examples:
        raise InputError(f"a run of {facts['model']!r} on poses by_clip", "networks by windows play poses of the whole data")
    if "speech" not in examples:
        raise InputError(f"a run of {facts['model']!r} that is of another version", "train it anew")
    measured = _statistics(model, statistics, examples)
    low = lower(model)
    weights = low.weights
    if small:
        weights = half(weights)
        facts = facts | {"rounding": _rounding(low, weights, measured, examples)}
        card += f"\nWeights are kept in half precision, which moves its poses by {facts['rounding']:.2%} of their size.\n"
    write_window(path, weights, low.graphs, low.sizes, measured, facts=facts, card=card, **options)


def _statistics(model: Any, statistics: dict[str, torch.Tensor], examples: dict[str, torch.Tensor]) -> WindowStatistics:
    """What the runtime has to know, with what stands for each speaker."""
    own = {"centres": examples["pose_centre"], "codes": model.speaker_styles(examples["stretches"])}
    known = {f.name: {**statistics, **examples, **own}[f.name] for f in fields(WindowStatistics)}
    return WindowStatistics(**{name: np.ascontiguousarray(value.numpy(), np.float32) for name, value in known.items()})


def _rounding(low: Lowered, small: dict[str, Array], measured: WindowStatistics, examples: dict[str, torch.Tensor]) -> float:
    """How much weights of half the size move poses of each speaker's speech: √mean square, in that of the poses."""
    s, bounds = low.sizes, pose_bounds(measured)
    engines = [WindowEngine(s, weights, low.graphs, *bounds) for weights in (low.weights, unpacked(small))]
    error, size = 0.0, 0.0
    for code, speech in zip(measured.codes, examples["speech"].numpy(), strict=True):
        rows = speech.reshape(-1, s.audio)[: s.probe * max(1, speech.shape[0] * speech.shape[1] // s.probe)]
        style, nudge = np.broadcast_to(code, (1, len(rows), s.styles)), np.zeros((1, len(rows), s.modes), np.float32)
        exact, rounded = (engine.make(rows, style, nudge) for engine in engines)
        error, size = error + float(np.square(rounded - exact).sum()), size + float(np.square(exact).sum())
    return round((error / max(size, 1e-12)) ** 0.5, DIGITS)
