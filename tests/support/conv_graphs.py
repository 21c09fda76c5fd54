"""Small graphs of convolutions over time, written by hand for tests of what plays them; needs the package onnx, not torch.

Every signal is a picture (N, channels, bands, T): onnxruntime has its fastest convolutions for pictures, with time along their
rows. A signal knows how far into the speech it hears, so that the whole network's reach falls out of its layers.

Measured on one core with AVX-512, three grouped convolutions of 8 × 256 channels over 160 frames (median of 15): as pictures
9.7 ms, each group by itself 9.7 ms, as signals (N, channels, T) 12.1 ms, as products of shifted copies 15.4 ms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cospeech.motion.rotations import Array
from cospeech.runtime.graph_builder import GraphBuilder

__all__ = ["ConvGraph", "Signal"]


@dataclass(frozen=True, eq=False)
class Signal:
    """A value of a graph: (N, channels, bands, T / step)."""

    name: str
    channels: int
    bands: int
    step: int
    """Frames from one position to the next."""
    low: Array
    """(period / step,) position i hears the frames from i · step + low[i mod (period / step)] …"""
    high: Array
    """… to i · step + high[…]: which they are repeats with the network's coarsest grid."""

    @property
    def reach(self) -> float:
        """Frames to either side beyond which nothing matters; infinite where something was normalised over all of them."""
        return max(-self.low.min(), self.high.max(), 0.0)

    def heard(self, positions: Array, step: int) -> tuple[Array, Array]:
        """What new positions hear that are made of some of this signal.

        Args:
            positions: (n, k) which ones, for each of the first n new positions.
            step: of the new ones.

        Returns:
            ``low`` and ``high``.
        """
        frames, phase, own = positions * self.step, positions % len(self.low), step * np.arange(len(positions))
        return (frames + self.low[phase]).min(1) - own, (frames + self.high[phase]).max(1) - own


class ConvGraph(GraphBuilder):
    """Layers, their weights gathered in ``weights`` under ``prefix``; nothing here depends on how many frames there are.

    Args:
        weights: where those of this graph are put.
        prefix: of their names.
        period: frames after which what is heard repeats: what the number of frames is a multiple of.
    """

    def __init__(self, weights: dict[str, Array], prefix: str, period: int) -> None:
        super().__init__(weights)
        self._store, self._prefix, self._period = weights, prefix, period

    # ends -----------------------------------------------------------------------------------------------------------

    def rows(self, name: str, channels: int) -> Signal:
        """An input (N, T, channels) as a signal of so many channels."""
        turned = self.node("Transpose", name, perm=[0, 2, 1])
        return Signal(self._shaped(turned, 0, channels, 1, -1), channels, 1, 1, *np.zeros((2, self._period)))

    def as_rows(self, x: Signal, name: str) -> None:
        """A signal of one band → the output (N, T, channels)."""
        flat = self._shaped(x.name, 0, x.channels, -1)
        self.node("Transpose", flat, outputs=(name,), perm=[0, 2, 1])

    def made(self, inputs: Mapping[str, tuple[Any, ...]], outputs: Mapping[str, tuple[Any, ...]]) -> bytes:
        """The file."""
        return self.file("window", inputs, outputs)

    # layers ---------------------------------------------------------------------------------------------------------

    def held(self, value: Array) -> str:
        """A weight of its own."""
        name = f"{self._prefix}.{sum(key.startswith(f'{self._prefix}.') for key in self._store)}"
        self._store[name] = np.ascontiguousarray(value, np.float32)
        return self.weight(name)

    def conv(
        self,
        x: Signal,
        weight: Array,
        bias: Array | None,
        *,
        stride: tuple[int, int] = (1, 1),
        pads: tuple[int, int, int, int] = (0, 0, 0, 0),
        groups: int = 1,
        dilation: int = 1,
    ) -> Signal:
        """A convolution.

        Args:
            x: what is convolved.
            weight: (outputs, inputs / groups, kernel over bands, kernel over frames).
            bias: (outputs,).
            stride: over bands and frames.
            pads: zeros before the first band and the first frame, after the last band and the last frame.
            groups: of channels.
            dilation: positions from one tap over frames to the next.
        """
        given = [self.held(weight)] + ([] if bias is None else [self.held(bias)])
        name = self.node("Conv", x.name, *given, strides=list(stride), pads=list(pads), group=groups,
                         dilations=[1, dilation])  # fmt: skip
        high_kernel, wide_kernel = weight.shape[2:]
        bands = (x.bands + pads[0] + pads[2] - high_kernel) // stride[0] + 1
        step = x.step * stride[1]
        first = np.arange(max(1, self._period // step)) * stride[1] - pads[1]
        return Signal(name, len(weight), bands, step, *x.heard(first[:, None] + dilation * np.arange(wide_kernel), step))

    def leaky(self, x: Signal, slope: float) -> Signal:
        """Leaky ReLU; with slope 0 the plain one."""
        name = self.node("LeakyRelu", x.name, alpha=slope) if slope else self.node("Relu", x.name)
        return replace(x, name=name)

    def add(self, x: Signal, y: Signal) -> Signal:
        """The sum of two signals of one rate; one of them may be the same for all takes."""
        return replace(x, name=self.node("Add", x.name, y.name), low=np.minimum(x.low, y.low), high=np.maximum(x.high, y.high))

    def mixed(self, x: Signal, priors: Signal) -> Signal:
        """M mixed as they weigh: channels (M · D), priors of M channels → D channels."""
        modes, width = priors.channels, x.channels // priors.channels
        each = self.node("Mul", self._shaped(x.name, 0, modes, width, -1), priors.name)
        total, *others = self.split(each, *(1,) * modes)
        for other in others:  # one by one: a reduction rounds otherwise for one take than for several
            total = self.node("Add", total, other)
        name = self._shaped(total, 0, width, 1, -1)
        return replace(x, name=name, channels=width, low=np.minimum(x.low, priors.low), high=np.maximum(x.high, priors.high))

    def doubled(self, x: Signal) -> Signal:
        """Every position twice (nearest)."""
        name = self.node("Resize", x.name, "", self.const([1, 1, 1, 2]), mode="nearest", nearest_mode="floor",
                         coordinate_transformation_mode="asymmetric")  # fmt: skip
        low, high = x.heard(np.arange(2 * len(x.low))[:, None] // 2, x.step // 2)
        return replace(x, name=name, step=x.step // 2, low=low, high=high)

    def over_frames(self, x: Signal) -> str:
        """The mean of every channel: (N, channels)."""
        mean = self.node("ReduceMean", x.name, self.const([2, 3], np.int64), keepdims=0)
        return str(mean)

    def softmax(self, x: Signal) -> Signal:
        """Over the channels."""
        return replace(x, name=self.node("Softmax", x.name, axis=1))

    def _shaped(self, name: str, *shape: int) -> str:
        return str(self.node("Reshape", name, self.const(shape, np.int64)))
