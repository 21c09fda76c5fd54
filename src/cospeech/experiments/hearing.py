"""Hearing gain: by how much a trained network explains motion better with the speech that goes with it than with another's.

    gain = loss of held-out windows with the speech of another window − their loss with their own speech

Of a flow the loss is the negative log-likelihood, and the gain is exact, in its unit per frame. Of other networks each term of
the loss has a gain. It needs no sampling. A network that does not hear has a gain of 0. `measure_hearing` takes a run as it is;
`measure_likelihood` gives the log-likelihoods of a flow frame by frame, of windows that the caller chooses (tables do).
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

__all__ = ["HEARD", "FrameLikelihoods", "Hearing", "describe_hearing", "measure_hearing", "measure_likelihood"]

HEARD = ("audio", "text", "waveform")
"""Arrays that are speech: another window's are put in their place. Faces, emotions and speakers stay."""
BATCHES, ROWS = 16, 32  # ours: 512 windows; the error of a gain is then some 5 % of the deviation over batches
EQUAL = 1e-9  # of a term: it has nothing to do with the speech


class Hearing(NamedTuple):
    """A term of the loss, of held-out windows.

    Args:
        term: ``OBJECTIVE.TERM``, or a figure that the network measures itself.
        own, other: with the own speech, and with that of another window.
        gain: other less own.
        half: half of its 95 % interval over batches.
    """

    term: str
    own: float
    other: float
    gain: float
    half: float


class FrameLikelihoods(NamedTuple):
    """(N, F) exact log-likelihoods of frames, in nats, of standardised poses: with the own speech, and with that of another."""

    own: Array
    other: Array


def measure_likelihood(net: Any, arrays: Mapping[str, Array], order: Array) -> FrameLikelihoods:
    """How likely a flow finds recorded windows, each pose after the recorded poses before it.

    Args:
        net: a network with ``log_prob``.
        arrays: name → (N, τ + F + l, …), as the network takes them.
        order: (N,) the window whose speech is put in the place of each one's own.
    """
    from .playing import frame_likelihoods

    taken = {name: arrays[name] for name in net.arrays}
    swapped = _hear_another(taken, [name for name in HEARD if name in taken], order)
    return FrameLikelihoods(frame_likelihoods(net, taken), frame_likelihoods(net, swapped))


def _hear_another(arrays: Mapping[str, Any], heard: Sequence[str], order: Array) -> dict[str, Any]:
    """The same windows, each with the speech of another."""
    return {**arrays} | {name: arrays[name][order] for name in heard}


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
    heard = [name for name in HEARD if name in net.arrays]
    if not heard:
        raise InputError(f"{str(Path(folder).name)!r} takes no speech", f"a network with {' or '.join(HEARD)}")
    opened = Store(store)
    own_speakers = facts["store"]["speakers"]
    if list(opened.speakers) != list(own_speakers):
        theirs, ours = (", ".join(names[:8]) + (" …" if len(names) > 8 else "") for names in (own_speakers, opened.speakers))
        text = f"{Path(folder).name!r} was trained with the speakers {theirs}; this store has {ours}: the figures say little"
        warnings.warn(text, CospeechWarning, stacklevel=2)
    recipe = read_recipe(facts["recipe"])
    recipe = replace(recipe, data=replace(recipe.data, validation=0.0)) if split == "test" else recipe
    feed = open_set(recipe, opened, torch.device("cpu")).feed(net, split, False)
    own, other = [], []
    with torch.no_grad():
        for k in range(batches):
            arrays = {name: torch.from_numpy(array) for name, array in feed.at(rows, 0, k).items()}
            swapped = _hear_another(arrays, heard, np.roll(np.arange(rows), rows // 2))
            own.append(_losses(net, arrays, k))
            other.append(_losses(net, swapped, k))
    return [found for term in own[0] if (found := _gain(term, own, other)) is not None]


def _losses(net: Any, arrays: Mapping[str, Any], step: int) -> dict[str, float]:
    """What a network measures of a batch itself, or all terms of its losses; the same random numbers for the same step."""
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


def describe_hearing(found: Mapping[str, list[Hearing]]) -> str:
    """As text: a line for each run and term."""
    lines = [["run", "loss", "own speech", "another's", "gain", "± 95 %", "share of the loss"]]
    for name, terms in found.items():
        for each in terms:
            share = f"{each.gain / abs(each.own):+.1%}" if each.own else "–"
            figures = [f"{each.own:.4g}", f"{each.other:.4g}", f"{each.gain:+.3g}", f"{each.half:.2g}", share]
            lines.append([name, each.term, *figures])
        if not terms:
            lines.append([name, "no loss depends on the speech", *[""] * 5])
    sizes = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    padded = [
        [cell.ljust(size) if k < 2 else cell.rjust(size) for k, (cell, size) in enumerate(zip(line, sizes, strict=True))]
        for line in lines
    ]
    return "\n".join("  ".join(line).rstrip() for line in padded)
