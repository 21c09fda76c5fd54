"""What makes one take of a deterministic network differ from another: noise on the choice of its modes, or of its style."""

from __future__ import annotations

from math import erfc, exp, sqrt

import numpy as np

from ..motion.rotations import Array

__all__ = ["SECONDS", "SmoothNoise"]

SECONDS = 1.0  # ours: about a gesture with its preparation; over it noise correlates (the integral of its correlation)
BLOCK = 16  # frames of noise that are made ahead; ours: about a second
LEAST = 1e-300  # ours: of a probability, so that logarithms are numbers


class SmoothNoise:
    """Noise that moves smoothly: at every frame of a standard Gumbel or normal distribution, independent from mode to mode.

    Gumbel noise is for the logits of modes. The mode whose logit with such noise is the largest is drawn with the probability
    that the softmax gives it (Gumbel and Lieblein 1954); a smooth path draws a mode for about a second. The noise is a Gaussian
    process of the correlation (1 + λτ) e^(−λτ), λ = 2 / `SECONDS`, which is differentiable. Both distribution functions bring
    it to the Gumbel distribution. The same seed gives the same noise, in whatever pieces it is drawn.

    Args:
        width: modes.
        fps: frames per second.
        seed: of the take.
        normal: whether the noise is normal, for a network that was trained with such noise.
    """

    def __init__(self, width: int, fps: float, *, seed: int, normal: bool = False) -> None:
        self._normal = normal
        self._rng = np.random.default_rng([seed, 3])  # 1 and 2 are of `cospeech.runtime.styles.style`
        rate, step = 2 / SECONDS, 1 / fps
        decay = exp(-rate * step)
        self._go = decay * np.array([[1 + rate * step, step], [-rate * rate * step, 1 - rate * step]])
        variances = np.diag([1.0, rate * rate])  # variances of the process and of its slope, at any time
        self._stir = np.linalg.cholesky(variances - self._go @ variances @ self._go.T)
        self._state = np.sqrt(np.diag(variances))[:, None] * self._rng.standard_normal((2, width))
        self._waiting = np.zeros((0, width), np.float32)

    def draw(self, frames: int) -> Array:
        """(frames, width) float32."""
        if not self._state.size:
            return np.zeros((frames, 0), np.float32)
        if (missing := frames - len(self._waiting)) > 0:
            self._waiting = np.concatenate([self._waiting, self._block(max(missing, BLOCK))])
        noise, self._waiting = self._waiting[:frames], self._waiting[frames:]
        return noise

    def _block(self, frames: int) -> Array:
        """The next frames at once: many hardly take longer than one."""
        (a, b), (c, d) = self._go.tolist()
        (e, _), (f, g) = self._stir.tolist()
        out = np.empty((frames, self._state.shape[1]))
        (x, v), stirs = self._state, self._rng.standard_normal((frames, *self._state.shape))
        for row, en, fn, gm in zip(out, e * stirs[:, 0], f * stirs[:, 0], g * stirs[:, 1], strict=True):
            row[:] = x
            x, v = a * x + b * v + en, c * x + d * v + fn + gm
        self._state = np.stack([x, v])
        return (out if self._normal else _gumbel(out)).astype(np.float32)


def _gumbel(normal: Array) -> Array:
    """Normal numbers → Gumbel ones of the same rank: −log(−log Φ(x))."""
    above = np.array([erfc(x / sqrt(2)) / 2 for x in normal.ravel()]).reshape(normal.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        wait = np.where(above < 0.5, -np.log1p(-above), -np.log(np.maximum(1 - above, LEAST)))
    return -np.log(np.maximum(wait, LEAST))  # type: ignore[no-any-return]
