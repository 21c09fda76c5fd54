"""The audio features that a network takes, the same in training and at run time: functions of the rows of a front-end.

Front-ends are classes that compute rows from speech (`StreamingFeatures`). Most features are computed from the (T, 84) of
`AUDIO_NAMES`. The rows of PATS' stores (`log_mel.LogMelFeatures`) and of the waveform are taken as they are.

Each row is computed from one row alone, with sums that run along it: a stream has the same bits as the whole.

Fewer mel bands are computed from the 80 by pooling: the mel axis is cut into equal parts, and the power of a part is the mean
of the powers of its bands. A band at the edge of a part counts by its share in it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from math import log
from typing import NamedTuple

import numpy as np

from ...errors import InputError, nearest
from .frames import AUDIO_NAMES, FrameFeatures
from .log_mel import LOG_MEL_NAMES, LogMelFeatures
from .mel import Bands, Floats, log_power
from .prosody import N_MELS
from .streaming import StreamingFeatures
from .waveform import WAVEFORM_NAMES, WaveformFeatures

__all__ = [
    "REDUCTIONS",
    "Reduction",
    "audio_columns",
    "audio_names",
    "audio_width",
    "has_levels",
    "has_like_columns",
    "louder",
    "open_features",
    "preparation_option",
    "reduce_audio",
]  # fmt: skip

_SPEAKER = 120.0  # Hz; ours: pitch is in octaves above this, of a low voice about 0, of a high one about 1
_LOUDEST = 60.0  # ours: log of a power that no sound reaches (samples of ±100 give 30), so that exp stays in float32
_CEPSTRA = 14  # Bhattacharya et al. 2021, authors' code
_LINEAR = ("mel29-linear", "waveform")  # columns that are no logarithms
_PROSODY = tuple(AUDIO_NAMES[N_MELS:])


class Reduction(NamedTuple):
    """A choice of audio features.

    Args:
        what: one line.
        names: one per column.
        apply: (T, C) float32 → (T, A) float32.
        columns: (C,) names of the columns that it takes, as a store has them.
        listen: frames per second → the front-end that computes these columns from speech.
        alike: whether all columns are of one kind, and are standardised by one mean and deviation.
        prepared: the option of ``cospeech prepare`` that stores these columns; "" where all stores have them.
    """

    what: str
    names: tuple[str, ...]
    apply: Callable[[Floats], Floats]
    columns: tuple[str, ...] = AUDIO_NAMES
    listen: Callable[[float], StreamingFeatures] = FrameFeatures
    alike: bool = False
    prepared: str = ""


@cache
def _pool(count: int) -> Bands[np.float32]:
    """(count, 80) shares of the mel bands in as many equal parts of their axis; each row's sum is 1."""
    edges = np.linspace(0, N_MELS, count + 1)
    band = np.arange(N_MELS)
    overlap = np.minimum(edges[1:, None], band + 1) - np.maximum(edges[:-1, None], band)
    shares = np.maximum(overlap, 0)
    return Bands((shares / shares.sum(1, keepdims=True)).astype(np.float32))


def _powers(columns: Floats, count: int) -> Floats:
    return _pool(count)(np.exp(np.minimum(columns[:, :N_MELS], np.float32(_LOUDEST))))


def _log_powers(columns: Floats, count: int) -> Floats:
    return log_power(_powers(columns, count))


@cache
def _cosines() -> Bands[np.float32]:
    """(14, 80) rows of the orthonormal discrete cosine transform of 80 log powers."""
    band, k = np.arange(N_MELS) + 0.5, np.arange(_CEPSTRA)[:, None]
    rows = np.cos(np.pi * k * band / N_MELS) * np.sqrt(np.where(k, 2, 1) / N_MELS)
    return Bands(rows.astype(np.float32))


def _mel_cepstrum(columns: Floats) -> Floats:
    return _cosines()(np.minimum(columns[:, :N_MELS], np.float32(_LOUDEST)))


def _prosody(columns: Floats) -> Floats:
    out = columns[:, N_MELS:].copy()
    pitch = out[:, 1]
    out[:, 1] = np.where(pitch > 0, np.log2(np.maximum(pitch, 1) / np.float32(_SPEAKER)), 0)
    return out


def _log_powers_and_prosody(columns: Floats, count: int) -> Floats:
    return np.concatenate([_log_powers(columns, count), _prosody(columns)], 1)


def _as_it_is(columns: Floats) -> Floats:
    return columns


def _mels(count: int) -> tuple[str, ...]:
    return tuple(f"mel{k}" for k in range(count))


