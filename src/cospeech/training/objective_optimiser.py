"""The optimiser of one objective: its parameters, their Adam, the schedule of its rate and the clipping of its gradients."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from ..errors import InputError, nearest
from ..models.nn.objective import Batch, Objective
from ..models.nn.trainable import Trainable
from .recipe import Optimiser
from .schedule import SCHEDULES

__all__ = ["ObjectiveOptimiser", "list_objectives", "with_prefix"]


def with_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names have this prefix, by the rest of their names."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}


def list_objectives(model: Trainable) -> list[tuple[str, Objective]]:
    """Names and objectives that a network declares.

    Raises:
        InputError: it declares something else.
    """
    objectives = model.objectives()
    if isinstance(objectives, Mapping) and objectives and all(isinstance(part, Objective) for part in objectives.values()):
        return [*objectives.items()]
    description = f"{objectives!r}"[:80] if isinstance(objectives, Mapping) else type(objectives).__name__
    hint = 'a dict by name: {"pose": Objective(parameters, loss)} (docs/add_a_model.md)'
    raise InputError(f"objectives() of {type(model).__name__} gives {description}", hint)


class ObjectiveOptimiser:
    """An objective and its optimiser.

    Args:
        name: of the objective.
        objective: what is minimised.
        settings: how it is minimised.

    Raises:
        InputError: there is no such schedule.
    """

    def __init__(self, name: str, objective: Objective, settings: Optimiser) -> None:
        if settings.schedule not in SCHEDULES:
            raise InputError(f"no schedule is called {settings.schedule!r}", nearest(settings.schedule, SCHEDULES))
        self.name, self.objective, self.settings = name, objective, settings
        self.parameters = [p for p in objective.parameters if p.requires_grad]
        self.adam = torch.optim.Adam(self.parameters, settings.lr, settings.betas, settings.eps, settings.weight_decay)

    def active(self, step: int) -> bool:
        """Whether the objective has begun and not ended, even if it is not due in this step."""
        return self.objective.start <= step and (self.objective.stop is None or step < self.objective.stop)

    def terms(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The named terms of its loss.

        Raises:
            InputError: the loss of the model gives something else.
        """
        terms = self.objective.loss(batch, step)
        fits = isinstance(terms, Mapping) and terms and all(isinstance(t, Tensor) and t.numel() == 1 for t in terms.values())
        if not fits:
            description = type(terms).__name__ if not isinstance(terms, Mapping) else f"{terms!r}"[:80]
            hint = 'a dict of terms, each a tensor of one number: {"pose": loss} (docs/add_a_model.md)'
            raise InputError(f"the loss of the objective {self.name!r} gives a {description}", hint)
        return terms

    def gradients(self, total: Tensor) -> list[Tensor]:
        """Gradients of a loss for these parameters alone; a parameter that is not in the loss has none, and is not moved.

        Raises:
            InputError: the loss depends on no parameter.
        """
        if not total.requires_grad:
            raise InputError(f"the loss of the objective {self.name!r} depends on no parameter", "is it detached?")
        for p, gradient in zip(self.parameters, torch.autograd.grad(total, self.parameters, allow_unused=True), strict=True):
            p.grad = gradient
        return [p.grad for p in self.parameters if p.grad is not None]

    def update(self, step: int) -> float:
        """Clip as in the papers, first each number, then the norm of all; move the parameters; return the learning rate."""
        if self.settings.clip_value:
            nn.utils.clip_grad_value_(self.parameters, self.settings.clip_value)
        if self.settings.clip_norm:
            nn.utils.clip_grad_norm_(self.parameters, self.settings.clip_norm)
        rate = SCHEDULES[self.settings.schedule](self.settings, step - self.objective.start)
        for group in self.adam.param_groups:
            group["lr"] = rate
        self.adam.step()
        return rate

    def state(self) -> dict[str, Tensor]:
        """Moments of the optimiser as named tensors."""
        rows = self.adam.state_dict()["state"]
        return {f"adam.{self.name}.{k}.{what}": tensor for k, row in rows.items() for what, tensor in row.items()}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Restore the moments of a checkpoint."""
        rows: dict[int, dict[str, Tensor]] = {}
        for key, tensor in with_prefix(f"adam.{self.name}.", tensors).items():
            number, what = key.split(".")
            rows.setdefault(int(number), {})[what] = tensor
        self.adam.load_state_dict({"state": rows, "param_groups": self.adam.state_dict()["param_groups"]})
