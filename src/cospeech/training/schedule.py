"""Learning-rate schedules: functions of the settings and the step, in a dict."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

__all__ = ["SCHEDULES", "Rate", "constant", "exponential", "noam"]


class Rate(Protocol):
    """The settings of a schedule; see `cospeech.training.recipe.Optimiser`."""

    @property
    def lr(self) -> float: ...
    @property
    def warmup(self) -> int: ...
    @property
    def floor(self) -> float: ...
    @property
    def gamma(self) -> float: ...
    @property
    def gamma_every(self) -> int: ...


def constant(rate: Rate, step: int) -> float:
    """lr."""
    return rate.lr


def noam(rate: Rate, step: int) -> float:
    """lr √w · min(n w^−1.5, n^−0.5) with n = step + 1: up to lr in w steps, then down with the root, not below the floor.

    Vaswani et al. 2017, section 5.3, scaled so that lr is the peak; the flow paper's section 4 by its authors' code.
    """
    n = step + 1
    value = rate.lr * rate.warmup**0.5 * min(n * rate.warmup**-1.5, n**-0.5)
    return max(value, rate.floor) if n > rate.warmup else value


def exponential(rate: Rate, step: int) -> float:
    """lr · γ^⌊step / gamma_every⌋, not below the floor."""
    return max(rate.lr * rate.gamma ** (step // rate.gamma_every), min(rate.floor, rate.lr))


SCHEDULES: dict[str, Callable[[Rate, int], float]] = {"constant": constant, "noam": noam, "exponential": exponential}
"""Name → (settings, steps done since the objective began) → learning rate."""
