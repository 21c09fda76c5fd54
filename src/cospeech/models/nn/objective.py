"""The interface of a model and the training loop: a model says *what* is optimised, the loop does the rest.

A model is a `cospeech.models.nn.trainable.Trainable` with ``objectives()``. In every step the loop takes each objective that is
due, in order, and does zero_grad → loss → backward → average over processes → clip → step for it. That is enough for a flow
(one objective), a GAN (two, each with parameters of its own) and a cascade (two, one after the other: the first stops where the
second starts).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from ...errors import InputError

__all__ = ["Batch", "Objective", "StepRandom"]


class StepRandom:
    """Random numbers of one training step, the same however the global batch is spread over processes.

    Every process draws for the whole global batch and keeps its own rows. The draw depends on seed and step alone, so a run
    that was stopped and resumed draws the same numbers.

    Args:
        seed: of the run.
        step: of the loop.
        rank: which part of the global batch this process has.
        parts: into how many equal parts it is cut.
        device: to which the numbers are moved; they are drawn on the CPU, so that every device has the same.
    """

    def __init__(self, seed: int, step: int, rank: int = 0, parts: int = 1, device: torch.device | str = "cpu") -> None:
        self.rank, self.parts, self.device = rank, parts, torch.device(device)
        self._generator = torch.Generator().manual_seed((seed * 1_000_003 + step) % 2**63)

    def _own(self, draw: Tensor) -> Tensor:
        rows = len(draw) // self.parts
        return draw[self.rank * rows : (self.rank + 1) * rows].to(self.device)

    def normal(self, rows: int, *shape: int) -> Tensor:
        """(rows, *shape) of N(0, 1); ``rows`` is of this process."""
        return self._own(torch.randn(rows * self.parts, *shape, generator=self._generator))

    def uniform(self, rows: int, *shape: int) -> Tensor:
        """(rows, *shape) of [0, 1)."""
        return self._own(torch.rand(rows * self.parts, *shape, generator=self._generator))


@dataclass(frozen=True, eq=False)
class Batch:
    """The input of a loss: standardised windows of a store, and the step's random numbers.

    Args:
        arrays: name → (B, T, …) float, or (B,) whole numbers: ``pose`` (B, T, D), ``audio`` (B, T, A), ``speaker`` (B,) …
        chance: draws of this step.
    """

    arrays: Mapping[str, Tensor]
    chance: StepRandom

    def __getitem__(self, name: str) -> Tensor:
        """An array.

        Raises:
            InputError: the batch does not hold it.
        """
        if name not in self.arrays:
            hint = f"it holds {', '.join(sorted(self.arrays))}; a network names what it needs in `arrays` (docs/add_a_model.md)"
            raise InputError(f"a batch has no {name!r}", hint)
        return self.arrays[name]

    def __len__(self) -> int:
        return len(next(iter(self.arrays.values())))


class Objective(NamedTuple):
    """One thing to be minimised.

    Args:
        parameters: those that its optimiser moves; no other parameter moves in its step.
        loss: (batch, step) → named, weighted terms; the loop sums them, and logs each.
        every: it is due in every so-many-th step from ``start`` on.
        start, stop: first step, and the step before which it ends (None: never).
    """

    parameters: Iterable[nn.Parameter]
    loss: Callable[[Batch, int], dict[str, Tensor]]
    every: int = 1
    start: int = 0
    stop: int | None = None

    def is_active_at(self, step: int) -> bool:
        """Whether a step optimises it."""
        return self.start <= step and (self.stop is None or step < self.stop) and (step - self.start) % self.every == 0
