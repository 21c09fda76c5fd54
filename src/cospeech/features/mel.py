"""Short-time spectra and log-mel bands of 16 kHz speech, 100 frames a second; frame k is centred on k / 100 s.

The mel scale and the area-normalised triangles are those of Slaney's Auditory Toolbox (1998, report 1998-010), as librosa makes
them by default; the periodic Hann window and the zeros around the signal are librosa's as well.

All sums run along a frame, none over frames and none through BLAS: a frame has the same bits whatever is computed beside it, so
that a stream equals the whole, on any number of threads.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["FPS", "HOP", "RATE", "WINDOW", "Bands", "hann", "log_mel", "mel_filters", "power_spectra"]

Floats = NDArray[np.float32]

RATE = 16_000  # Hz
HOP = 160  # samples, 10 ms
WINDOW = 400  # samples, 25 ms; also the length of the transform: bins of 40 Hz
FPS = 100.0  # frames per second
FLOOR = 1e-10  # ours: power below which a band is silent (-100 dB), as in librosa's power_to_db
BATCH = 64  # ours: frames at a time, so that the work stays in the cache


@cache
def hann(length: int) -> NDArray[np.float64]:
    """(length,) periodic Hann window."""
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)


def power_spectra(frames: Floats) -> Floats:
    """(T, 400) samples → (T, 201) power |X|² of the Hann-windowed frames, bins of 40 Hz."""
    spectra = np.fft.rfft(frames * hann(WINDOW))  # in float64: bands 70 dB below the loudest would drown in float32's noise
    return (np.square(spectra.real) + np.square(spectra.imag)).astype(np.float32)


def _mel(hertz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slaney: linear to 1000 Hz (15 mel), then logarithmic, a factor of 6.4 in 27 mel."""
    return np.where(hertz < 1000, hertz * 3 / 200, 15 + np.log(np.maximum(hertz, 1) / 1000) * 27 / np.log(6.4))


def _hertz(mel: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(mel < 15, mel * 200 / 3, 1000 * np.exp((mel - 15) * np.log(6.4) / 27))


@cache
def mel_filters(n_mels: int = 80) -> Floats:
    """(n_mels, 201) weights from power bins to mel bands, 0 … 8000 Hz.

    Raises:
        InputError: n_mels is below 1.
    """
    if n_mels < 1:
        raise InputError(f"{n_mels} mel bands", "at least 1")
    edges = _hertz(np.linspace(0, _mel(np.array(RATE / 2)), n_mels + 2))
    bins = np.arange(WINDOW // 2 + 1) * (RATE / WINDOW)
    rise = (bins - edges[:-2, None]) / (edges[1:-1] - edges[:-2])[:, None]
    fall = (edges[2:, None] - bins) / (edges[2:] - edges[1:-1])[:, None]
    area = 2 / (edges[2:] - edges[:-2])
    return (np.maximum(0, np.minimum(rise, fall)) * area[:, None]).astype(np.float32)


class Bands:
    """Weighted sums of neighbouring power bins: `filters` (M, 201) applied to (T, 201), without a matrix product.

    Each row's non-zero stretch is laid end to end, so that one `reduceat` sums them all.
    """

    def __init__(self, filters: Floats) -> None:
        rows = [np.flatnonzero(row) if row.any() else np.zeros(1, int) for row in filters]
        self.bins = np.concatenate(rows)
        self.weights = np.concatenate([row[at] for row, at in zip(filters, rows, strict=True)])
        self.starts = np.cumsum([0, *(len(at) for at in rows[:-1])])

    def __call__(self, power: Floats) -> Floats:
        return np.add.reduceat(power[:, self.bins] * self.weights, self.starts, axis=1)


@cache
def _mel_bands(n_mels: int) -> Bands:
    return Bands(mel_filters(n_mels))


def log_power(power: Floats) -> Floats:
    """Natural logarithm of a power, not below that of -100 dB."""
    return np.log(np.maximum(power, np.float32(FLOOR)))


def log_mel(samples: Floats, *, n_mels: int = 80) -> Floats:
    """(N,) samples at 16 kHz → (1 + N // 160, n_mels) natural log of mel band powers, at 100 frames a second.

    Equal to the logarithm of librosa's ``feature.melspectrogram(sr=16000, n_fft=400, hop_length=160)``, not below 1e-10.
    """
    bands = _mel_bands(n_mels)
    padded = np.pad(np.asarray(samples, np.float32), WINDOW // 2)
    frames = np.lib.stride_tricks.sliding_window_view(padded, WINDOW)[::HOP]
    out = np.empty((1 + len(samples) // HOP, n_mels), np.float32)
    for at in range(0, len(out), BATCH):
        out[at : at + BATCH] = log_power(bands(power_spectra(frames[at : at + BATCH])))
    return out
