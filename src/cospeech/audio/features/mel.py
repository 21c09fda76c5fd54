"""Short-time spectra and log-mel bands of 16 kHz speech, 100 frames a second; frame k is centred on k / 100 s.

The mel scale and the area-normalised triangles are those of Slaney's Auditory Toolbox (1998, report 1998-010), as librosa makes
them by default; the periodic Hann window and the zeros around the signal are librosa's as well.

All sums run along a frame, none over frames and none through BLAS: a frame has the same bits whatever is computed beside it, so
that a stream equals the whole, on any number of threads.
"""

from __future__ import annotations

from functools import cache
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

__all__ = [
    "FPS", "HOP", "RATE", "WINDOW", "Bands", "hann", "log_mel", "magnitudes", "mel_filters", "mel_triangles", "power_spectra",
    "spectra",
]  # fmt: skip

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
T = TypeVar("T", np.float32, np.float64)

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


def spectra(samples: Doubles, length: int, hop: int, window: int, centred: bool) -> Doubles:
    """(T, 1 + length // 2) magnitudes |X| of Hann-windowed frames, in float64.

    Args:
        samples: (N,).
        length: of the transform; the window stands in its middle.
        hop: samples from frame to frame.
        window: length of the window.
        centred: frame k is centred on sample k × hop, the signal mirrored at its ends; else it starts there.
    """
    samples = np.asarray(samples, float)
    if centred:
        samples = np.pad(samples, length // 2, "reflect" if len(samples) > length // 2 else "constant")
    samples = np.pad(samples, (0, max(length - len(samples), 0)))
    frames = np.lib.stride_tricks.sliding_window_view(samples, length)[::hop]
    return magnitudes(frames, window)


def magnitudes(frames: Floats | Doubles, window: int) -> Doubles:
    """(T, length) samples → (T, 1 + length // 2) |X| in float64, under a Hann window of so many samples in their middle."""
    length = frames.shape[1]
    before = (length - window) // 2
    shape = np.pad(hann(window), (before, length - window - before))
    spectrum = np.fft.rfft(frames * shape)
    return np.sqrt(np.square(spectrum.real) + np.square(spectrum.imag))


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
def mel_triangles(rate: int, length: int, count: int, low: float, high: float, even: bool) -> Doubles:
    """(count, 1 + length // 2) weights on the bins of a transform, for bands between two frequencies in Hz.

    Args:
        rate: samples per second.
        length: of the transform.
        count: how many bands.
        low, high: where the first begins and the last ends.
        even: triangles of equal area, else of height 1.
    """
    edges = _hertz(np.linspace(_mel(np.array(low)), _mel(np.array(high)), count + 2))
    bins = np.arange(length // 2 + 1) * (rate / length)
    rise = (bins - edges[:-2, None]) / (edges[1:-1] - edges[:-2])[:, None]
    fall = (edges[2:, None] - bins) / (edges[2:] - edges[1:-1])[:, None]
    height = 2 / (edges[2:] - edges[:-2]) if even else np.ones(count)
    return np.maximum(0, np.minimum(rise, fall)) * height[:, None]


@cache
def mel_filters(n_mels: int = 80) -> Floats:
    """(n_mels, 201) weights from power bins to mel bands, 0 … 8000 Hz.

    Raises:
        InputError: n_mels is below 1.
    """
    if n_mels < 1:
        raise InputError(f"{n_mels} mel bands", "at least 1")
    return mel_triangles(RATE, WINDOW, n_mels, 0.0, RATE / 2, True).astype(np.float32)


def overlapping(samples: NDArray[T], length: int, hop: int = 1) -> NDArray[T]:
    """(N,) → (T, length) windows, each ``hop`` samples after the one before; nobody may write to them.

    As `numpy.lib.stride_tricks.sliding_window_view`, which takes forty times as long.
    """
    count = max(0, (len(samples) - length) // hop + 1)
    step = samples.strides[0]
    view: NDArray[T] = np.ndarray((count, length), samples.dtype, samples.data, 0, (hop * step, step))
    return view


class Bands(Generic[T]):
    """Weighted sums of neighbouring bins: `filters` (M, F) applied to (T, F), without a matrix product.

    Each row's non-zero stretch is laid end to end, so that one `reduceat` sums them all.
    """

    def __init__(self, filters: NDArray[T]) -> None:
        rows: list[NDArray[np.int64]] = [np.flatnonzero(row) if row.any() else np.zeros(1, int) for row in filters]
        self.bins: NDArray[np.int64] = np.concatenate(rows)
        self.weights: NDArray[T] = np.concatenate([row[at] for row, at in zip(filters, rows, strict=True)])
        self.starts = np.cumsum([0, *(len(at) for at in rows[:-1])])

    def __call__(self, power: NDArray[T]) -> NDArray[T]:
        return np.add.reduceat(power.take(self.bins, 1) * self.weights, self.starts, axis=1)


@cache
def _mel_bands(n_mels: int) -> Bands[np.float32]:
    return Bands(mel_filters(n_mels))


def log_power(power: Floats) -> Floats:
    """Natural logarithm of a power, not below that of -100 dB."""
    return np.log(np.maximum(power, np.float32(FLOOR)))


def log_mel(samples: Floats, *, n_mels: int = 80) -> Floats:
    """(N,) samples at 16 kHz → (1 + N // 160, n_mels) natural log of mel band powers, at 100 frames a second.

    Equal to the logarithm of librosa's ``feature.melspectrogram(sr=16000, n_fft=400, hop_length=160)``, not below 1e-10.
    """
    bands = _mel_bands(n_mels)
    signal = np.pad(np.asarray(samples, np.float32), WINDOW // 2)
    frames = np.lib.stride_tricks.sliding_window_view(signal, WINDOW)[::HOP]
    out = np.empty((1 + len(samples) // HOP, n_mels), np.float32)
    for at in range(0, len(out), BATCH):
        out[at : at + BATCH] = log_power(bands(power_spectra(frames[at : at + BATCH])))
    return out
