"""Kinds of systems on stage: how each understands styles, and what plays it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..errors import InputError
from ..poses.controls import QUANTILES
from ..rotations import Array
from .flow_bundle import FlowSystem
from .flow_player import FlowPlayer, Source
from .manifest import System
from .manner import Blend
from .performance import Player
from .style import Styles, Transfer, best_transfer
from .window_bundle import WindowSystem
from .window_player import WindowPlayer, looking
from .window_style import example_window, mixture, named_window

__all__ = ["Players", "Terms", "players_of"]


@dataclass(frozen=True)
class Terms:
    """What a performance is asked for beside the style; see `cospeech.runtime.gesturer.BundleGesturer.generate`."""

    seeds: Sequence[int]
    """Of the takes."""
    temperature: float
    intensity: float
    look_ahead: float | None


class Players(Protocol):
    """What a gesturer asks of a kind of system."""

    @property
    def styles(self) -> Styles:
        """What a user's words for a style mean to it."""
        ...

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of its style controls."""
        ...

    @property
    def quantiles(self) -> Array:
        """(101, C) of them, standardised."""
        ...

    def mixture(self, blend: Blend) -> dict[str, float] | None:
        """See `cospeech.runtime.performance.Performance.style_mixture`."""
        ...

    def play(self, blend: Blend, quiet: Array, terms: Terms) -> Player:
        """A player that begins with this style; ``quiet`` (1, A) is the row of silence, which is before the speech."""
        ...


class FlowPlayers:
    """Of flows.

    Args:
        system: the bundle, opened.
        transfer: how styles become motion; the best one for the system where not given.
    """

    def __init__(self, system: FlowSystem, transfer: Transfer | None = None) -> None:
        self._system, self._transfer = system, transfer or best_transfer(system)
        self.styles = Styles(system)
        self.controls, self.quantiles = system.controls, system.statistics.controls

    def mixture(self, blend: Blend) -> dict[str, float] | None:
        """None: a flow mixes no speakers."""
        return None

    def play(self, blend: Blend, quiet: Array, terms: Terms) -> FlowPlayer:
        """See `Players`.

        Raises:
            InputError: a look-ahead is given.
        """
        if terms.look_ahead is not None:
            raise InputError("a flow's look-ahead cannot be chosen", "it hears as far ahead as it was trained to")

        def sources(blend: Blend) -> list[Source]:
            return [self._transfer(self._system, blend, seed=seed, temperature=terms.temperature) for seed in terms.seeds]

        return FlowPlayer(self._system, sources, blend, quiet, intensity=terms.intensity)


class WindowPlayers:
    """Of networks that are played in windows.

    Args:
        system: the bundle, opened.
    """

    def __init__(self, system: WindowSystem) -> None:
        self._system = system
        self.styles = Styles(system, named_window, example_window)
        self.controls, self.quantiles = (), np.zeros((QUANTILES, 0), np.float32)

    def mixture(self, blend: Blend) -> dict[str, float] | None:
        """Of the speakers' weights, where the network knows styles by them."""
        return mixture(self._system, blend)

    def play(self, blend: Blend, quiet: Array, terms: Terms) -> WindowPlayer:
        """See `Players`."""
        setting = looking(self._system.engine.sizes, self._system.fps, terms.look_ahead)
        return WindowPlayer(
            self._system, setting, blend, terms.seeds, quiet, temperature=terms.temperature, intensity=terms.intensity
        )


_WITHOUT_LATENTS: Mapping[type[System], Callable[[Any], Players]] = {WindowSystem: WindowPlayers}


def players_of(system: System, transfer: Transfer | None = None) -> Players:
    """Of this kind of system.

    Raises:
        InputError: a way of transfer for a system that plays no latents.
    """
    if isinstance(system, FlowSystem):
        return FlowPlayers(system, transfer)
    if transfer is not None:
        raise InputError("a way of transfer for a system without latents", "leave it out")
    return _WITHOUT_LATENTS[type(system)](system)
