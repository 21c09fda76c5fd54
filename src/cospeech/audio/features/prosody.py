"""Features of the voice, 100 times a second: energy, pitch, voicing, onsets, log bands; whole or streamed, with the same bits.

Frame k describes time k / 100 s; there is a frame for every k / 100 s up to the end of the speech. A frame comes out of the
stream once the samples up to 45 ms after it are in (`DELAY`): half the pitch window, and two frames for mending octave jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .mel import BATCH, FPS, HOP, RATE, WINDOW, Bands, Floats, _mel_bands, hann, log_power, overlapping, power_spectra

if TYPE_CHECKING:
    from ..speech import Speech

__all__ = ["BAND_EDGES", "DELAY", "Features", "ProsodyStream", "analyse", "find_pauses"]

BAND_EDGES = (0, 300, 800, 1500, 3000, 8000)  # Hz: voice bar, first formant, second formant of back and of front vowels, hiss
ENERGY_BAND = (100, 4000)  # Hz; the band in which speech accents are measured (see the movement reference in docs)
N_MELS = 80
PIECE = 10 * RATE  # samples; ours: long speech is analysed in pieces, which needs less memory and gives the same bits

PITCH_RANGE = (60.0, 500.0)  # Hz: low male creak … high excited female voice
PITCH_WINDOW = 800  # samples, 50 ms: three periods of 60 Hz
PITCH_TRANSFORM = 1152  # ≥ window + longest lag, so that the autocorrelation does not wrap; 2⁷·3² is fast
LAG_RATE = RATE // 2  # Hz; the autocorrelation is taken at 8 kHz, which its low-pass allows
PITCH_BAND = (50.0, 1600.0)  # Hz; ours: no hum drift below, no hiss above
OCTAVE_COST = (
    0.05  # per octave; Boersma 1993 gives 0.01 with a path search; ours: fewest octave errors against pYIN without one
)
VOICED = (0.35, 0.65)  # autocorrelation at which voicing is 0 and 1; ours: 0.5 gives the fewest disagreements with pYIN
QUIETEST = -65.0  # dB; ours: below it nothing counts as voice
RANGE = 40.0  # dB below the recent peak level at which voice ends; ours
RELEASE = 3.0  # dB per second by which the recent peak level falls; ours
MEDIAN = 5  # frames; an octave jump of one or two frames is mended
DELAY = PITCH_WINDOW / 2 / RATE + (MEDIAN // 2) / FPS  # seconds


def samples_for(frames: int) -> int:
    """How many samples must have been heard until so many frames of `ProsodyStream` are handed out."""
    return (frames + MEDIAN // 2 - 1) * HOP + PITCH_WINDOW // 2


ONSET_FLOOR = 1e-8  # mel power; ours: flux in near silence (-80 dB) is not an onset


@dataclass(frozen=True, eq=False)
class Features:
    """The voice frame by frame, T frames at ``fps``.

    Args:
        energy: (T,) dB of the mean power in 100 … 4000 Hz; a full-scale sine is -3 dB, silence -100 dB.
        pitch: (T,) fundamental frequency in Hz, 0 where there is no voice.
        voicing: (T,) 0 … 1, how surely there is voice.
        onset: (T,) spectral flux in dB: mean rise of the mel bands from the frame before.
        bands: (T, 5) dB of mean power in 0–300, 300–800, 800–1500, 1500–3000, 3000–8000 Hz.
        mel: (T, 80) natural log of mel powers (`features.mel.log_mel`), or None where not asked for.
        start: index of the first frame (chunks of a stream carry theirs): it is at ``start / fps`` seconds.
    """

    energy: Floats
    pitch: Floats
    voicing: Floats
    onset: Floats
    bands: Floats
    mel: Floats | None = None
    fps: float = FPS
    start: int = 0

    def __len__(self) -> int:
        return len(self.energy)

    @property
    def times(self) -> NDArray[np.float64]:
        """(T,) seconds."""
        return (self.start + np.arange(len(self))) / self.fps

    def __getitem__(self, frames: slice) -> Features:
        """Frames ``a:b`` as Features that know where they start."""
        if not isinstance(frames, slice) or (frames.step or 1) != 1:
            raise InputError("features are cut with a slice of step 1")
        first = frames.indices(len(self))[0]
        mel = None if self.mel is None else self.mel[frames]
        cut = (self.energy[frames], self.pitch[frames], self.voicing[frames], self.onset[frames], self.bands[frames])
        return Features(*cut, mel, self.fps, self.start + first)

    @staticmethod
    def concatenate(parts: Sequence[Features]) -> Features:
        """Join chunks in time."""
        if not parts:
            raise InputError("nothing to concatenate")
        mels = [part.mel for part in parts if part.mel is not None]
        return Features(
            energy=np.concatenate([part.energy for part in parts]),
            pitch=np.concatenate([part.pitch for part in parts]),
            voicing=np.concatenate([part.voicing for part in parts]),
            onset=np.concatenate([part.onset for part in parts]),
            bands=np.concatenate([part.bands for part in parts]),
            mel=np.concatenate(mels) if mels else None,
            fps=parts[0].fps,
            start=parts[0].start,
        )

    def pauses(self, shortest: float = 0.15) -> list[tuple[float, float]]:
        """Pauses as (start, end) in seconds; see `find_pauses`."""
        at = self.start / self.fps
        return [(at + start, at + end) for start, end in find_pauses(self.energy, self.fps, shortest=shortest)]


def analyse(speech: Speech | Floats, *, mel: bool = False) -> Features:
    """All features of a speech at 16 kHz (or of its samples): 1 + N // 160 frames.

    Raises:
        InputError: the speech has another rate.
    """
    if isinstance(speech, np.ndarray):
        samples = speech
    elif speech.rate == RATE:
        samples = speech.samples
    else:
        raise InputError(f"speech at {speech.rate} Hz", f"features are computed at {RATE} Hz: load it with rate={RATE}")
    stream = ProsodyStream(mel=mel)
    parts = [stream.push(samples[at : at + PIECE]) for at in range(0, len(samples), PIECE)]
    return Features.concatenate([*parts, stream.flush()])


class ProsodyStream:
    """Features of speech that arrives in pieces of any size; all pieces together have the bits of `analyse`.

    >>> stream = ProsodyStream()
    >>> sum(len(stream.push(np.zeros(n, np.float32))) for n in (100, 3000, 1)) + len(stream.flush())
    20
    """

    def __init__(self, *, mel: bool = False) -> None:
        self.keep_mel = mel
        self._tail = np.zeros(PITCH_WINDOW // 2, np.float32)  # samples that later frames need; the first is at -25 ms
        self._sample_count = 0  # samples pushed
        self._frame_count = 0  # frames computed
        self._next = 0  # frames handed out
        self._mel_before: Floats | None = None  # the frame before, for the flux
        self._peak = -np.inf  # recent peak level
        self._raw_pitch = np.zeros(MEDIAN // 2, np.float32)  # of frames to smooth and their neighbours; first silence
        self._waiting: list[Features] = []
        self._memory = _PitchMemory()

    def push(self, samples: Floats) -> Features:
        """The frames that these samples complete; possibly none."""
        self._sample_count += len(samples)
        self._tail = np.concatenate([self._tail, np.asarray(samples, np.float32)])
        self._compute()
        return self._give(self._frame_count - MEDIAN // 2)

    def flush(self) -> Features:
        """End the stream; give the frames that waited for later samples."""
        last = self._sample_count // HOP + 1
        self._tail = np.pad(self._tail, (0, PITCH_WINDOW))
        self._compute(last)
        self._raw_pitch = np.pad(self._raw_pitch, (0, MEDIAN // 2))
        return self._give(last)

    def _compute(self, last: int | None = None) -> None:
        """Frames whose window is complete, up to ``last``, in batches."""
        ready = max(0, (len(self._tail) - PITCH_WINDOW) // HOP + 1)
        if last is not None:
            ready = min(ready, last - self._frame_count)
        if not ready:
            return
        frames = overlapping(self._tail, PITCH_WINDOW, HOP)
        for at in range(0, ready, BATCH):
            self._batch(frames[at : min(at + BATCH, ready)])
        self._tail = self._tail[ready * HOP :].copy()

    def _batch(self, frames: Floats) -> None:
        margin = (PITCH_WINDOW - WINDOW) // 2
        power = power_spectra(frames[:, margin : margin + WINDOW])
        mel = _mel_bands(N_MELS)(power)
        bands = _decibels(_log_bands()(power))
        energy, bands = bands[:, 0], np.ascontiguousarray(bands[:, 1:])
        logs = log_power(mel)
        decibels = np.maximum(logs, _onset_floor()) * _TO_DECIBELS
        steps = np.empty_like(decibels)
        np.subtract(decibels[1:], decibels[:-1], out=steps[1:])
        steps[0] = 0 if self._mel_before is None else decibels[0] - self._mel_before
        onset = np.maximum(steps, 0).mean(axis=1)
        self._mel_before = decibels[-1]
        voicing, pitch = np.zeros((2, len(frames)), np.float32)
        loud = np.flatnonzero(self._loud_enough(energy))  # nothing else can be voice
        if len(loud):
            hertz, strength = _pitch(frames if len(loud) == len(frames) else frames[loud], self._memory)
            voicing[loud] = np.minimum(np.maximum((strength - VOICED[0]) / (VOICED[1] - VOICED[0]), 0), 1)
            pitch[loud] = hertz
        self._raw_pitch = np.concatenate([self._raw_pitch, np.where(voicing > 0.5, pitch, np.float32(0))])
        log_mel = logs if self.keep_mel else None
        self._waiting.append(Features(energy, energy, voicing, onset, bands, log_mel, start=self._frame_count))  # pitch follows
        self._frame_count += len(frames)

    def _loud_enough(self, energy: Floats) -> NDArray[np.bool_]:
        """Whether a frame is near the recent peak level, which falls by `RELEASE` (a running maximum along a slope)."""
        slope = RELEASE / FPS * (self._frame_count + np.arange(len(energy)))
        peak = np.maximum(np.maximum.accumulate(energy + slope), self._peak)
        self._peak = peak[-1]
        return (energy > peak - slope - RANGE) & (energy > QUIETEST)

    def _give(self, until: int) -> Features:
        """Frames up to ``until``, their pitch smoothed."""
        count = max(0, until - self._next)
        pending = Features.concatenate(self._waiting) if self._waiting else _nothing(self.keep_mel)
        out, rest = pending[:count], pending[count:]
        self._waiting = [rest] if len(rest) else []
        pitch = _mend_jumps(self._raw_pitch[: count + 2 * (MEDIAN // 2)]) if count else out.pitch
        self._raw_pitch = self._raw_pitch[count:]
        start, self._next = self._next, self._next + count
        return Features(out.energy, pitch, out.voicing, out.onset, out.bands, out.mel, start=start)


def find_pauses(energy: NDArray[np.floating], fps: float = FPS, *, shortest: float = 0.15) -> list[tuple[float, float]]:
    """Stretches without speech, as (start, end) in seconds, of at least ``shortest`` seconds.

    A frame is silent below a level between the noise floor (5th percentile) and the speech (95th percentile) of the whole: a
    third of the way up, at most 30 dB below speech (ours). Where both are less than 10 dB apart there is speech throughout;
    where all is below -65 dB there is none at all.
    """
    if not len(energy):
        return []
    floor, loud = (float(x) for x in np.percentile(energy, (5, 95)))
    if loud < QUIETEST:
        return [(0.0, len(energy) / fps)]
    if loud - floor < 10:
        return []
    silent = energy < max(floor + (loud - floor) / 3, loud - 30)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], silent.astype(np.int8), [0]])))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(first / fps, last / fps) for first, last in pairs if last - first >= shortest * fps]


_TO_DECIBELS = np.float32(10 / np.log(10))


def _decibels(power: Floats) -> Floats:
    return log_power(power) * _TO_DECIBELS


@cache
def _onset_floor() -> np.float32:
    """Logarithm of `ONSET_FLOOR`."""
    return log_power(np.full(BATCH, ONSET_FLOOR, np.float32))[0]  # type: ignore[no-any-return]


def _nothing(mel: bool) -> Features:
    none = np.zeros(0, np.float32)
    return Features(
        none,
        none,
        none,
        none,
        np.zeros((0, len(BAND_EDGES) - 1), np.float32),
        np.zeros((0, N_MELS), np.float32) if mel else None,
    )


@cache
def _log_bands() -> Bands[np.float32]:
    """Row 0: the energy band; the rest: BAND_EDGES. Scaled to the signal's mean square (Parseval, one-sided, Hann's power)."""
    hertz = np.arange(WINDOW // 2 + 1) * (RATE / WINDOW)
    scale = 2 / (WINDOW * float(np.square(hann(WINDOW)).sum()))
    pairs = [ENERGY_BAND, *pairwise(BAND_EDGES)]
    rows = [(hertz >= low) & (hertz < high) for low, high in pairs]
    return Bands((np.array(rows) * scale).astype(np.float32))


@cache
def _window_autocorrelation() -> Floats:
    """Autocorrelation of the Hann window at lags of LAG_RATE, 1 at lag 0: divides that of a frame (Boersma 1993, eq. 9)."""
    spectrum = np.fft.rfft(hann(PITCH_WINDOW), 2 * PITCH_WINDOW)
    lags = np.fft.irfft(np.square(np.abs(spectrum)))[:: RATE // LAG_RATE]
    return (lags / lags[0]).astype(np.float32)


_LAGS = int(LAG_RATE / PITCH_RANGE[1]), int(LAG_RATE / PITCH_RANGE[0]) + 1
"""The shortest and the longest period of a voice, in samples at LAG_RATE."""


@cache
def _pitch_scales() -> tuple[Floats, NDArray[np.int64], Floats]:
    """The window (800,), the lags at which a voice is looked for, and what each costs."""
    at = np.arange(_LAGS[0], _LAGS[1] + 1)
    cost = OCTAVE_COST * np.log2(at * (PITCH_RANGE[0] / LAG_RATE))
    return hann(PITCH_WINDOW).astype(np.float32), at, cost.astype(np.float32)


class _PitchMemory:
    """Arrays that `_pitch` uses for each batch: to get so much memory from the system takes as long as a transform.

    Samples behind the window, and powers outside of `PITCH_BAND`, stay 0.
    """

    def __init__(self) -> None:
        self.signal = np.zeros((BATCH, PITCH_TRANSFORM), np.float32)
        self.spectra = np.empty((BATCH, PITCH_TRANSFORM // 2 + 1), np.complex64)
        self.power = np.zeros((BATCH, PITCH_TRANSFORM // 4 + 1), np.float32)
        self.lags = np.empty((BATCH, PITCH_TRANSFORM // 2), np.float32)


def _pitch(frames: Floats, memory: _PitchMemory) -> tuple[Floats, Floats]:
    """(T, 800) samples → pitch (T,) in Hz and strength (T,) 0 … 1, from the autocorrelation; T is `BATCH` at most.

    P. Boersma, "Accurate short-term analysis of the fundamental frequency…", IFA Proceedings 17, 1993; no path search.
    """
    window, at, cost = _pitch_scales()
    count = len(frames)
    np.multiply(frames, window, out=memory.signal[:count, :PITCH_WINDOW])
    spectra = np.fft.rfft(memory.signal[:count], out=memory.spectra[:count])  # type: ignore[arg-type]  # stubs know doubles
    per_bin = RATE / PITCH_TRANSFORM
    low, high = round(PITCH_BAND[0] / per_bin), round(PITCH_BAND[1] / per_bin)
    power = memory.power[:count]
    power[:, low:high] = np.square(spectra[:, low:high].real) + np.square(spectra[:, low:high].imag)
    lags = np.fft.irfft(power, PITCH_TRANSFORM // 2, out=memory.lags[:count])  # type: ignore[arg-type]  # as before
    shortest, longest = _LAGS
    around = lags[:, shortest - 1 : longest + 2] / np.maximum(lags[:, :1], np.float32(1e-12))
    around = around / _window_autocorrelation()[shortest - 1 : longest + 2]
    middle = around[:, 1:-1]
    score = middle - cost
    peaks = (middle >= around[:, :-2]) & (middle > around[:, 2:])
    best = np.where(peaks, score, -np.inf).argmax(axis=1)
    rows = np.arange(len(frames))
    left, top, right = around[rows, best], around[rows, best + 1], around[rows, best + 2]
    bend = left - 2 * top + right
    shift = np.where(bend < 0, (left - right) / np.where(bend < 0, 2 * bend, 1), 0)
    strength = np.where(peaks[rows, best], top - (left - right) * shift / 4, 0)
    shift, strength = np.minimum(np.maximum(shift, -0.5), 0.5), np.minimum(np.maximum(strength, 0), 1)
    return (LAG_RATE / (at[best] + shift)).astype(np.float32), strength.astype(np.float32)


def _mend_jumps(pitch: Floats) -> Floats:
    """(T + 4,) raw pitch → (T,): a voiced frame whose pitch is more than a third off the median around it gets the median."""
    around = overlapping(pitch, MEDIAN)
    pitches = np.sort(np.where(around > 0, around, np.inf), axis=1)
    voiced = (around > 0).sum(axis=1)
    median = pitches[np.arange(len(around)), np.maximum(voiced - 1, 0) // 2]
    here = around[:, MEDIAN // 2]
    jump = (here > 0) & (voiced >= 3) & (np.abs(here - median) > median / 3)
    return np.where(jump, median, here).astype(np.float32)
