"""Hearing gain: by how much a trained network explains motion better with its own speech than with that of another window.

    gain = loss of held-out windows with the speech of another window − their loss with their own speech

The loss of a flow is the negative log-likelihood: its gain is exact, in the unit of the loss per frame. For other networks,
each term of the loss has a gain. No sampling is needed. A network that does not use the speech has a gain of 0.
`measure_hearing` measures a run. `measure_likelihood` returns the log-likelihoods of a flow frame by frame, for windows that
the caller chooses (tables do).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..corpora.store import Store
from ..errors import CospeechWarning, InputError
from ..metrics._scipy import scipy
from ..motion.rotations import Array

__all__ = ["SPEECH_ARRAYS", "FrameLikelihoods", "Hearing", "describe_hearing", "measure_hearing", "measure_likelihood"]

SPEECH_ARRAYS = ("audio", "text", "waveform")
"""Arrays that are speech: those of another window replace them. Faces, emotions and speakers stay."""
BATCHES, ROWS = 16, 32  # ours: 512 windows; the error of a gain is then some 5 % of the deviation over batches
EQUAL = 1e-9  # of a term: if no loss differs by more, the term does not depend on the speech


class Hearing(NamedTuple):
    """Hearing gain by one term of the loss, on held-out windows.

    Args:
        term: ``OBJECTIVE.TERM``, or a figure that the network measures itself.
        own, other: the loss with the own speech, and with that of another window.
        gain: other − own.
        half: half of its 95 % interval over batches.
    """

    term: str
    own: float
    other: float
    gain: float
    half: float


class FrameLikelihoods(NamedTuple):
    """(N, F) exact log-likelihoods of frames, in nats, of standardised poses: with own speech, and with another window's."""

    own: Array
    other: Array


def measure_likelihood(net: Any, arrays: Mapping[str, Array], order: Array) -> FrameLikelihoods:
    """How likely a flow finds recorded windows, each pose after the recorded poses before it.

    Args:
        net: a network with ``log_prob``.
        arrays: name → (N, τ + F + l, …), as the network takes them.
        order: (N,) number of the window whose speech replaces the own one.
    """
    from .playing import frame_likelihoods

    own = {name: arrays[name] for name in net.arrays}
    mismatch = _hear_another(own, [name for name in SPEECH_ARRAYS if name in own], order)
    return FrameLikelihoods(frame_likelihoods(net, own), frame_likelihoods(net, mismatch))


def _hear_another(arrays: Mapping[str, Any], names: Sequence[str], order: Array) -> dict[str, Any]:
    """The same windows, each with the speech of another."""
    return {**arrays} | {name: arrays[name][order] for name in names}


def measure_hearing(
    folder: str | PathLike[str], store: str | PathLike[str], *, split: str = "test", batches: int = BATCHES, rows: int = ROWS
) -> list[Hearing]:
    """Hearing gain of a run, by each term of its loss that depends on the speech.

    Args:
        folder: of the run.
        store: whose windows are taken.
        split: of the store.
        batches, rows: how many batches of how many windows; the same windows every time.

    Raises:
        InputError: not a run, a store that does not fit, a split without windows, or a network that takes no speech.
    """
    import torch

    from ..training.checkpoint import load_run
    from ..training.dataset import open_set
    from ..training.recipe import read_recipe

    if batches < 2 or rows < 2:
        raise InputError(f"{batches} batches of {rows} windows", "two of each at least")
    net, facts = load_run(folder)
    speech = [name for name in SPEECH_ARRAYS if name in net.arrays]
    if not speech:
        raise InputError(f"{str(Path(folder).name)!r} takes no speech", f"a network with {' or '.join(SPEECH_ARRAYS)}")
    data = Store(store)
    own_speakers = facts["store"]["speakers"]
    if list(data.speakers) != list(own_speakers):
        theirs, ours = (", ".join(names[:8]) + (" …" if len(names) > 8 else "") for names in (own_speakers, data.speakers))
        text = f"{Path(folder).name!r} was trained with the speakers {theirs}; this store has {ours}: the figures say little"
        warnings.warn(text, CospeechWarning, stacklevel=2)
    recipe = read_recipe(facts["recipe"])
    recipe = replace(recipe, data=replace(recipe.data, validation=0.0)) if split == "test" else recipe
    feed = open_set(recipe, data, torch.device("cpu")).feed(net, split, False)
    own, other = [], []
    with torch.no_grad():
        for k in range(batches):
            arrays = {name: torch.from_numpy(array) for name, array in feed.at(rows, 0, k).items()}
            mismatch = _hear_another(arrays, speech, np.roll(np.arange(rows), rows // 2))
            own.append(_losses(net, arrays, k))
            other.append(_losses(net, mismatch, k))
    return [hearing for term in own[0] if (hearing := _gain(term, own, other)) is not None]


def _losses(net: Any, arrays: Mapping[str, Any], step: int) -> dict[str, float]:
    """The network's own measures of a batch, or else all terms of its losses; the same step draws the same random numbers."""
    from ..models.nn.objective import Batch, StepRandom

    batch = Batch(arrays, StepRandom(0, step))
    figures = {name: float(value) for name, value in net.validate(batch).items()}
    if figures:
        return figures
    for name, objective in net.objectives().items():
        terms = objective.loss(batch, objective.start)
        figures |= {f"{name}.{term}": float(value) for term, value in terms.items()}
    return figures


def _gain(term: str, own: list[dict[str, float]], other: list[dict[str, float]]) -> Hearing | None:
    pairs = np.array([(a[term], b[term]) for a, b in zip(own, other, strict=True)])
    gains = pairs[:, 1] - pairs[:, 0]
    if np.abs(gains).max() <= EQUAL * max(1.0, np.abs(pairs).max()):
        return None
    half = float(scipy("stats").t.ppf(0.975, len(gains) - 1) * gains.std(ddof=1) / len(gains) ** 0.5)
    return Hearing(term, float(pairs[:, 0].mean()), float(pairs[:, 1].mean()), float(gains.mean()), half)


def describe_hearing(runs: Mapping[str, list[Hearing]]) -> str:
    """Hearing gains as text: a line for each run and term."""
    lines = [["run", "loss", "own speech", "another's", "gain", "± 95 %", "share of the loss"]]
    for name, terms in runs.items():
        for each in terms:
            share = f"{each.gain / abs(each.own):+.1%}" if each.own else "–"
            figures = [f"{each.own:.4g}", f"{each.other:.4g}", f"{each.gain:+.3g}", f"{each.half:.2g}", share]
            lines.append([name, each.term, *figures])
        if not terms:
            lines.append([name, "no loss depends on the speech", *[""] * 5])
    sizes = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    rows = [
        [cell.ljust(size) if k < 2 else cell.rjust(size) for k, (cell, size) in enumerate(zip(line, sizes, strict=True))]
        for line in lines
    ]
    return "\n".join("  ".join(line).rstrip() for line in rows)
