"""Beat lift: how far the hands follow the accents of speech, beyond what chance gives.

The usual beat alignment rewards jitter (white noise scores .92): the more peaks, the nearer one lies to every accent. Here the
score is compared with that of the same motion shifted along the same speech, so that extra peaks and noise gain nothing:

    closeness(accent) = exp(−d² / 2σ²), d = distance to the nearest peak of wrist speed, σ = 0.1 s
    value  = mean closeness over accents, at the best lag of −0.4 … +0.2 s between peak and accent
    chance = mean over circular shifts of the same, best lag included
    lift   = value / chance − 1

Accents are the peaks of the energy envelope (100–4000 Hz, below 6 Hz) with a prominence of at least half its SD; peaks of
the mean speed of both wrists (below 6 Hz) are taken likewise. *Far* shifts are ≥ 1.6 s, *near* ones 1.6–3.4 s (these ask
whether the hands follow the accents and not only the phrases). Three takes of one speaker give a far lift of 64, 53 and
31 %, a near one of 51, 23 and 20 %, with the hands 0.07–0.10 s ahead.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array
from ._scipy import scipy
from .interval import Resampled
from .movement import Track, wrist_speeds
from .movement_signal import FPS, SMOOTH, low_pass

__all__ = ["BeatLift", "accents", "beat_lift", "energy_envelope", "lift_of_times", "wrist_peaks"]

BAND = (100.0, 4000.0)  # Hz (benchmarks/README.md)
RATE = 100.0  # Hz, of the envelope; ours: far above its 6 Hz
PROMINENCE = 0.5  # SD (as published for accents; ours for wrist peaks: scale-free, and the real take comes out as printed)
SIGMA = 0.1  # s (benchmarks/README.md)
LAGS = np.arange(-0.4, 0.2001, 0.02)  # s, peak less accent (benchmarks/README.md)
SHIFT, NEAR = 1.6, 3.4  # s (benchmarks/README.md)
FAR_SHIFTS, NEAR_SHIFTS, RESAMPLES = 80, 20, 400  # ours: the mean over shifts is then known to 1 % of chance
BLOCK = 5.0  # s; the bootstrap draws stretches of this length, longer than a phrase. Ours


@dataclass(frozen=True)
class BeatLift:
    """Result of `beat_lift`.

    Args:
        far, near: lift over chance, far and near shifts; 0 is chance, .31 … .64 a real speaker.
        interval: 95 % bootstrap interval of ``far``.
        draws: some of the values that the interval is made of.
        lag: seconds from accent to wrist peak at the best lag; negative where the hands are first.
        beaten: share of far shifts that score lower than the true position of the speech (1 = all).
        accents: number of accents that the score is of.
    """

    far: float
    near: float
    interval: tuple[float, float]
    lag: float
    beaten: float
    accents: int
    draws: tuple[float, ...] = ()


def energy_envelope(samples: Array, rate: float) -> Array:
    """Energy of ``samples`` in 100–4000 Hz, below 6 Hz, at 100 values per second (value k at time (k + ½) / 100 s)."""
    if len(samples) < rate:
        raise InputError(f"{len(samples) / rate:.2f} s of speech", "beat lift needs a second at least, better minutes")
    band = (BAND[0], min(BAND[1], 0.45 * rate))
    signal = scipy("signal")
    sos = signal.butter(4, band, "bandpass", fs=rate, output="sos")
    energy = np.square(signal.sosfiltfilt(sos, np.asarray(samples, np.float64)))
    edges = np.round(np.arange(int(len(energy) * RATE / rate) + 1) * rate / RATE).astype(int)
    sums = np.concatenate([[0.0], np.cumsum(energy)])[edges]
    return low_pass(np.diff(sums) / np.diff(edges), SMOOTH, RATE)


def _peaks(x: Array) -> Array:
    return scipy("signal").find_peaks(x, prominence=max(PROMINENCE * x.std(), np.finfo(float).tiny))[0]


def accents(samples: Array, rate: float) -> Array:
    """Times of the speech's accents in seconds."""
    return (_peaks(energy_envelope(samples, rate)) + 0.5) / RATE


