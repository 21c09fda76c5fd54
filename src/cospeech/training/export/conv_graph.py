"""ONNX of convolutional networks over time, whole windows of N takes at a time; needs the package onnx.

Every signal is a picture (N, channels, bands, T): onnxruntime has its fastest convolutions for pictures, with time along their
rows. A signal knows how far into the speech it hears, so that the whole network's reach falls out of its layers.

Measured on one core with AVX-512, three grouped convolutions of 8 × 256 channels over 160 frames (median of 15): as pictures
9.7 ms, each group by itself 9.7 ms, as signals (N, channels, T) 12.1 ms, as products of shifted copies 15.4 ms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from ...motion.rotations import Array
from ...runtime.graph_builder import GraphBuilder

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

    def receptive_field(self, positions: Array, step: int) -> tuple[Array, Array]:
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
        return Signal(self._reshape(turned, 0, channels, 1, -1), channels, 1, 1, *np.zeros((2, self._period)))

    def picture(self, name: str, bands: int) -> Signal:
        """An input (N, T, bands) as a signal of one channel."""
        turned = self.node("Transpose", name, perm=[0, 2, 1])
        return Signal(self._reshape(turned, 0, 1, bands, -1), 1, bands, 1, *np.zeros((2, self._period)))

    def as_rows(self, x: Signal, name: str) -> None:
        """A signal of one band → the output (N, T, channels)."""
        flat = self._reshape(x.name, 0, x.channels, -1)
        self.node("Transpose", flat, outputs=(name,), perm=[0, 2, 1])

    def serialise(self, inputs: Mapping[str, tuple[Any, ...]], outputs: Mapping[str, tuple[Any, ...]]) -> bytes:
        """The file."""
        return self.file("window", inputs, outputs)

    # layers ---------------------------------------------------------------------------------------------------------

    def add_weight(self, value: Array) -> str:
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
        given = [self.add_weight(weight)] + ([] if bias is None else [self.add_weight(bias)])
        name = self.node("Conv", x.name, *given, strides=list(stride), pads=list(pads), group=groups,
                         dilations=[1, dilation])  # fmt: skip
        high_kernel, wide_kernel = weight.shape[2:]
        bands = (x.bands + pads[0] + pads[2] - high_kernel) // stride[0] + 1
        step = x.step * stride[1]
        first = np.arange(max(1, self._period // step)) * stride[1] - pads[1]
        return Signal(
            name, len(weight), bands, step, *x.receptive_field(first[:, None] + dilation * np.arange(wide_kernel), step)
        )

    def leaky(self, x: Signal, slope: float) -> Signal:
        """Leaky ReLU; with slope 0 the plain one."""
        name = self.node("LeakyRelu", x.name, alpha=slope) if slope else self.node("Relu", x.name)
        return replace(x, name=name)

    def add(self, x: Signal, y: Signal) -> Signal:
        """The sum of two signals of one rate; one of them may be the same for all takes."""
        return replace(x, name=self.node("Add", x.name, y.name), low=np.minimum(x.low, y.low), high=np.maximum(x.high, y.high))

    def scale_shift(self, x: Signal, scale: str, shift: str) -> Signal:
        """x · scale + shift, of shapes that go with (N, channels, bands, T)."""
        return replace(x, name=self.node("Add", self.node("Mul", x.name, scale), shift))

    def mix_generators(self, x: Signal, priors: Signal) -> Signal:
        """M mixed as they weigh: channels (M · D), priors of M channels → D channels."""
        modes, width = priors.channels, x.channels // priors.channels
        each = self.node("Mul", self._reshape(x.name, 0, modes, width, -1), priors.name)
        total, *others = self.split(each, *(1,) * modes)
        for other in others:  # one by one: a reduction rounds otherwise for one take than for several
            total = self.node("Add", total, other)
        name = self._reshape(total, 0, width, 1, -1)
        return replace(x, name=name, channels=width, low=np.minimum(x.low, priors.low), high=np.maximum(x.high, priors.high))

    def upsample_nearest(self, x: Signal) -> Signal:
        """Every position twice (nearest)."""
        name = self.node("Resize", x.name, "", self.const([1, 1, 1, 2]), mode="nearest", nearest_mode="floor",
                         coordinate_transformation_mode="asymmetric")  # fmt: skip
        low, high = x.receptive_field(np.arange(2 * len(x.low))[:, None] // 2, x.step // 2)
        return replace(x, name=name, step=x.step // 2, low=low, high=high)

    def upsample_linear(self, x: Signal) -> Signal:
        """Back to one position a frame, linearly, as if positions lay in the middle of their frames."""
        if x.step == 1:
            return x
        name = self.node("Resize", x.name, "", self.const([1, 1, 1, x.step]), mode="linear",
                         coordinate_transformation_mode="half_pixel")  # fmt: skip
        before = np.floor((np.arange(self._period) + 0.5) / x.step - 0.5).astype(int)  # the position before a frame
        low, high = x.receptive_field(np.stack([before, before + 1], 1), 1)
        return replace(x, name=name, step=1, low=low, high=high)

    def bands(self, x: Signal, first: int, last: int) -> Signal:
        """Some bands: from first to last, not included."""
        if (first, last) == (0, x.bands):
            return x
        edges = [self.const([value], np.int64) for value in (first, last, 2)]
        return replace(x, name=self.node("Slice", x.name, *edges), bands=last - first)

    def band_mean(self, x: Signal) -> Signal:
        """The mean of all bands."""
        name = x.name if x.bands == 1 else self.node("ReduceMean", x.name, self.const([2], np.int64), keepdims=1)
        return replace(x, name=name, bands=1)

    def more_bands(self, x: Signal, count: int) -> Signal:
        """Bands of zeros after the last, so that there are ``count``."""
        if x.bands >= count:
            return x
        pads = self.const([0, 0, 0, 0, 0, 0, count - x.bands, 0], np.int64)
        return replace(x, name=self.node("Pad", x.name, pads), bands=count)

    def pad_reflect(self, x: Signal, frames: int) -> Signal:
        """So many positions more at either end, mirrored at the first and at the last."""
        pads = self.const([0, 0, 0, frames, 0, 0, 0, frames], np.int64)
        name = self.node("Pad", x.name, pads, mode="reflect")
        low, high = x.receptive_field(np.arange(len(x.low))[:, None] - frames, x.step)  # but near the ends
        return replace(x, name=name, low=low, high=high)

    def normalise(self, x: Signal, *, together: bool = False) -> Signal:
        """Mean 0 and variance 1 over all frames of each channel, or ``together``, of all channels."""
        channels = 1 if together else x.channels
        flat = self._reshape(x.name, 0, 1, 1, -1) if together else x.name
        ends = self.const(np.ones(channels)), self.const(np.zeros(channels))
        name = self.node("InstanceNormalization", flat, *ends, epsilon=1e-5)
        name = self._reshape(name, 0, x.channels, x.bands, -1) if together else name
        return replace(x, name=name, low=np.full_like(x.low, -inf), high=np.full_like(x.high, inf))

    def over_frames(self, x: Signal) -> str:
        """The mean of every channel: (N, channels)."""
        mean = self.node("ReduceMean", x.name, self.const([2, 3], np.int64), keepdims=0)
        return str(mean)

    def first_frame(self, name: str) -> str:
        """The first row of an input (N, T, channels): (N, channels)."""
        return str(self.node("Gather", name, self.const(0, np.int64), axis=1))

    def full(self, x: str, weight: Array, bias: Array, output: str | None = None) -> str:
        """(N, inputs) · (outputs, inputs)ᵀ + bias, as an output of the graph where it has a name."""
        outputs = 1 if output is None else (output,)
        return str(self.node("Gemm", x, self.add_weight(weight.T), self.add_weight(bias), outputs=outputs))

    def columns(self, x: str, widths: list[int]) -> list[str]:
        """(N, Σ widths) → as many (N, width, 1, 1), to move signals by."""
        return [self._reshape(part, 0, width, 1, 1) for part, width in zip(self.split(x, *widths), widths, strict=True)]

    def softmax(self, x: Signal) -> Signal:
        """Over the channels."""
        return replace(x, name=self.node("Softmax", x.name, axis=1))

    def _reshape(self, name: str, *shape: int) -> str:
        return str(self.node("Reshape", name, self.const(shape, np.int64)))
