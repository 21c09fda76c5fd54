"""A run of a network that makes whole windows as a bundle."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from os import PathLike
from typing import Any, TypeVar

import numpy as np
import torch

from ...errors import InputError
from ...models.nn.gumbel import smooth_gumbel
from ...models.nn.objective import StepRandom
from ...motion.rotations import Array
from ...runtime.manifest import Normalisation, pose_bounds
from ...runtime.mode_noise import SECONDS
from ...runtime.window_bundle import WindowStatistics, halve_weights, unpack_weights, write_window
from ...runtime.window_engine import WindowEngine
from .window_graph import Lowered, lower

__all__ = ["bundle_window", "calibration", "relative_error", "statistics_of"]

T = TypeVar("T", bound=Normalisation)

DIGITS = 6  # of the measured error
GAINS = (0.5, 2.0)  # ours: what a network hardly moves is not magnified without end


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
        model: `cospeech.models.nn.windowed.Windowed`.
        statistics, examples: of the run folder.
        small: keep weights in float16; the manifest and the card then say by how much that moves its poses (``rounding``).
        facts: for the manifest.
        card: Markdown.
        options: of `write_window`.

    Raises:
        InputError: it was trained on poses by their recording's own mean and deviation, or is from before runs kept speech.
    """
    if "pose_spread" in examples:
        raise InputError(
            f"a run of {facts['model']!r} on poses per_clip_normalisation", "networks by windows play poses of the whole data"
        )
    if "speech" not in examples:
        raise InputError(f"a run of {facts['model']!r} that is of another version", "train it anew")
    measured = _statistics(model, statistics, examples, SECONDS * options["fps"])
    low = lower(model)
    weights = low.weights
    if small:
        weights = halve_weights(weights)
        facts = facts | {"rounding": _rounding(low, weights, measured, examples)}
        card += f"\nWeights are kept in half precision, which moves its poses by {facts['rounding']:.2%} of their size.\n"
    write_window(path, weights, low.graphs, low.sizes, measured, facts=facts, card=card, **options)


def _statistics(
    model: Any, statistics: dict[str, torch.Tensor], examples: dict[str, torch.Tensor], persistence: float
) -> WindowStatistics:
    """What the runtime has to know, with what stands for each speaker."""
    codes = model.speaker_styles(examples["stretches"])
    centres = examples["pose_centre"]
    made, gains = (
        (centres, torch.ones_like(centres)) if model.literal else _calibrate_network(model, codes, examples, persistence)
    )
    own = {"speaker_mean": centres, "codes": codes, "model_mean": made, "style_gain": gains}
    return statistics_of(WindowStatistics, {**statistics, **examples, **own})


def statistics_of(kind: type[T], found: Mapping[str, torch.Tensor]) -> T:
    """The fields of a kind of statistics, picked out of all that is known."""
    known = {field.name: found[field.name].numpy() for field in fields(kind)}
    return kind(**{name: np.ascontiguousarray(value, np.float32) for name, value in known.items()})


@torch.no_grad()
def _calibrate_network(
    model: Any, codes: torch.Tensor, examples: dict[str, torch.Tensor], persistence: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """(S, D) mean of what a network makes in each style of everybody's speech, in windows as in training, with priors as in a
    performance; and (S, D) the speakers' own deviation within a window, in that of what it makes."""
    speech = examples["speech"].flatten(0, 1)
    frames = min(model.window, speech.shape[1] // model.multiple * model.multiple)
    speech = speech.unfold(1, frames, frames).flatten(0, 1).mT
    noise = torch.zeros(len(speech), frames, 0)
    if model.modes:
        noise = smooth_gumbel(StepRandom(0, 0), len(speech), model.modes, frames, persistence).mT
    made = [model.make(speech, code.expand(len(speech), frames, -1), noise) for code in codes]
    own = examples["stretches"].unfold(2, frames, frames).movedim(-1, -2).flatten(1, 2)
    return calibration(torch.stack(made), own)


def calibration(made: torch.Tensor, own: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """(S, n, T, D) windows that a network makes in each style, (S, m, T, D) the speakers' own → (S, D) mean of the former; and
    (S, D) the deviation within a window of the latter, in that of the former."""
    wanted, moved = (windows.var(2).mean(1).sqrt() for windows in (own, made))
    return made.mean((1, 2)), (wanted / moved.clamp_min(1e-6)).clamp(*GAINS)


def _rounding(low: Lowered, small: dict[str, Array], measured: WindowStatistics, examples: dict[str, torch.Tensor]) -> float:
    """How much weights of half the size move poses of each speaker's speech: √mean square, in that of the poses."""
    s, bounds = low.sizes, pose_bounds(measured)
    engines = [WindowEngine(s, weights, low.graphs, *bounds) for weights in (low.weights, unpack_weights(small))]
    played = []
    for code, speech in zip(measured.codes, examples["speech"].numpy(), strict=True):
        rows = speech.reshape(-1, s.audio)[: s.probe * max(1, speech.shape[0] * speech.shape[1] // s.probe)]
        style, mode_noise = np.broadcast_to(code, (1, len(rows), s.styles)), np.zeros((1, len(rows), s.modes), np.float32)
        played.append([engine.make(rows, style, mode_noise) for engine in engines])
    return relative_error(played)


def relative_error(pairs: Iterable[Sequence[Array]]) -> float:
    """√mean square of how far the second of each pair is from the first, in that of the first."""
    error, size = 0.0, 0.0
    for exact, other in pairs:
        error, size = error + float(np.square(other - exact).sum()), size + float(np.square(exact).sum())
    return round((error / max(size, 1e-12)) ** 0.5, DIGITS)
