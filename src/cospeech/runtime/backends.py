"""Kinds of systems: how each resolves styles, and what decodes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any, Protocol

import numpy as np

from ..errors import InputError
from ..motion.poses.controls import QUANTILES
from ..motion.rotations import Array
from ..rules.options import GenerationOptions
from .autoregressive_decoder import AutoregressiveDecoder, Source
from .causal_stream_decoder import CausalStreamDecoder, OverlapAddDecoder
from .chain_bundle import ChainSystem
from .chain_style import embed_chain_speaker, example_chain, mixture_chain
from .conditioning import NOTHING, OFFLINE, Conditioning, ConditioningFace, poses_before, refuse_conditioning
from .flow_bundle import FlowSystem
from .manifest import System
from .session import Decoder
from .sliding_window_decoder import SlidingWindowDecoder, looking
from .speaker_emotion_tracker import SpeakerEmotionTracker
from .speech_frontend import SpeechFrontend
from .speech_text_frontend import SpeechTextFrontend
from .style import Styles, Transfer, best_transfer
from .style_measures import StyleMixture
from .window_bundle import WindowSystem
from .window_layout import check_look_ahead
from .window_style import embed_window_speaker, example_window, mixture

__all__ = ["Backend", "backend_of"]


class Backend(Protocol):
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
        """See `cospeech.models.Model`."""
        ...

    def mixture(self, blend: StyleMixture) -> dict[str, float] | None:
        """See `cospeech.runtime.session.TrainedSession.style_mixture`."""
        ...

    def listen(self, controls: Array) -> SpeechFrontend | SpeechTextFrontend:
        """Who hears the speech, with (C,) style controls to begin with."""
        ...

    def play(
        self, blend: StyleMixture, silence: Array, options: GenerationOptions, conditioning: Conditioning = NOTHING
    ) -> Decoder:
        """A player that begins with this style; ``silence`` (1, A) is the row of silence, which is before the speech;
        ``conditioning``: what there is beside it."""
        ...


class FlowBackend:
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

    def mixture(self, blend: StyleMixture) -> dict[str, float] | None:
        """None: a flow mixes no speakers."""
        return None

    def listen(self, controls: Array) -> SpeechFrontend:
        """See `Backend`."""
        return SpeechFrontend(self._system, controls)

    def play(
        self, blend: StyleMixture, silence: Array, options: GenerationOptions, conditioning: Conditioning = NOTHING
    ) -> AutoregressiveDecoder:
        """See `Backend`.

        Raises:
            InputError: a look-ahead is given, or a face, or motion to go on from.
        """
        refuse_conditioning(conditioning)
        if options.look_ahead is not None:
            raise InputError("a flow's look-ahead cannot be chosen", "it hears as far ahead as it was trained to")

        def sources(blend: StyleMixture) -> list[Source]:
            return [self._transfer(self._system, blend, seed=seed, temperature=options.temperature) for seed in options.seeds]

        return AutoregressiveDecoder(self._system, sources, blend, silence, intensity=options.intensity)


class WindowBackend:
    """Of networks that are played in windows.

    Args:
        system: the bundle, opened.
    """

    for_files: Mapping[str, Any] = {}

    def __init__(self, system: WindowSystem) -> None:
        self._system = system
        self.styles = Styles(system, embed_window_speaker, example_window)
        self.controls, self.quantiles = (), np.zeros((QUANTILES, 0), np.float32)

    def mixture(self, blend: StyleMixture) -> dict[str, float] | None:
        """Of the speakers' weights, where the network knows styles by them."""
        return mixture(self._system, blend)

    def listen(self, controls: Array) -> SpeechFrontend:
        """See `Backend`."""
        return SpeechFrontend(self._system, controls)

    def play(
        self, blend: StyleMixture, silence: Array, options: GenerationOptions, conditioning: Conditioning = NOTHING
    ) -> SlidingWindowDecoder:
        """See `Backend`.

        Raises:
            InputError: a face is given, or motion to go on from.
        """
        refuse_conditioning(conditioning)
        setting = looking(self._system.engine.sizes, self._system.fps, options.look_ahead)
        return SlidingWindowDecoder(
            self._system, setting, blend, options.seeds, silence, temperature=options.temperature, intensity=options.intensity
        )


class ChainBackend:
    """Of chains.

    Args:
        system: the bundle, opened.
    """

    for_files: Mapping[str, Any] = {"look_ahead": inf}

    def __init__(self, system: ChainSystem) -> None:
        self._system = system
        self.styles = Styles(system, embed_chain_speaker, example_chain)
        self.controls, self.quantiles = (), np.zeros((QUANTILES, 0), np.float32)

    def mixture(self, blend: StyleMixture) -> dict[str, float] | None:
        """See `cospeech.runtime.chain_style.mixture_chain`."""
        return mixture_chain(self._system, blend)

    def listen(self, controls: Array) -> SpeechTextFrontend:
        """See `Backend`."""
        return SpeechTextFrontend(self._system)

    def play(
        self, blend: StyleMixture, silence: Array, options: GenerationOptions, conditioning: Conditioning = NOTHING
    ) -> Decoder:
        """Frame by frame, where the system can be played so and no look-ahead is given; else in windows.

        Raises:
            InputError: no number of seconds from 0 on; or what is given cannot be.
        """
        seconds, engine = options.look_ahead, self._system.engine
        check_look_ahead(seconds)
        tracker = SpeakerEmotionTracker(engine, self._system.fps, silence[0, : engine.sizes.audio], options.track)
        live = engine.lives and (seconds is None or seconds * self._system.fps <= engine.sizes.look_ahead)
        scales = {"temperature": options.temperature, "intensity": options.intensity}
        if live and conditioning.anything:
            raise InputError("a face, or motion to go on from, while speech comes frame by frame", OFFLINE)
        if live:
            return CausalStreamDecoder(self._system, blend, options.seeds, silence, tracker, **scales)
        face, before = self._prepare_conditioning(conditioning)
        return OverlapAddDecoder(self._system, blend, options.seeds, silence, tracker, face=face, before=before, **scales)

    def _prepare_conditioning(self, conditioning: Conditioning) -> tuple[ConditioningFace | None, Array | None]:
        """The face, and (seeds, D) standardised poses, that the network was trained to be given."""
        sizes = self._system.engine.sizes
        hint = "train one with model.face_teacher_forcing and model.seed_dropout (docs/models/chain_of_generation.md)"
        if conditioning.face is not None and not sizes.faces:
            raise InputError("this chain cannot be given a face", hint)
        if conditioning.before is None:
            return conditioning.face, None
        if not sizes.seeds:
            raise InputError("this chain cannot be given motion to go on from", hint)
        return conditioning.face, poses_before(self._system, conditioning.before, sizes.seeds)


_WITHOUT_LATENTS: Mapping[type[System], Callable[[Any], Backend]] = {WindowSystem: WindowBackend, ChainSystem: ChainBackend}


def backend_of(system: System, transfer: Transfer | None = None) -> Backend:
    """Of this kind of system.

    Raises:
        InputError: a way of transfer for a system that plays no latents.
    """
    if isinstance(system, FlowSystem):
        return FlowBackend(system, transfer)
    if transfer is not None:
        raise InputError("a way of transfer for a system without latents", "leave it out")
    return _WITHOUT_LATENTS[type(system)](system)
