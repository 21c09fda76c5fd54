"""Another delivery of the same words: tempo, pauses and pitch of speech changed by TD-PSOLA (Moulines & Charpentier 1990).

Grains of two periods, cut at marks that follow the pitch, are laid out again at other distances: nearer for a higher voice,
repeated or left out for another tempo. The spectral envelope, and so who speaks and what, stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...audio.features.mel import FPS, RATE
from ...audio.features.prosody import PITCH_RANGE

__all__ = ["Delivery", "deliver"]

Array = NDArray[np.float64]

_UNVOICED = 80  # samples, 5 ms: distance of marks where there is no voice; ours, short enough not to echo
_NEAR = 0.2  # of a period: how far a mark may move to its peak; ours: less than half, so that none is passed over


@dataclass(frozen=True, eq=False)
class Delivery:
    """How speech is to sound, per hundredth of a second of the speech as it is (T of them).

    Args:
        pitch: (T,) Hz as it is, 0 where there is no voice.
        wanted: (T,) Hz as it shall be; where ``pitch`` is 0 it is not looked at.
        longer: (T,) by which factor each hundredth lasts longer.
        jitter: standard deviation of a period, as a share of it.
    """

    pitch: Array
    target: Array
    longer: Array
    jitter: float = 0.0

    def time_of(self, seconds: Array | float) -> Array:
        """The new time of what was at ``seconds`` in the speech as it is."""
        edges = np.arange(len(self.longer) + 1) / FPS
        return np.interp(seconds, edges, np.concatenate([[0.0], np.cumsum(self.longer) / FPS]))


def deliver(samples: NDArray[np.float32], delivery: Delivery, rng: np.random.Generator) -> NDArray[np.float32]:
    """The same words at another pitch and tempo, 16 kHz.

    Args:
        samples: (N,) speech as it is.
        delivery: how it shall be, of ceil(N / 160) hundredths at least.
        rng: draws the jitter.
    """
    x = samples.astype(np.float64)
    marks, periods, voiced = _marks(x, delivery.pitch)
    places, indices = _layout(delivery, marks, voiced, len(x), rng)
    count = round(float(delivery.time_of(len(x) / RATE)) * RATE)
    margin = int(periods.max(initial=_UNVOICED)) + 1
    out, weight = np.zeros((2, count + 2 * margin))
    signal = np.pad(x, margin)
    windows = {period: np.hanning(2 * period + 1) for period in set(periods.tolist())}
    before = -1
    for place, k in zip(places.tolist(), indices.tolist(), strict=True):
        period = int(periods[k])
        window, at, mark = windows[period], place + margin, int(marks[k]) + margin
        grain = signal[mark - period : mark + period + 1]
        if k == before and not voiced[k]:
            grain = grain[::-1]  # hiss that is repeated as it is would buzz
        out[at - period : at + period + 1] += window * grain
        weight[at - period : at + period + 1] += window
        before = k if k != before else -1
    out /= np.maximum(weight, 1.0)  # where grains are sparser than they were, the gaps are the lower pitch
    return out[margin : margin + count].astype(np.float32)


def _marks(x: Array, pitch: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Where grains are cut: samples, the period there in samples, and whether there is voice."""
    polarity = 1.0 if x.max(initial=0.0) >= -x.min(initial=0.0) else -1.0
    marks: list[int] = []
    periods, voiced = [], []
    at = 0
    while at < len(x):
        f = float(pitch[min(int(at * FPS / RATE), len(pitch) - 1)])
        period = round(RATE / f) if f > 0 else _UNVOICED
        if f > 0:
            reach = max(int(_NEAR * period), 1)
            low = max(at - reach, marks[-1] + period // 2 if marks else 0)
            near = x[low : at + reach + 1]
            at = low + int(np.argmax(polarity * near)) if len(near) else at
        marks.append(at)
        periods.append(period)
        voiced.append(f > 0)
        at += period
    return np.array(marks, np.int64), np.array(periods, np.int64), np.array(voiced, bool)


def _layout(
    delivery: Delivery, marks: NDArray[np.int64], voiced: NDArray[np.bool_], samples: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where grains are laid, in samples, and which."""
    new_marks = delivery.time_of(marks / RATE) * RATE
    end = float(delivery.time_of(samples / RATE)) * RATE
    middles = (new_marks[1:] + new_marks[:-1]) / 2
    noise = rng.normal(0.0, 1.0, 1024).clip(-2, 2)  # so many that nobody hears it repeat; ours
    low, high = PITCH_RANGE
    places, indices = [], []
    at, k, n = 0.0, 0, 0
    while at < end:
        while k < len(middles) and middles[k] <= at:
            k += 1
        places.append(int(at))
        indices.append(k)
        step = float(_UNVOICED)
        if voiced[k]:
            hundredth = min(int(marks[k] * FPS / RATE), len(delivery.target) - 1)
            step = RATE / min(max(delivery.target[hundredth], low), high) * (1 + delivery.jitter * noise[n % 1024])
            n += 1
        at += step
    return np.array(places, np.int64), np.array(indices, np.int64)
