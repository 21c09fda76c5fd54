"""``cospeech bundle``: what a run has learnt → one file that plays without PyTorch."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import torch

from .checkpoint import load_run, read_facts, read_tensors
from .errors import InputError
from .poses.controls import CONTROLS, QUANTILES
from .rotations import Array
from .runtime.flow_bundle import Statistics, write_flow
from .runtime.flow_weights import FlowSizes

__all__ = ["EXAMPLES", "bundle_run"]

EXAMPLES = "examples.safetensors"
"""Of a run folder: what `cospeech.corpora.examples.examples_of` took from the store."""


def bundle_run(
    run: str | PathLike[str],
    path: str | PathLike[str],
    *,
    which: str = "best",
    int8: bool = True,
    smooth: int = 1,
    card: str = "",
) -> None:
    """Make a bundle of a run.

    Args:
        run: folder made by `cospeech.train.train`.
        path: file to write, ``NAME.cospeech``.
        which: "best" or "last" parameters.
        int8: quantise the large products.
        smooth: frames to either side over which poses are averaged (binomial weights).
        card: Markdown; what is known of the run, where not given.

    Raises:
        InputError: not a run, or of a system that has no bundles.
    """
    target = Path(path)
    if target.suffix != ".cospeech":
        raise InputError(f"a bundle called {str(target)!r}", "its name ends in .cospeech")
    folder = Path(run)
    facts = read_facts(folder)
    model: Any = load_run(folder, which)[0]
    if not hasattr(model, "export"):
        raise InputError(f"the run {str(folder)!r} is of {facts['model']!r}, which plays no motion", "bundles are of systems")
    statistics, _ = read_tensors(folder / "statistics.safetensors")
    examples, _ = read_tensors(folder / EXAMPLES)
    sizes = FlowSizes(**model.runtime_sizes(), int8=int8)
    audio = facts["recipe"]["data"].get("audio")
    if audio is None:
        raise InputError(f"the run {str(folder)!r} heard all audio columns", "bundles need data.audio in the recipe")
    store = facts["store"]
    known = {
        "model": facts["model"], "config": facts["config"], "corpus": store["corpus"], "train_seconds": store["train_seconds"],
        "styles": list(store["speakers"]), "style": store["speakers"][0], "controls": _controls(model),
    }  # fmt: skip
    write_flow(
        target, model.export(), sizes, _statistics(model, statistics, examples), pose=store["pose"], fps=float(store["fps"]),
        audio=audio, smooth=smooth, facts=known, card=card or _card(facts),
    )  # fmt: skip


def _statistics(model: Any, statistics: dict[str, torch.Tensor], examples: dict[str, torch.Tensor]) -> Statistics:
    """What the runtime has to know, with a style code and beginnings for each speaker."""
    stretches = examples["stretches"]
    speakers, count = stretches.shape[:2]
    history: int = model.config.history
    if history > stretches.shape[2]:
        raise InputError(f"a history of {history} frames", f"at most {stretches.shape[2]} for a bundle")
    with torch.no_grad():
        codes = model.style(stretches.flatten(0, 1)) if hasattr(model, "style") else None
    codes = torch.zeros(speakers * count, 0) if codes is None else codes

    def plain(value: torch.Tensor) -> Array:
        return np.ascontiguousarray(value.numpy(), np.float32)

    return Statistics(
        **{name: plain(statistics[name]) for name in ("pose_mean", "pose_std", "audio_mean", "audio_std")},
        **{name: plain(examples[name]) for name in ("pose_low", "pose_high", "audio_low", "audio_high")},
        histories=plain(stretches[:, :, -history:].flatten(0, 1)),
        styles=plain(codes.view(speakers, count, -1).mean(1)),
        centres=plain(examples["pose_centre"]),
        spreads=plain(examples.get("pose_spread", torch.zeros(speakers, 0))),
        controls=plain(_quantiles(model, statistics)),
    )


def _controls(model: Any) -> list[str]:
    """Names of the style controls that it was trained with."""
    return list(getattr(model.config, "controls", ()))


def _quantiles(model: Any, statistics: dict[str, torch.Tensor]) -> torch.Tensor:
    """(101, C) standardised, of each."""
    if not _controls(model):
        return torch.zeros(QUANTILES, 0)
    quantiles, mean, std = (statistics[f"control_{what}"] for what in ("quantiles", "mean", "std"))
    return ((quantiles - mean) / std)[:, [CONTROLS.index(name) for name in _controls(model)]]


def _card(facts: dict[str, Any]) -> str:
    """The plain facts of a run."""
    store = facts["store"]
    return (
        f"# {facts['model']}\n\nTrained on {store['train_seconds'] / 3600:.2f} h of {store['corpus']} "
        f"({len(store['speakers'])} speakers, {store['pose']}, {store['fps']:g} frames per second).\n"
    )