REDUCTIONS: dict[str, Reduction] = {
    "mel64": Reduction("log of 64 mel powers (Speech2Gesture, Mix-StAGE)", _mels(64), partial(_log_powers, count=64)),
    "mel40": Reduction("log of 40 mel powers (speech to face)", _mels(40), partial(_log_powers, count=40)),
    "mel29-linear": Reduction(
        "29 mel powers, not their logarithm: what the stylised flow's code feeds for quiet sound; for loud sound its own bends",
        _mels(29),
        partial(_powers, count=29),
    ),
    "mel29": Reduction("log of 29 mel powers (stylised flow, TED)", _mels(29), partial(_log_powers, count=29)),
    "mel27": Reduction("log of 27 mel powers (stylised flow and MoGlow, Trinity)", _mels(27), partial(_log_powers, count=27)),
    "mel20-prosody": Reduction(
        "log of 20 mel powers; energy, pitch, voicing, onset",
        (*_mels(20), *_PROSODY),
        partial(_log_powers_and_prosody, count=20),
    ),
    "prosody": Reduction("energy in dB, pitch in octaves from 120 Hz (0 without voice), voicing, onset", _PROSODY, _prosody),
    "mfcc14": Reduction(
        "14 mel-frequency cepstral coefficients (speech2affective-gestures)",
        tuple(f"mfcc{k}" for k in range(_CEPSTRA)),
        _mel_cepstrum,
    ),
    "log-mel-400": Reduction(
        "log of 64 mel magnitudes, 125 to 7500 Hz, as PATS has them (Mix-StAGE)",
        LOG_MEL_NAMES,
        _as_it_is,
        LOG_MEL_NAMES,
        LogMelFeatures,
    ),
    "waveform": Reduction(
        "1,080 samples of each frame, as they are (trimodal, joint embedding)",
        WAVEFORM_NAMES,
        _as_it_is,
        WAVEFORM_NAMES,
        WaveformFeatures,
        alike=True,
        prepared="--waveform",
    ),
}
"""Name → what it keeps; the names that recipes and bundles use."""


def _find(name: str) -> Reduction:
    if name not in REDUCTIONS:
        raise InputError(f"no reduction of audio is called {name!r}", nearest(str(name), REDUCTIONS))
    return REDUCTIONS[name]


def audio_names(name: str) -> tuple[str, ...]:
    """Names of the columns that `reduce_audio` gives.

    Raises:
        InputError: unknown name.
    """
    return _find(name).names


def audio_width(name: str) -> int:
    """How many columns `reduce_audio` gives.

    >>> audio_width("mel29-linear"), audio_width("mel20-prosody"), audio_width("prosody")
    (29, 24, 4)

    Raises:
        InputError: unknown name.
    """
    return len(_find(name).names)


def has_like_columns(name: str) -> bool:
    """Whether all columns that `reduce_audio` gives are of one kind.

    Raises:
        InputError: unknown name.
    """
    return _find(name).alike


def preparation_option(name: str) -> str:
    """The option of ``cospeech prepare`` that stores the columns of `reduce_audio`; "" where all stores have them.

    Raises:
        InputError: unknown name.
    """
    return _find(name).prepared


def audio_columns(name: str) -> tuple[str, ...]:
    """Names of the columns that `reduce_audio` takes.

    Raises:
        InputError: unknown name.
    """
    return _find(name).columns


def louder(name: str) -> tuple[float, ...]:
    """How much each column of `reduce_audio` grows when speech is 10 dB louder: logarithms of power grow by ln 10.

    >>> [round(step, 3) for step in louder("prosody")]
    [10.0, 0.0, 0.0, 0.0]

    Raises:
        InputError: unknown name, or one whose columns are no logarithms.
    """
    if name in _LINEAR:
        raise InputError(f"louder speech in {name!r}", "its columns are no logarithms: choose some, such as mel29")
    steps = {"energy": 10.0, "pitch": 0.0, "voicing": 0.0, "onset": 0.0}
    steps |= {f"mfcc{k}": 0.0 if k else log(10) * N_MELS**0.5 for k in range(_CEPSTRA)}
    mel = log(10) / 2 if name == "log-mel-400" else log(10)  # of magnitudes, of powers
    return tuple(steps.get(column, mel) for column in audio_names(name))


def has_levels(name: str) -> bool:
    """Whether the level of the speech can be found in `audio_columns`, and changed in what `reduce_audio` gives.

    >>> has_levels("mel40"), has_levels("waveform"), has_levels("log-mel-400")
    (True, False, False)

    Raises:
        InputError: unknown name.
    """
    return name not in _LINEAR and {"energy", "voicing"} <= set(audio_columns(name))


def open_features(name: str, fps: float) -> StreamingFeatures:
    """A front-end for what `reduce_audio` takes.

    Raises:
        InputError: unknown name, or fps is not a positive number.
    """
    return _find(name).listen(fps)


def reduce_audio(columns: Floats, name: str) -> Floats:
    """(T, C) rows of `audio_columns` → (T, A) float32; row t depends on row t alone.

    Raises:
        InputError: unknown name, another number of columns, or values that are not finite.
    """
    reduction = _find(name)
    columns = np.asarray(columns, np.float32)
    if columns.ndim != 2 or columns.shape[1] != len(reduction.columns):
        raise InputError(f"audio features of shape {columns.shape}", f"{name!r} is made of (frames, {len(reduction.columns)})")
    if not np.isfinite(columns).all():
        raise InputError("audio features hold values that are not finite")
    return reduction.apply(columns)
