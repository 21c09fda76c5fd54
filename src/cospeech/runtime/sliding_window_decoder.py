"""A network that turns windows of speech into windows of poses, played over speech of any length that comes in pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.curves import smoothstep
from ..motion.rotations import Array
from .bundles.signature import Signature
from .conditioning import ConditioningFace
from .network import Network
from .network_decoder import NetworkDecoder
from .samplers import open_sampler
from .styles.track import SpokenStyleTrack, StyleTrack
from .system import System
from .window_layout import Sliding, WindowLayout, check_look_ahead

__all__ = [
    "LIVE", "OverlapAddDecoder", "SampledWindowDecoder", "SlidingWindowDecoder", "live", "looking", "sections", "whole",
]  # fmt: skip

BLOCK = 256  # ours: frames that are made at once where nobody waits


LIVE = WindowLayout(window=64, hop=4, ahead=8, fade=4)
"""Ours: half a second of foresight at 15 frames a second, about the preparation of a stroke; windows as in training (64 frames,
Ahuja et al. 2020, section 5)."""
NEAR = 16  # frames [ours]: at 60 a second, as faces are, 0.27 s


def live(signature: Signature) -> WindowLayout:
    """`LIVE`, in windows as the network was trained on; a network that hears at most `NEAR` frames ahead gets all of them."""
    near = signature.reach if signature.reach is not None and signature.reach <= NEAR else 0
    setting = replace(LIVE, ahead=max(LIVE.ahead, _up(near, signature.multiple)))
    return replace(setting, window=_up(max(signature.window or 0, setting.waits), signature.multiple))


def whole(signature: Signature) -> WindowLayout:
    """Exact: what one pass over the whole speech makes, with silence around it.

    Windows begin where the network's own steps in time do, and every new frame has all around it that matters to it. There is
    no such thing for a network that normalises over a window: that hears as much before as after, in windows as in training.
    """
    if signature.reach is None:
        usual = live(signature)
        return replace(usual, ahead=max(usual.ahead, (usual.window - usual.hop) // 2))
    reach, block = _up(signature.reach, signature.multiple), _up(BLOCK, signature.multiple)
    return WindowLayout(window=2 * reach + block, hop=block, ahead=reach, fade=0)


def looking(signature: Signature, fps: float, seconds: float | None = None) -> WindowLayout:
    """The setting with this look-ahead: `live` where it is None, `whole` from the network's reach on.

    Raises:
        InputError: no number of seconds from 0 on.
    """
    check_look_ahead(seconds)
    if seconds is None:
        return live(signature)
    usual, most = live(signature), whole(signature)
    if seconds * fps >= (most.ahead if signature.reach is None else signature.reach):
        return most
    ahead = ceil(seconds * fps - 1e-9)  # of windows that wait less than usual, what is not heard is held
    if ahead < usual.ahead:
        hop = max(min(usual.hop, ahead // 2), 1)
        return WindowLayout(usual.window, hop, ahead, min(usual.fade, hop, ahead), usual.waits - hop - ahead)
    longer = signature.reach is not None and ahead > usual.ahead
    window = _up(usual.window + ahead - usual.ahead, signature.multiple) if longer else usual.window
    return WindowLayout(window, usual.hop, ahead, min(usual.fade, ahead))


def _up(frames: int, multiple: int) -> int:
    return -(-frames // multiple) * multiple


def sections(signature: Signature) -> WindowLayout:
    """The windows of a network that fixes its new frames (`Signature.hop`), each faded into the next over half of what it hears
    ahead; ours."""
    hop = signature.hop or 1
    return WindowLayout(signature.probe, hop, signature.look_ahead, min(signature.look_ahead, hop) // 2)


class SlidingWindowDecoder(NetworkDecoder):
    """Takes of one speech on a network of windows.

    Args:
        system, network, style, seeds, silence, temperature, intensity: see `NetworkDecoder`.
        setting: how windows lie.
    """

    def __init__(
        self, system: System, network: Network, style: StyleTrack | SpokenStyleTrack, seeds: Sequence[int], silence: Array,
        setting: WindowLayout, *, temperature: float = 1.0, intensity: float = 1.0,
    ) -> None:  # fmt: skip
        super().__init__(system, network, style, seeds, silence, temperature=temperature, intensity=intensity)
        self.setting = setting
        self._windows = Sliding(setting, silence, self._draw_noise, self._window)

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        return self.setting.waits / self._system.fps

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        self._style.forget(self._windows.frames - self.setting.past)
        self._hear(rows)
        return np.concatenate([self._none(), *self._windows.push(rows)], 1)

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        self._hear(np.repeat(silence, self.setting.window, 0))
        return np.concatenate([self._none(), *self._windows.finish(silence)], 1)

    def _window(self, rows: Array, first: int, noise: Array) -> Array:
        """(N, window, D) where ``first`` is the first new frame."""
        return self._run(self._ports(rows, first, noise))["poses"]

    def _ports(self, rows: Array, first: int, noise: Array) -> dict[str, Array]:
        """What the network is given for a window."""
        at = np.arange(self.setting.window) + (first - self.setting.past)
        codes = self._style.codes(at if self._style.by_frame else np.array([first + self.setting.hop // 2]))
        codes = np.broadcast_to(codes, (self.takes, self.setting.window, codes.shape[2]))
        return {"rows": rows[None], "style": codes, "noise": noise}


class OverlapAddDecoder(SlidingWindowDecoder):
    """Windows that are faded from one to the next, and that may be given a face, and poses to begin with.

    Args:
        args, options: see `SlidingWindowDecoder`.
        face: in the place of the network's own.
        before: (seeds, D) standardised poses, of the frames before the first, with which the first window begins; what is
            missing from the last of them to the first pose that is made is faded out within half a second.

    Raises:
        InputError: windows too short for these.
    """

    def __init__(self, *args: Any, face: ConditioningFace | None = None, before: Array | None = None, **options: Any) -> None:
        super().__init__(*args, **options)
        self._face, self._before = face, before
        self._gap: Array | None = None
        if before is not None and len(before) > self.setting.past:
            raise InputError(
                f"this network's windows of {self.setting.window} frames are too short to continue from motion",
                f"at least {4 * len(before)} frames",
            )

    def denormalise(self, poses: Array, at: Array, amplitude: Array | float = 1.0) -> Array:
        """See `Decoder`; the first call has the first pose."""
        result = super().denormalise(poses, at, amplitude)
        if self._before is None or not len(at):
            return result
        if self._gap is None:
            s = self._system.statistics
            self._gap = self._before[-1] * s.pose_std + s.pose_mean - result[:, :1]
        rest = 1 - (at + 1) / (_JOIN * self._system.fps)  # all of it a frame before the first
        return result + smoothstep(rest).astype(np.float32)[:, None] * self._gap

    def _window(self, rows: Array, first: int, noise: Array) -> Array:
        """See `SlidingWindowDecoder`; the first window begins with the poses before, the others with those of the last window
        where the network feeds them back."""
        ports = self._ports(rows, first, noise)
        if self._face is not None:
            frames = np.arange(self.setting.window) + (first - self.setting.past)
            weights, share = self._face.at(frames / self._system.fps)
            ports["face"] = np.concatenate([weights * (share > 0), share], 1)[None]
        start, signature = 0, self._network.signature
        if first == 0 and self._before is not None:
            start, seeds = self.setting.past - len(self._before), self._seeds()[None]
            ports["seed"] = np.repeat(seeds, self.takes, 0) if signature.feeds_back else seeds
        elif signature.feeds_back and self._windows.last is not None:
            ports["seed"] = self._place_seeds(self._windows.last[:, -signature.seeds :])
        poses = self._run({name: x[:, start:] for name, x in ports.items()})["poses"]
        return np.concatenate([np.repeat(poses[:, :1], start, 1), poses], 1)

    def _seeds(self) -> Array:
        """(window, D + 1) poses before the first as the network would have made them, and a flag."""
        assert self._before is not None
        centre, model_mean, gain = self._style.scales(np.zeros(1, int))
        s = self._system.statistics
        gain = np.maximum(self._intensity * gain, _LEAST_GAIN)
        poses = np.clip((self._before - centre) / gain + model_mean, *s.bounds).reshape(-1, self.width)
        return self._place_seeds(poses[None])[0]

    def _place_seeds(self, poses: Array) -> Array:
        """(N, n, D) poses before the first new frame → (N, window, D + 1), with a flag."""
        takes, count, past = len(poses), poses.shape[1], self.setting.past
        rows = np.zeros((takes, self.setting.window, self.width + 1), np.float32)
        rows[:, past - count : past] = np.concatenate([poses, np.ones((takes, count, 1), np.float32)], 2)
        return rows


class SampledWindowDecoder(SlidingWindowDecoder):
    """Windows whose motion is drawn: each goes on from what the one before has drawn of its past, and is faded into.

    Args:
        system, network, style, seeds, silence, temperature, intensity: see `NetworkDecoder`.
    """

    def __init__(
        self, system: System, network: Network, style: StyleTrack | SpokenStyleTrack, seeds: Sequence[int], silence: Array, *,
        temperature: float = 1.0, intensity: float = 1.0,
    ) -> None:  # fmt: skip
        layout = sections(network.signature)
        super().__init__(system, network, style, seeds, silence, layout, temperature=temperature, intensity=intensity)
        self._seeds, self._sampler = seeds, open_sampler(system.networks)
        self._latents: Array | None = None

    def _window(self, rows: Array, first: int, noise: Array) -> Array:
        """See `SlidingWindowDecoder`."""
        stride, layout, ports = self._network.signature.multiple, self.setting, self._ports(rows, first, noise)
        steps = np.arange(layout.window // stride) + (first - layout.past) // stride
        latent = self._sampler.draw(
            self._system.networks["hear"].run(rows=ports["rows"])["heard"], ports["style"][:, ::stride],
            self._sampler.draw_noise(self._seeds, steps), self._latents, float(self._temperature),
        )  # fmt: skip
        self._latents = latent[:, layout.hop // stride : (layout.hop + layout.past) // stride]
        return self._run({"latent": latent})["poses"]


_JOIN = 0.5  # s; ours: as styles are faded
_LEAST_GAIN = np.float32(1e-3)  # ours: below, nothing moves that could be gone on from
