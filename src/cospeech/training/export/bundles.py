"""``cospeech bundle``: what a run has learnt → one file that plays without PyTorch."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from ...errors import InputError, nearest
from ...runtime.chain_bundle import VOICE
from ..checkpoint import load_run, read_facts, read_tensors, stands_for
from .chain import bundle_chain
from .flow import bundle_flow
from .window import bundle_window

__all__ = ["EXAMPLES", "bundle_run"]

EXAMPLES = "examples.safetensors"
"""Of a run folder: what `cospeech.training.calibration_clips.examples_of` took from the store."""
_WRITERS = {"export": bundle_flow, "words": bundle_chain, "make": bundle_window}
"""What a network offers, and what then makes its bundle."""


def bundle_run(
    run: str | PathLike[str],
    path: str | PathLike[str],
    *,
    which: str = "best",
    small: bool = True,
    smooth: int = 1,
    card: str = "",
    style: str | None = None,
) -> None:
    """Make a bundle of a run.

    Args:
        run: folder made by `cospeech.training.train.train`.
        path: file to write, ``NAME.cospeech``.
        which: "best" or "last" parameters; see `cospeech.training.checkpoint.load_run` for a run that has no best.
        small: keep weights in fewer bits: the large products of flows in 8, all weights of networks by windows in 16.
        smooth: frames to either side over which poses are averaged (binomial weights).
        card: Markdown; what is known of the run, where not given.
        style: name of the speaker whose style is played where nobody says; where not given, the one that is heard in the voice,
            of a network that hears none the first.

    Raises:
        InputError: not a run, or of a system that has no bundles.
    """
    target = Path(path)
    if target.suffix != ".cospeech":
        raise InputError(f"a bundle called {str(target)!r}", "its name ends in .cospeech")
    folder = Path(run)
    facts = read_facts(folder)
    model: Any = load_run(folder, which)[0]
    write = next((writer for offer, writer in _WRITERS.items() if hasattr(model, offer)), None)
    if write is None:
        raise InputError(f"the run {str(folder)!r} is of {facts['model']!r}, which plays no motion", "bundles are of systems")
    statistics, _ = read_tensors(folder / "statistics.safetensors")
    examples, _ = read_tensors(folder / EXAMPLES)
    audio = facts["recipe"]["data"].get("audio")
    if audio is None and "audio" in model.arrays:
        raise InputError(f"the run {str(folder)!r} heard all audio columns", "bundles need data.audio in the recipe")
    if "stretches" not in examples:
        raise InputError(f"{EXAMPLES} of {str(folder)!r} is of another version", "train it anew")
    store = facts["store"]
    if style is not None and style not in store["speakers"]:
        raise InputError(f"no speaker of the run is called {style!r}", nearest(style, store["speakers"]))
    styles = [*store["speakers"], *([VOICE] if hasattr(model, "classify") else [])]
    known = {
        "model": facts["model"], "config": facts["config"], "corpus": store["corpus"], "train_seconds": store["train_seconds"],
        "styles": styles, "style": style or (VOICE if VOICE in styles else styles[0]),
    }  # fmt: skip
    write(
        target, model, statistics, examples, small=small, facts=known, pose=store["pose"], fps=float(store["fps"]),
        audio=audio, smooth=smooth, card=card or _card(facts, early=stands_for(folder, which) != which),
    )  # fmt: skip


def _card(facts: dict[str, Any], *, early: bool) -> str:
    """The plain facts of a run; early: that it stopped before its first validation."""
    store = facts["store"]
    return (
        f"# {facts['model']}\n\nTrained on {store['train_seconds'] / 3600:.2f} h of {store['corpus']} "
        f"({len(store['speakers'])} speakers, {store['pose']}, {store['fps']:g} frames per second).\n"
        + ("\nThe last parameters, not the best: the run stopped before its first validation.\n" if early else "")
    )