def wrist_peaks(motion: Motion | Track) -> Array:
    """Times of the peaks of the wrists' mean speed in seconds from the first frame."""
    return _peaks(wrist_speeds(Track.of(motion) if isinstance(motion, Motion) else motion).mean(1)) / FPS


def _closeness(speech: Array, motion: Array, duration: float, shifts: Array) -> Array:
    """(shifts, lags, accents) closeness of accents to the peaks, which each shift moves circularly."""
    if not len(motion):
        return np.zeros((len(shifts), len(LAGS), len(speech)))
    at = np.mod(speech[None, None] + LAGS[None, :, None] - shifts[:, None, None], duration)
    around = np.concatenate([[motion[-1] - duration], motion, [motion[0] + duration]])
    right = np.clip(np.searchsorted(around, at), 1, len(around) - 1)
    distance = np.minimum(np.abs(at - around[right - 1]), np.abs(around[right] - at))
    return np.exp(-np.square(distance) / (2 * SIGMA**2))


def beat_lift(pairs: Sequence[tuple[Array, float, Motion | Track]], *, seed: int = 0) -> BeatLift:
    """Lift over chance of several (samples, rate, motion) triples, scored together; a narrow interval takes minutes of speech.

    Raises:
        InputError: no pair is longer than 8 s, or the speech has no accents.
    """
    return lift_of_times([(accents(s, rate), wrist_peaks(motion), len(s) / rate) for s, rate, motion in pairs], seed=seed)


def lift_of_times(recordings: Sequence[tuple[Array, Array, float]], *, seed: int = 0) -> BeatLift:
    """`beat_lift` of the times of accents and of wrist peaks, and the duration, of each recording, in seconds.

    Raises:
        InputError: no recording is longer than 8 s, or the speech has no accents.
    """
    rng = np.random.default_rng(seed)
    close: dict[str, list[Array]] = {"true": [], "far": [], "near": []}
    blocks: list[Array] = []
    for speech, peaks, duration in recordings:
        if duration < 5 * SHIFT or not len(speech):
            continue
        near = np.linspace(SHIFT, min(NEAR, duration / 2), NEAR_SHIFTS // 2)
        far = np.linspace(SHIFT, duration - SHIFT, FAR_SHIFTS)
        for name, shifts in (("true", np.zeros(1)), ("far", far), ("near", np.concatenate([near, -near]))):
            close[name].append(_closeness(speech, peaks, duration, shifts))
        blocks.append((speech // BLOCK).astype(int) + (blocks[-1].max() + 1 if blocks else 0))
    if not blocks:
        raise InputError("no speech with accents is longer than 8 s", "give longer recordings")
    true, far, near = (np.concatenate(close[name], -1) for name in ("true", "far", "near"))

    def lift(weights: Array) -> tuple[float, Array, Array]:
        value = (true[0] @ weights).max()
        chance, nearby = (far @ weights).max(-1), (near @ weights).max(-1)
        return value, chance, nearby

    count = true.shape[-1]
    value, chance, nearby = lift(np.full(count, 1 / count))
    _, block = np.unique(np.concatenate(blocks), return_inverse=True)
    draws = rng.multinomial(block.max() + 1, np.full(block.max() + 1, 1 / (block.max() + 1)), RESAMPLES)[:, block]
    lifts = [v / max(c.mean(), 1e-12) - 1 for v, c, _ in (lift(w / w.sum()) for w in draws if w.sum())]
    resamples = Resampled.of(np.array(lifts))
    assert resamples.interval is not None
    return BeatLift(
        far=float(value / max(chance.mean(), 1e-12) - 1),
        near=float(value / max(nearby.mean(), 1e-12) - 1),
        interval=resamples.interval,
        lag=float(LAGS[np.argmax(true[0].mean(-1))]),
        beaten=float((chance < value).mean()),
        accents=count,
        draws=resamples.draws,
    )
