"""How a system is played: the decoder that its networks' signatures ask for.

an autoregressive flow with its history        `AutoregressiveDecoder`
frames with a state                            `CausalStreamDecoder`
windows that fix their new frames (``hop``)    `OverlapAddDecoder`
windows whose motion is drawn                  `SampledWindowDecoder`
windows of another kind                        `SlidingWindowDecoder`
a mouth, which the face's session plays        `RestingDecoder`
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, inf, isinf
from typing import Any

from ..errors import InputError
from ..motion.poses import find_pose
from ..motion.rotations import Array
from ..rules.options import LAYERS, GenerationOptions
from .autoregressive_decoder import AutoregressiveDecoder, Source
from .causal_stream_decoder import CausalStreamDecoder
from .conditioning import Conditioning, check_conditioning, poses_before
from .decoder import Decoder
from .flow.engine import FlowEngine
from .flow.latent_sources import Transfer, best_transfer
from .mouth import POSE
from .network import Network
from .network_decoder import RestingDecoder
from .sliding_window_decoder import OverlapAddDecoder, SampledWindowDecoder, SlidingWindowDecoder, looking, sections
from .speaker_emotion_tracker import SpeakerEmotionTracker
from .styles.embedding import StyleMixture
from .styles.space import StyleSpace
from .styles.track import SpokenStyleTrack, StyleTrack
from .system import System
from .window_layout import check_look_ahead

__all__ = ["is_mouth", "needs_stance", "options_for_files", "start_decoder"]


def options_for_files(system: System) -> Mapping[str, Any]:
    """Options of a session over a file: windows that hear both ways, where a system has them, since nobody waits; a stance;
    hands that hold still and rest; and strokes on the accents."""
    ahead = {"look_ahead": inf} if {"make", "live"} <= set(system.networks) else {}
    return ahead | dict.fromkeys(LAYERS, system.pose != POSE) | {"stance": needs_stance(system)}


def is_mouth(system: System) -> bool:
    """Whether it makes faces of whole windows, as the mouth of a session of the rules."""
    return system.pose == POSE and "make" in system.networks


def needs_stance(system: System) -> bool:
    """Whether a system moves a body, but its poses do not say how the legs stand."""
    names = find_pose(system.pose).names
    return system.pose != POSE and not any(part in name for name in names for part in ("Leg", "Foot", "knee"))


def start_decoder(
    system: System,
    space: StyleSpace,
    mixture: StyleMixture,
    silence: Array,
    options: GenerationOptions,
    conditioning: Conditioning,
    transfer: Transfer | None = None,
) -> Decoder:
    """A decoder that begins with this style.

    Args:
        system: the bundle, opened.
        space: its styles.
        mixture: the style to begin with.
        silence: (1, A) the row of silence, which is before the speech.
        options: of the session.
        conditioning: what is given beside the speech.
        transfer: how styles become a flow's motion; the best one for it where not given.

    Raises:
        InputError: a look-ahead that is no number of seconds from 0 on, or what is given cannot be.
    """
    if system.flow is not None:
        return _flow(system, system.flow, mixture, silence, options, conditioning, transfer)
    check_look_ahead(options.look_ahead)
    network = _network(system, options.look_ahead)
    check_conditioning(conditioning, network)
    live = network.signature.window is None
    style: StyleTrack | SpokenStyleTrack
    if system.has_emotions:
        silent_row = silence[0, : len(system.statistics.audio_mean)]
        tracker = SpeakerEmotionTracker(
            system.networks.get("classify"), len(system.speakers), system.fps, silent_row, options.track
        )
        style = SpokenStyleTrack(system, space, mixture, tracker, live=live)
    else:
        style = StyleTrack(system, space, mixture, options.seeds, live=live, temperature=options.temperature)
    common = system, network, style, options.seeds, silence
    scales: Any = {"temperature": options.temperature, "intensity": options.intensity}
    if is_mouth(system):
        return RestingDecoder(*common, **scales)
    if live:
        return CausalStreamDecoder(*common, ahead=_frames(options.look_ahead, system), **scales)
    if system.draws:
        return SampledWindowDecoder(*common, **scales)
    if network.signature.hop is None:
        return SlidingWindowDecoder(*common, looking(network.signature, system.fps, options.look_ahead), **scales)
    before = None if conditioning.before is None else poses_before(system, conditioning.before, network.signature.seeds)
    return OverlapAddDecoder(*common, sections(network.signature), face=conditioning.face, before=before, **scales)


def _network(system: System, seconds: float | None) -> Network:
    """The network that plays: that of frames where there is one, unless the windows of the other fit into the look-ahead."""
    make, live = system.networks.get("make"), system.networks.get("live")
    if live is None or (make is not None and seconds is not None and seconds * system.fps >= _waits(make)):
        return system.main_network
    return live


def _waits(network: Network) -> int:
    """Frames of speech, from its own on, that a frame of a network of windows waits for, at least."""
    signature = network.signature
    return signature.look_ahead if signature.hop is None else sections(signature).waits


def _flow(
    system: System, flow: FlowEngine, mixture: StyleMixture, silence: Array, options: GenerationOptions,
    conditioning: Conditioning, transfer: Transfer | None,
) -> AutoregressiveDecoder:  # fmt: skip
    if conditioning.anything:
        what = "a face" if conditioning.face is not None else "motion to continue from"
        raise InputError(f"this model does not take {what}", "chain-of-generation, trained with it, does: docs/runtime.md")
    check_look_ahead(options.look_ahead)
    transfer = transfer or best_transfer(system)

    def sources(mixture: StyleMixture) -> list[Source]:
        return [transfer(system, mixture, seed=seed, temperature=options.temperature) for seed in options.seeds]

    ahead = _frames(options.look_ahead, system)
    return AutoregressiveDecoder(system, flow, sources, mixture, silence, intensity=options.intensity, ahead=ahead)


def _frames(seconds: float | None, system: System) -> int | None:
    """A look-ahead in whole frames of the network; None: all that it hears."""
    return None if seconds is None or isinf(seconds) else ceil(seconds * system.fps - 1e-9)
