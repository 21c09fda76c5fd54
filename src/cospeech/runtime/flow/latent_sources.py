"""Where the latents of a flow come from. There are three sources, all with the same arguments:

`CodeSource`     the style code of the example conditions every frame, latents are random; ours (`FlowConfig.style`).
`SegmentSource`  the latents that would have made the example, under mean speech, drive the synthesis: in order for as long as
                 the example lasts (Ye et al. 2022, section 4.5), then in stretches of a second drawn from it (ours).
`NormalSource`   latents are drawn from mean and covariance of the example's (ours).

The latter two also go without the code (``coded=False``), as the paper does. docs/styles.md has how they compare.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array
from ..autoregressive_decoder import Source
from ..styles.embedding import StyleMixture, average_parts, mix
from ..styles.space import SPREAD_FLOOR, FlowSpace
from ..system import System
from .engine import FlowEngine, StudentT

__all__ = ["CodeSource", "NormalSource", "SegmentSource", "Transfer", "best_transfer", "flow_of"]

BLOCK = 1.0  # s; ours: of latents drawn together, about a gesture stroke with its preparation
CHUNK = 64  # frames drawn at once


class Transfer(Protocol):
    """The constructor that the three sources share."""

    def __call__(self, system: System, blend: StyleMixture, *, seed: int, temperature: float = 1.0) -> Source: ...


class CodeSource:
    """The style by its code; latents as the network was trained to.

    Args:
        system: the bundle, opened.
        blend: the style.
        seed: of the take.
        temperature: scale of the latents.
    """

    def __init__(self, system: System, blend: StyleMixture, *, seed: int, temperature: float = 1.0) -> None:
        rng, sizes, s = np.random.default_rng([seed, 1]), flow_of(system).sizes, system.statistics
        beginnings = [(share, style.beginnings[rng.integers(len(style.beginnings))]) for share, style in blend]
        self.history: Array = average_parts(beginnings)
        embedding = mix(blend)
        self.style, self.speaker_mean, self.style_gain = embedding.code, embedding.speaker_mean, embedding.speaker_std
        self.model_mean: Array | None = None
        if self.style_gain is not None:  # random latents: what the network makes of them by itself is known
            self.model_mean, self.style_gain = s.free_mean, self.style_gain / s.free_std
        self._latents = StudentT(sizes.pose, sizes.nu, seed=seed, temperature=temperature * sizes.latent_scale)

    def draw(self, frames: int) -> Array:
        """See `Source`."""
        return self._latents.draw(frames)


class _ExampleSource(CodeSource):
    """What both kinds of latents from examples need.

    Args:
        system, blend, seed, temperature: as of `CodeSource`; the temperature scales how far latents are from their mean.
        coded: whether the example's code, mean pose and deviation are taken too; else those of the default style.
    """

    def __init__(self, system: System, blend: StyleMixture, *, seed: int, temperature: float = 1.0, coded: bool = True) -> None:
        super().__init__(system, blend, seed=seed, temperature=temperature)
        space = FlowSpace(system, flow_of(system))
        embedding = mix(blend) if coded else space.by_name(system.style)
        self.style, self.speaker_mean, self.style_gain = embedding.code, embedding.speaker_mean, embedding.speaker_std
        if self.style_gain is not None:  # its latents make its own poses, as they were standardised
            self.style_gain = np.maximum(self.style_gain, SPREAD_FLOOR)
        self.model_mean = None if self.style_gain is None else np.zeros(system.pose_width, np.float32)
        self._system, self._temperature = system, np.float32(temperature)
        self._buffer = np.zeros((0, system.pose_width), np.float32)
        self._rng = np.random.default_rng([seed, 2])
        self._pieces = [(share, space.latents(style, style.code if coded else self.style)) for share, style in blend]
        self._blocks = self._generate_blocks()

    def _generate_blocks(self) -> Iterator[Array]:
        raise NotImplementedError

    def draw(self, frames: int) -> Array:
        """See `Source`; blocks are drawn whole, so that they do not depend on who asks for how much."""
        while len(self._buffer) < frames:
            self._buffer = np.concatenate([self._buffer, next(self._blocks)])
        out, self._buffer = self._buffer[:frames], self._buffer[frames:]
        return out


class SegmentSource(_ExampleSource):
    """The example's own latents: in order while they last, then blocks of a second, each from anywhere in it.

    Of a mixture every block comes from one of the styles, by their shares; speakers by name give random latents.
    """

    def _generate_blocks(self) -> Iterator[Array]:
        means = [np.mean(np.concatenate(pieces), 0) if pieces else None for _, pieces in self._pieces]
        if len(self._pieces) == 1 and means[0] is not None:
            for piece in self._pieces[0][1]:
                yield self._scale(piece, means[0])
        length = max(1, round(BLOCK * self._system.fps))
        shares = np.array([share for share, _ in self._pieces])
        while True:
            part = int(self._rng.choice(len(shares), p=shares / shares.sum()))
            pieces, mean = self._pieces[part][1], means[part]
            if mean is None:
                yield self._latents.draw(length)
                continue
            sizes = np.array([max(1, len(piece) - length + 1) for piece in pieces])
            place = int(self._rng.integers(sizes.sum()))
            which = int(np.searchsorted(np.cumsum(sizes), place, "right"))
            start = place - int(sizes[:which].sum())
            yield self._scale(pieces[which][start : start + length], mean)

    def _scale(self, latents: Array, mean: Array) -> Array:
        return (mean + self._temperature * (latents - mean)).astype(np.float32)


class NormalSource(_ExampleSource):
    """Latents with mean and covariance of the example's, frame by frame; of a mixture, both are mixed.

    The covariance is drawn towards that of random latents, the more so the shorter the example is.
    """

    def _generate_blocks(self) -> Iterator[Array]:
        sizes = flow_of(self._system).sizes
        spread = sizes.nu / (sizes.nu - 2) if sizes.nu > 2 else 1.0
        mean, covariance = np.zeros(sizes.pose), np.zeros((sizes.pose, sizes.pose))
        for share, pieces in self._pieces:
            own = spread * np.eye(sizes.pose)
            if pieces:
                z = np.concatenate(pieces).astype(np.float64)
                trust = len(z) / (len(z) + sizes.pose)
                own = trust * np.cov(z.T, bias=True) + (1 - trust) * own
                mean += share * z.mean(0)
            covariance += share * own
        mix = np.linalg.cholesky(covariance / spread).T
        while True:
            yield (mean + self._latents.draw(CHUNK) @ mix).astype(np.float32)


def best_transfer(system: System) -> Transfer:
    """The way that measured best (docs/styles.md): by the code, for a system that has codes; else by latents."""
    return CodeSource if flow_of(system).sizes.style else SegmentSource


def flow_of(system: System) -> FlowEngine:
    """The flow of a system.

    Raises:
        InputError: it is none.
    """
    if system.flow is None:
        raise InputError("only a flow has latents to transfer", "leave transfer out for this model")
    return system.flow
