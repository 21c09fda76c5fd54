"""Samplers: how motion is drawn that a network does not make in one go. NumPy runs the loop, networks of the bundle each step.

`CodeSampler`        codes, one after the other, each given those before: by the network ``prior``
`DiffusionSampler`   latents out of noise, in some steps: by the network ``denoise``

Both draw for a window of speech, and hold what is drawn already. What a take draws at a step depends on its seed and on the
step's number alone: pieces of any size give the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np

from ..motion.rotations import Array
from .network import Network

__all__ = ["CodeSampler", "DiffusionSampler", "Sampler", "open_sampler"]

_STREAM = 5  # of random numbers; 1 to 4 are of cospeech.runtime.styles and mode_noise
_BEFORE = 1 << 20  # steps before the speech that can be numbered


class Sampler(Protocol):
    """Draws the latents of a window."""

    def draw_noise(self, seeds: Sequence[int], steps: Array) -> Array:
        """(N, S, ·) random numbers of takes at steps (S,), which are numbered from the first frame of the speech on."""
        ...

    def draw(self, speech: Array, style: Array, noise: Array, prefix: Array | None, temperature: float) -> Array:
        """Latents of a window.

        Args:
            speech: (1, S, F) features of the speech.
            style: (N, S, C).
            noise: (N, S, ·) of `draw_noise`.
            prefix: (N, k, L) latents of its first steps; None: none.
            temperature: how far from the most likely motion takes stray; at 0 they do not.

        Returns:
            (N, S, L).
        """
        ...


def open_sampler(networks: Mapping[str, Network]) -> Sampler:
    """The sampler of the networks of a system that draws its motion."""
    prior = networks.get("prior")
    return CodeSampler(prior) if prior is not None else DiffusionSampler(networks["denoise"])


def _generators(seeds: Sequence[int], steps: Array) -> list[list[np.random.Generator]]:
    return [[np.random.default_rng([seed, _STREAM, int(step) + _BEFORE]) for step in steps] for seed in seeds]


class CodeSampler:
    """Codes of some groups at each step, 1 at the place of the code that is drawn of each group.

    Args:
        network: ``prior``.
    """

    def __init__(self, network: Network) -> None:
        self._network, self._groups = network, network.signature.groups
        self._codes = network.signature.width("codes") // self._groups

    def draw_noise(self, seeds: Sequence[int], steps: Array) -> Array:
        """See `Sampler`: a number of [0, 1) for each code."""
        return np.array([[each.random(self._groups) for each in take] for take in _generators(seeds, steps)], np.float32)

    def draw(self, speech: Array, style: Array, noise: Array, prefix: Array | None, temperature: float) -> Array:
        """See `Sampler`."""
        takes, steps, _ = noise.shape
        state, count = self._network.begin(takes), 0 if prefix is None else prefix.shape[1]
        latents = np.zeros((takes, steps + 1, self._groups, self._codes), np.float32)  # the first: before the first step
        if prefix is not None:
            latents[:, 1 : count + 1] = prefix.reshape(takes, count, self._groups, self._codes)
        for s in range(steps):
            codes = latents[:, s + 1]
            for k in range(1 if s < count else self._groups):
                inputs = {"before": latents[:, s].reshape(takes, -1), "codes": codes.reshape(takes, -1)}
                outputs = self._network.run(heard=speech[:, s], style=style[:, s], **inputs, **state)
                if s >= count:
                    logits = outputs["logits"].reshape(takes, self._groups, -1)[:, k]
                    codes[np.arange(takes), k, _pick(logits, noise[:, s, k], temperature)] = 1
            state = {name: outputs[f"next.{name}"] for name in state}
        return latents[:, 1:].reshape(takes, steps, -1)


def _pick(logits: Array, uniform: Array, temperature: float) -> Array:
    """(N,) of (N, K) logits the code in whose share of the probability a number of [0, 1) lies; the most likely at temperature
    0."""
    if temperature <= 0:
        return np.asarray(logits.argmax(1))
    shares = np.exp((logits - logits.max(1, keepdims=True)).astype(np.float64) / temperature).cumsum(1)
    return np.minimum((shares <= uniform[:, None] * shares[:, -1:]).sum(1), logits.shape[1] - 1)


class DiffusionSampler:
    """Latents out of noise by DDIM; see `cospeech.models.nn.diffusion`.

    Args:
        network: ``denoise``.
    """

    def __init__(self, network: Network) -> None:
        self._network, self._steps = network, network.signature.steps
        self._width, self._levels = network.signature.width("latent"), network.signature.width("level") // 2

    def draw_noise(self, seeds: Sequence[int], steps: Array) -> Array:
        """See `Sampler`: normal numbers."""
        noise = [[each.standard_normal(self._width) for each in take] for take in _generators(seeds, steps)]
        return np.array(noise, np.float32)

    def draw(self, speech: Array, style: Array, noise: Array, prefix: Array | None, temperature: float) -> Array:
        """See `Sampler`; each take by itself: products of matrices round otherwise for one take than for several."""
        parts = [None if prefix is None else prefix[k : k + 1] for k in range(len(noise))]
        noise = np.float32(temperature) * noise
        each = [self._draw_take(speech, style[k : k + 1], noise[k : k + 1], part) for k, part in enumerate(parts)]
        return np.concatenate(each)

    def _draw_take(self, speech: Array, style: Array, noise: Array, prefix: Array | None) -> Array:
        x = noise
        turns = np.pi / 2 * (1 - np.arange(self._steps + 1) / self._steps)
        for now, after in pairwise(turns):
            x = _hold(x, prefix, noise, now)
            multiples = now * np.arange(1, self._levels + 1)
            level = np.concatenate([np.cos(multiples), np.sin(multiples)]).astype(np.float32)
            level = np.broadcast_to(level, (1, x.shape[1], len(level)))
            velocity = self._network.run(heard=speech, style=style, latent=x, level=level)["velocity"]
            x = np.float32(np.cos(now - after)) * x - np.float32(np.sin(now - after)) * velocity
        return _hold(x, prefix, noise, 0.0)


def _hold(x: Array, prefix: Array | None, noise: Array, angle: float) -> Array:
    """Latents whose first steps are the prefix at the level of the noise."""
    if prefix is None:
        return x
    count = prefix.shape[1]
    start = np.float32(np.cos(angle)) * prefix + np.float32(np.sin(angle)) * noise[:, :count]
    return np.concatenate([start, x[:, count:]], 1)
