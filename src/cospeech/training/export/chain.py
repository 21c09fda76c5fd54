"""A run of a network of many inputs, a Chain of Generation or one like it, as a bundle."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...audio.emotions import EMOTIONS
from ...errors import InputError
from ...models.chain_live import ChainLive
from ...models.nn.gumbel import smooth_gumbel
from ...models.nn.objective import StepRandom
from ...motion.rotations import Array
from ...runtime.chain_bundle import ChainStatistics, write_chain
from ...runtime.chain_engine import ChainEngine
from ...runtime.manifest import pose_bounds
from ...runtime.mode_noise import SECONDS
from ...runtime.window_bundle import halve_weights, unpack_weights
from .chain_graph import LoweredChain, lower_chain
from .window import calibration, relative_error, statistics_of

__all__ = ["bundle_chain"]

PROBE = 64  # frames by which it is measured; ours
APART, STRAYS = 0.7, (1.0, 5.0)
"""How far takes are to lie from each other, in deviations within a window, and by what noise is multiplied for it; ours:
independent performances would lie √2 apart, and beyond five times the noise that it knows a network slows down."""


def bundle_chain(
    path: str | PathLike[str],
    model: Any,
    statistics: dict[str, Tensor],
    examples: dict[str, Tensor],
    *,
    small: bool,
    facts: dict[str, Any],
    card: str,
    **options: Any,
) -> None:
    """Write the bundle of a network of many inputs; of a streaming one with its teacher, which plays whole files.

    Args:
        path: file to write.
        model: `cospeech.models.chain_of_generation.ChainOfGeneration` or `cospeech.models.nn.modalities.ManyInputs`.
        statistics, examples: of the run folder.
        small: keep weights in float16; the manifest and the card then say by how much that moves its poses (``rounding``).
        facts: for the manifest.
        card: Markdown.
        options: of `write_chain`.

    Raises:
        InputError: it lacks attention or style, hears what the runtime cannot work out, is played alone without its teacher, or
            is from before runs kept what was said.
    """
    whole = model
    if isinstance(model, ChainLive):
        if model.teacher is None:
            raise InputError(f"a run of {facts['model']!r} without a teacher", "train it with [needs] teacher = …")
        whole = model.teacher
    if getattr(getattr(whole, "speech_encoder", None), "array", "audio") != "audio":
        raise InputError(
            f"a run of {facts['model']!r} that hears with {whole.config.speech_encoder}", "bundles play without PyTorch"
        )
    if not all(getattr(net.config, part, True) for net in (model, whole) for part in ("attention", "style_injection")):
        raise InputError(
            f"a run of {facts['model']!r} without attention or style", "those are rows of a table; train a whole one"
        )
    if "pose_spread" in examples or not {"speech", "texts"} <= set(examples):
        raise InputError(f"a run of {facts['model']!r} per_clip_normalisation, or of another version", "train it anew")
    measured = _statistics(model, whole, statistics, examples, SECONDS * options["fps"])
    low = lower_chain(model)
    weights = low.weights
    if small:
        weights = halve_weights(weights)
        facts = facts | {"rounding": _rounding(low, weights, measured, examples)}
        card += f"\nWeights are kept in half precision, which moves its poses by {facts['rounding']:.2%} of their size.\n"
    write_chain(path, weights, low.graphs, low.sizes, measured, facts=facts, card=card, **options)


def _statistics(
    model: Any, whole: Any, statistics: dict[str, Tensor], examples: dict[str, Tensor], persistence: float
) -> ChainStatistics:
    """What the runtime has to know, with what stands for each speaker and for words."""
    own: dict[str, Tensor] = {"speaker_mean": examples["pose_centre"], "words": _words(whole)}
    own["model_mean"], own["style_gain"], stray = _calibrate_network(whole, whole, examples, persistence, whole.window)
    own["live_model_mean"], own["live_style_gain"], live_stray = own["model_mean"], own["style_gain"], stray
    if model is not whole:
        own["live_model_mean"], own["live_style_gain"], live_stray = _calibrate_network(
            model, whole, examples, persistence, None
        )
    own["noise_gain"] = torch.tensor([stray, live_stray])
    return statistics_of(ChainStatistics, {**statistics, **examples, **own})


def _words(whole: Any) -> Tensor:
    """(n, W) rows of the table of subwords."""
    table = getattr(whole, "word", None) or whole.embedding
    if not hasattr(table, "table"):
        raise InputError(
            "a run on word vectors of somebody else's", "bundles are of runs that learnt words; leave out data.words"
        )
    rows: Tensor = table.table.weight.detach().clone()
    rows[0] = 0
    return rows


@torch.no_grad()
def _calibrate_network(
    model: Any, whole: Any, examples: dict[str, Tensor], persistence: float, window: int | None
) -> tuple[Tensor, Tensor, float]:
    """(S, D) mean of what a network makes in each style of everybody's speech, in everybody's moods; (S, D) the speakers'
    own deviation within a window, in that of what it makes; and by what noise is multiplied (`_stray`). ``window``: in pieces
    of so many frames; None: as it comes."""
    speakers = whole.styles - len(EMOTIONS)
    speech, texts = (examples[name].flatten(0, 1) for name in ("speech", "texts"))
    emotions = examples["emotions"].flatten(0, 1).long()[..., 0] if "emotions" in examples else torch.zeros_like(texts[..., 0])
    frames = window or speech.shape[1]
    rows = torch.cat([speech, whole.words(texts.long())], -1)
    moods = torch.nn.functional.one_hot(emotions.long().clamp_min(0), len(EMOTIONS)).float()
    rows, moods = (_cut(x, frames) for x in (rows, moods))
    noise = rows.new_zeros(2, len(rows), frames, whole.modes)
    if whole.modes:
        noise = smooth_gumbel(StepRandom(0, 0), 2 * len(rows), whole.modes, frames, persistence).mT.unflatten(0, (2, -1))
    own = _cut(examples["stretches"].flatten(0, 1), frames).unflatten(0, (len(examples["stretches"]), -1))
    styles = [torch.cat([w.expand(len(rows), frames, -1), moods], -1) for w in torch.eye(speakers)]
    stray = _stray(*(model.make(rows, styles[0], each) for each in noise)) if whole.modes else 1.0
    made = [model.make(rows, style, stray * noise[0]) for style in styles]
    return *calibration(torch.stack(made), own), stray


def _stray(take: Tensor, other: Tensor) -> float:
    """By what noise is multiplied so that two takes (n, T, D) lie `APART` as far from each other as one moves; they do so
    nearly in proportion to the noise."""
    apart, moved = (take - other).square().mean().sqrt(), take.var(1).mean().sqrt()
    return float((APART * moved / apart.clamp_min(1e-6)).clamp(*STRAYS))


def _cut(x: Tensor, frames: int) -> Tensor:
    """(n, T, C) → (n · (T // frames), frames, C)."""
    return x.unfold(1, frames, frames).mT.flatten(0, 1)


def _rounding(low: LoweredChain, small: dict[str, Array], measured: ChainStatistics, examples: dict[str, Tensor]) -> float:
    """How much weights of half the size move poses of each speaker's speech: √mean square, in that of the poses."""
    s, bounds = low.sizes, pose_bounds(measured)
    engines = [ChainEngine(s, weights, low.graphs, *bounds) for weights in (low.weights, unpack_weights(small))]
    played = []
    for who, speech in enumerate(examples["speech"].numpy()[:, 0]):
        rows = np.pad(speech[:PROBE], ((0, 0), (0, s.words)))
        style = np.zeros((1, len(rows), s.style), np.float32)
        style[..., [who, s.speakers]] = 1
        noise = np.zeros((1, len(rows), s.noise), np.float32)
        played.append([engine.windows.make(rows, style, noise) for engine in engines])
    return relative_error(played)
