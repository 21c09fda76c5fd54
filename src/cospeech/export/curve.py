"""A curve of an animation: keys at times, and the values between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..motion.rotations import Array, quat_normalize, quat_slerp

__all__ = ["Curve"]


class Curve(NamedTuple):
    """A sampler as read: ``times (K,)`` seconds, ``values (K, width)``, and tangents where it is cubic.

    Values of float32 are those of the file, which hours of motion would not fit into memory twice; rotations among them have
    almost unit length. `at` computes in float64.
    """

    times: Array
    values: Array
    interpolation: str
    rotation: bool

    def at(self, times: Array) -> Array:
        """Sample at ``times (T,)`` → (T, width); held before the first and after the last key (glTF appendix C)."""
        keys, values, cubic = self.times, self.values, self.interpolation == "CUBICSPLINE"
        points = values[1::3] if cubic else values
        if len(keys) == 1:
            return np.repeat(self._compute(points), len(times), 0)
        times = np.clip(times, keys[0], keys[-1])
        low = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 2)
        span = keys[low + 1] - keys[low]
        t = (times - keys[low]) / np.where(span > 0, span, 1)
        blur = 1e-6 + 2.4e-7 * np.abs(times) / np.where(span > 0, span, 1)  # keys are float32: a frame is met by its own key
        t = np.where(t < blur, 0.0, np.where(t > 1 - blur, 1.0, t))[:, None]
        a, b = self._compute(points[low]), self._compute(points[low + 1])
        if self.interpolation == "STEP":
            return np.where(t < 1, a, b)
        if cubic:
            out, into = values[2::3][low] * span[:, None], values[0::3][low + 1] * span[:, None]
            h = (2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, -2 * t**3 + 3 * t**2, t**3 - t**2)
            blend = h[0] * a + h[1] * out + h[2] * b + h[3] * into
            return quat_normalize(blend) if self.rotation else blend
        return quat_slerp(a, b, t[:, 0]) if self.rotation else a + (b - a) * t

    def _compute(self, points: Array) -> Array:
        """Values of keys in float64; rotations that were float32 get unit length, unless they are of a cubic curve."""
        is_rough = self.rotation and points.dtype == np.float32 and self.interpolation != "CUBICSPLINE"
        points = points.astype(np.float64, copy=False)
        return quat_normalize(points) if is_rough else points
