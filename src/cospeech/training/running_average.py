"""The running average of a model's parameters. It is steadier than the last parameters; it is validated and kept."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn

__all__ = ["RunningAverage"]

RAMP = 10  # decay min(d, (1 + n) / (10 + n)) in step n: the first parameters are soon forgotten; as TensorFlow has it


class RunningAverage:
    """θ̄ ← d θ̄ + (1 − d) θ after every step.

    Args:
        model: whose parameters are followed.
        decay: d; 0: there is no average, and no method does anything.
    """

    def __init__(self, model: nn.Module, decay: float) -> None:
        self._model, self._decay = model, decay
        self.values = {name: p.detach().clone() for name, p in model.named_parameters()} if decay else {}

    @torch.no_grad()
    def follow(self, step: int) -> None:
        """Add the parameters of a step to the average; the first step is 0."""
        share = 1 - min(self._decay, (1 + step) / (RAMP + step))
        for name, p in self._model.named_parameters() if self.values else ():
            self.values[name].lerp_(p, share)

    @torch.no_grad()
    def restore(self, values: dict[str, Tensor]) -> None:
        """Restore the average of a checkpoint."""
        for name, value in values.items():
            self.values[name].copy_(value)

    @contextmanager
    def instead(self) -> Iterator[None]:
        """Within it, the model has the average as its parameters; its buffers stay the same."""
        own = {name: p.detach().clone() for name, p in self._model.named_parameters()} if self.values else {}
        self._model.load_state_dict(self.values, strict=False)
        try:
            yield
        finally:
            self._model.load_state_dict(own, strict=False)
