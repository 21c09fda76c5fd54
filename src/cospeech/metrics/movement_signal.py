"""Functions that all movement statistics use: derivatives, filters, percentiles and spectra at 30 frames per second."""

import numpy as np

from ..motion.rotations import Array
from ._scipy import scipy

__all__ = ["FPS", "REST", "SMOOTH", "low_pass", "norm", "percentiles", "rate", "spectrum"]

FPS = 30.0  # frames per second of every statistic (benchmarks/README.md)
SMOOTH = 6.0  # Hz; rest, strokes and coupling (benchmarks/README.md)
REST = 0.1  # m/s (benchmarks/README.md)


def low_pass(x: Array, cutoff: float, fps: float = FPS) -> Array:
    """``x (T, …)`` below ``cutoff`` Hz, without delay (Butterworth of second order, forwards and backwards)."""
    signal = scipy("signal")
    sos = signal.butter(2, cutoff, fs=fps, output="sos")
    return signal.sosfiltfilt(sos, x, axis=0, padlen=min(len(x) - 1, int(3 * fps / cutoff)))


def rate(x: Array, order: int = 1) -> Array:
    """Central differences of ``x (T, …)`` along time, ``order`` times."""
    for _ in range(order):
        x = np.gradient(x, axis=0) * FPS
    return x


def norm(x: Array) -> Array:
    return np.linalg.norm(x, axis=-1)


def percentiles(name: str, unit: str, x: Array, levels: tuple[int, ...]) -> dict[str, float]:
    return {f"{name} {level} %{unit}": float(np.percentile(x, level)) for level in levels}


def spectrum(x: Array, seconds: float) -> tuple[Array, Array]:
    """Frequencies and power of ``x (T, …)``, summed over all channels (Welch, Hann)."""
    frequency, power = scipy("signal").welch(x, FPS, nperseg=min(len(x), round(seconds * FPS)), axis=0, detrend="constant")
    return frequency, power.reshape(len(frequency), -1).sum(1) + 1e-30
