"""Kinds of systems on stage: how each understands styles, and what plays it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any, Protocol

import numpy as np

from ..errors import InputError
from ..motion.poses.controls import QUANTILES
from ..motion.rotations import Array
from ..rules.options import GenerationOptions
from .autoregressive_decoder import FlowPlayer, Source
from .causal_stream_decoder import LivePlayer, SectionPlayer
from .chain_bundle import ChainSystem
from .chain_style import example_chain, mixture_chain, named_chain
from .conditioning import NOTHING, OFFLINE, Given, GivenFace, nothing_given, poses_before
from .flow_bundle import FlowSystem
from .manifest import System
from .session import Player
from .sliding_window_decoder import WindowPlayer, looking
from .speaker_emotion_tracker import Ear
from .speech_frontend import Listener
from .speech_text_frontend import Reader
from .style import Styles, Transfer, best_transfer
from .style_measures import Blend
from .window_bundle import WindowSystem
from .window_layout import check_look_ahead
from .window_style import example_window, mixture, named_window

__all__ = ["Players", "players_of"]


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

    @property
    def for_files(self) -> Mapping[str, Any]:
        """See `cospeech.models.Gesturer`."""
        ...

    def mixture(self, blend: Blend) -> dict[str, float] | None:
        """See `cospeech.runtime.session.Performance.style_mixture`."""
        ...

    def listen(self, controls: Array) -> Listener | Reader:
        """Who hears the speech, with (C,) style controls to begin with."""
        ...

    def play(self, blend: Blend, quiet: Array, options: GenerationOptions, given: Given = NOTHING) -> Player:
        """A player that begins with this style; ``quiet`` (1, A) is the row of silence, which is before the speech;
        ``given``: what there is beside it."""
        ...


class FlowPlayers:
    """Of flows.

    Args:
        system: the bundle, opened.
        transfer: how styles become motion; the best one for the system where not given.
    """

    for_files: Mapping[str, Any] = {}

    def __init__(self, system: FlowSystem, transfer: Transfer | None = None) -> None:
        self._system, self._transfer = system, transfer or best_transfer(system)
        self.styles = Styles(system)
        self.controls, self.quantiles = system.controls, system.statistics.controls

    def mixture(self, blend: Blend) -> dict[str, float] | None:
        """None: a flow mixes no speakers."""
        return None

    def listen(self, controls: Array) -> Listener:
        """See `Players`."""
        return Listener(self._system, controls)

    def play(self, blend: Blend, quiet: Array, options: GenerationOptions, given: Given = NOTHING) -> FlowPlayer:
        """See `Players`.

        Raises:
            InputError: a look-ahead is given, or a face, or motion to go on from.
        """
        nothing_given(given)
        if options.look_ahead is not None:
            raise InputError("a flow's look-ahead cannot be chosen", "it hears as far ahead as it was trained to")

        def sources(blend: Blend) -> list[Source]:
            return [self._transfer(self._system, blend, seed=seed, temperature=options.temperature) for seed in options.seeds]

        return FlowPlayer(self._system, sources, blend, quiet, intensity=options.intensity)


class WindowPlayers:
    """Of networks that are played in windows.

    Args:
        system: the bundle, opened.
    """

    for_files: Mapping[str, Any] = {}

    def __init__(self, system: WindowSystem) -> None:
        self._system = system
        self.styles = Styles(system, named_window, example_window)
        self.controls, self.quantiles = (), np.zeros((QUANTILES, 0), np.float32)

    def mixture(self, blend: Blend) -> dict[str, float] | None:
        """Of the speakers' weights, where the network knows styles by them."""
        return mixture(self._system, blend)

    def listen(self, controls: Array) -> Listener:
        """See `Players`."""
        return Listener(self._system, controls)

    def play(self, blend: Blend, quiet: Array, options: GenerationOptions, given: Given = NOTHING) -> WindowPlayer:
        """See `Players`.

        Raises:
            InputError: a face is given, or motion to go on from.
        """
        nothing_given(given)
        setting = looking(self._system.engine.sizes, self._system.fps, options.look_ahead)
        return WindowPlayer(
            self._system, setting, blend, options.seeds, quiet, temperature=options.temperature, intensity=options.intensity
        )


class ChainPlayers:
    """Of chains.

    Args:
        system: the bundle, opened.
    """

    for_files: Mapping[str, Any] = {"look_ahead": inf}

    def __init__(self, system: ChainSystem) -> None:
        self._system = system
        self.styles = Styles(system, named_chain, example_chain)
        self.controls, self.quantiles = (), np.zeros((QUANTILES, 0), np.float32)

    def mixture(self, blend: Blend) -> dict[str, float] | None:
        """See `cospeech.runtime.chain_style.mixture_chain`."""
        return mixture_chain(self._system, blend)

    def listen(self, controls: Array) -> Reader:
        """See `Players`."""
        return Reader(self._system)

    def play(self, blend: Blend, quiet: Array, options: GenerationOptions, given: Given = NOTHING) -> Player:
        """Frame by frame, where the system can be played so and no look-ahead is given; else in windows.

        Raises:
            InputError: no number of seconds from 0 on; or what is given cannot be.
        """
        seconds, engine = options.look_ahead, self._system.engine
        check_look_ahead(seconds)
        ear = Ear(engine, self._system.fps, quiet[0, : engine.sizes.audio], options.track)
        live = engine.lives and (seconds is None or seconds * self._system.fps <= engine.sizes.look_ahead)
        scales = {"temperature": options.temperature, "intensity": options.intensity}
        if live and given.anything:
            raise InputError("a face, or motion to go on from, while speech comes frame by frame", OFFLINE)
        if live:
            return LivePlayer(self._system, blend, options.seeds, quiet, ear, **scales)
        face, before = self._given(given)
        return SectionPlayer(self._system, blend, options.seeds, quiet, ear, face=face, before=before, **scales)

    def _given(self, given: Given) -> tuple[GivenFace | None, Array | None]:
        """The face, and (seeds, D) standardised poses, that the network was trained to be given."""
        sizes = self._system.engine.sizes
        hint = "train one with model.faced and model.unseeded (docs/models/chain_of_generation.md)"
        if given.face is not None and not sizes.faces:
            raise InputError("this chain cannot be given a face", hint)
        if given.before is None:
            return given.face, None
        if not sizes.seeds:
            raise InputError("this chain cannot be given motion to go on from", hint)
        return given.face, poses_before(self._system, given.before, sizes.seeds)


_WITHOUT_LATENTS: Mapping[type[System], Callable[[Any], Players]] = {WindowSystem: WindowPlayers, ChainSystem: ChainPlayers}


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
