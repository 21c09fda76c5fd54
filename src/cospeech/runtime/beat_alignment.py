"""Strokes that fall on the accents of the speech: the timing of a network's arms is bent a little, their poses stay; ours.

A network moves the hands about as often as people do, but hardly when the voice is loud. Here a peak of the hands' speed near
an accent is moved onto it. At other accents the hands hurry a little. Between two accents their time goes slower. Arms and
fingers pass through the poses that the network made, in the same order; trunk, head and legs keep their time.

This sets what `cospeech.metrics.beat_lift` measures. So it is no part of `TrainedModel.generate`, whose motion is measured, and
the lift of files says nothing about how well a network hears.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..audio.event_detection import ENVELOPE_DELAY, LEVEL_DELAY, PEAK_DELAY, TICK, EventDetector
from ..audio.features.at_16_khz import At16kHz
from ..audio.features.shared_prosody import SharedProsody
from ..audio.prosodic_events import RATE, Accent
from ..audio.speech import Speech
from ..motion.part_joints import arm_joints
from ..motion.rotations import Array, quat_slerp
from ..motion.skeleton import humanoid
from ..rules.minimum_jerk import minimum_jerk
from ..rules.streaming import in_short
from .hand_speeds import HandSpeeds

__all__ = ["AccentTrack", "BeatAlignment"]

LEAD = 0.08
"""Seconds by which the hands are fastest before an accent [ours: three takes have .07 to .10, `metrics.beat_lift`]."""
_FAR = 0.25  # seconds by which a stroke is moved at most [ours: half a stroke]
_NEXT = (0.25, 0.8)  # seconds from one accent that is met to the next: least and most [ours]
_BACK = 0.4  # seconds in which the arms' time comes half-way back to that of the body, where no accent follows [ours]
_RATES = (0.65, 1.5)  # of time from one accent to the next, least and most [ours; with less, time would go back beside `_PEAK`]
_PEAK = 1.2
"""Rate of time at an accent [ours: with 1, the hands are often faster before or after it; with 1.3, they jerk by a tenth more,
and files of the chain have a lift of .55: as much as any person]."""
_LEAST = 0.2  # arm lengths per second, of both wrists together, that are a stroke [ours]
_NEARER = 0.7  # share of its worth that a peak loses at a distance of `_FAR` [ours]


class Knot(NamedTuple):
    """At ``time`` the arms are where the network had them at ``source``, in seconds; they go on at this rate."""

    time: float
    source: float
    rate: float = 1.0


class AccentTrack:
    """Hears the accents of speech that comes in pieces of any size, for all takes of it."""

    delay = LEVEL_DELAY + TICK + ENVELOPE_DELAY + PEAK_DELAY + 1 / RATE
    """Seconds of 16 kHz sound after a time that must have been heard until all accents up to it are known."""

    def __init__(self) -> None:
        self._sound, self._detector = At16kHz(), EventDetector()
        self._accents, self._times = list[Accent](), list[float]()
        self.known = 0.0
        """Seconds up to which all accents are known, that time included."""

    def share(self, prosody: SharedProsody) -> None:
        """See `cospeech.audio.features.streaming.StreamingFeatures`."""
        self._detector.share(prosody)

    def push(self, piece: Speech) -> None:
        """Hear what comes next."""
        for short in in_short(piece):  # the detector remembers 20 s
            self._detector.push(self._sound.push(short))
            self._note(self._detector.judged_until)

    def finish(self) -> None:
        """The speech is over."""
        self._detector.push(self._sound.finish())
        self._detector.finish()
        self._note(np.inf)

    def between(self, start: float, end: float) -> list[Accent]:
        """The accents from one time to another, both included; in seconds, and in their order."""
        return self._accents[bisect_left(self._times, start) : bisect_right(self._times, end)]

    def _note(self, until: float) -> None:
        """Keep the new accents: the detector forgets them, and a network that hears the whole speech plays at its end."""
        latest = self._times[-1] if self._times else -np.inf
        new = [accent for accent in self._detector.accents if accent.time > latest]
        self._accents += new
        self._times += [accent.time for accent in new]
        self.known = until


class BeatAlignment:
    """Bends the timing of frames as they come.

    Every frame depends on the frames and accents within `look_ahead` seconds after it, and on what was before. So motion in
    pieces of any size comes back the same.

    Args:
        fps: of the frames.
        track: of the accents; it is pushed first.
    """

    sound_ahead = _NEXT[1] + LEAD + AccentTrack.delay
    """Seconds of 16 kHz sound after a frame that must have been heard."""

    def __init__(self, fps: float, track: AccentTrack) -> None:
        self._fps, self._track = fps, track
        self._hands = HandSpeeds(fps)
        self._wide = self._hands.wide  # frames to either side in which a peak is alone
        self._rotations, self._root = np.zeros((0, len(humanoid()), 4), np.float32), np.zeros((0, 3), np.float32)
        self._first = 0  # index of the first frame that is kept
        self._speeds = np.zeros(0)  # of both wrists together, from `_first` on, as far as they are known
        self._end, self._frames, self._over = 0, 0, False
        self._knots = [Knot(0.0, 0.0)]

    @property
    def look_ahead(self) -> float:
        """Seconds of motion after a frame that it waits for."""
        return _NEXT[1] + _FAR + (2 * self._wide + 2) / self._fps

    def push(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """The next frames.

        Args:
            rotations: (n, J, 4) of our humanoid, local.
            root: (n, 3) of its hips, metres.

        Returns:
            Those that have become certain.
        """
        if len(rotations):
            self._keep(rotations, root)
        return self._give()

    def finish(self) -> tuple[Array, Array]:
        """The frames that are left, after the last one was pushed; as many in all as were pushed."""
        self._over = True
        self._speeds = np.concatenate([self._speeds, self._hands.finish().sum(-1)])
        return self._give()

    def _keep(self, rotations: Array, root: Array) -> None:
        """Note frames, and the speeds that become known."""
        self._rotations, self._root = np.concatenate([self._rotations, rotations]), np.concatenate([self._root, root])
        self._frames += len(rotations)
        self._speeds = np.concatenate([self._speeds, self._hands.push(rotations)[1].sum(-1)])

    def _give(self) -> tuple[Array, Array]:
        """The frames whose time is known."""
        while self._knots[-1].time * self._fps < self._frames and self._is_ready():
            self._knots.append(self._next_knot(self._knots[-1]))
        end = min(int(np.ceil(self._knots[-1].time * self._fps)), self._frames)
        if end <= self._end:
            return self._rotations[:0], self._root[:0]
        times = np.arange(self._end, end) / self._fps
        places = np.minimum(bend_times(self._knots, times) * self._fps, self._frames - 1.0)
        frames = self._sample(places)
        self._end = end
        later = [k for k, knot in enumerate(self._knots) if knot.time <= end / self._fps]
        self._knots = self._knots[later[-1] :]
        self._forget(min(int(self._knots[0].source * self._fps), int(places[-1]), end) - 2)
        return frames

    def _is_ready(self) -> bool:
        """Whether everything is known on which the next knot may depend."""
        end = self._knots[-1].time + _NEXT[1]
        speeds_end = (self._first + len(self._speeds)) / self._fps
        return self._over or (self._track.known >= end + LEAD and speeds_end >= end + _FAR + (self._wide + 1) / self._fps)

    def _next_knot(self, last: Knot) -> Knot:
        """A stroke on an accent; an accent at which the hands hurry; or time that comes back to the body's."""
        start, end = last.time + _NEXT[0], last.time + _NEXT[1]
        accents, peaks = self._track.between(start + LEAD, end + LEAD), self._peaks(start - _FAR, end + _FAR)
        pairs = [(a, peak, speed) for a in accents for peak, speed in peaks if abs(a.time - LEAD - peak) <= _FAR]
        worth = [speed * (0.5 + a.strength) * (1 - _NEARER * abs(a.time - LEAD - peak) / _FAR) for a, peak, speed in pairs]
        best = None
        for k in sorted(range(len(pairs)), key=lambda k: -worth[k]):  # the best, and then what still fits before it
            knot = Knot(pairs[k][0].time - LEAD, pairs[k][1], _PEAK)
            if _fits(last, knot) and (best is None or _fits(knot, best)):
                best = knot
        best = best or Knot(last.time + _BACK, last.time + _BACK + (last.source - last.time) / 2)
        for time in (a.time - LEAD for a in accents):
            if start <= time <= best.time - _NEXT[0]:
                return Knot(time, float(np.interp(time, [last.time, best.time], [last.source, best.source])), _PEAK)
        return best

    def _peaks(self, start: float, end: float) -> list[tuple[float, float]]:
        """Seconds and speeds of the strokes between two times."""
        a = max(int(np.ceil(start * self._fps)) - self._first, self._wide)
        z = min(int(end * self._fps) - self._first, len(self._speeds) - self._wide - 1)
        peaks = []
        for k in range(a, z + 1):
            here = self._speeds[k]
            if here >= _LEAST and here >= self._speeds[k - self._wide : k + self._wide + 1].max():
                peaks.append(((self._first + k) / self._fps, float(here)))
        return peaks

    def _sample(self, places: Array) -> tuple[Array, Array]:
        """The next frames, with the arms of these places, between the two frames that are next to them."""
        now = slice(self._end - self._first, self._end - self._first + len(places))
        rotations, root, arms = self._rotations[now].copy(), self._root[now], arm_joints()
        before = places.astype(int) - self._first
        a, b = (self._rotations[k][:, arms] for k in (before, np.minimum(before + 1, len(self._rotations) - 1)))
        part = (places - self._first - before).astype(np.float32)
        rotations[:, arms] = quat_slerp(a, b, part[:, None])
        return rotations, root

    def _forget(self, first: int) -> None:
        """Drop the frames before this one."""
        count = max(min(first - self._wide, self._first + len(self._speeds)) - self._first, 0)
        self._first += count
        self._rotations, self._root, self._speeds = self._rotations[count:], self._root[count:], self._speeds[count:]


def bend_times(knots: Sequence[Knot], times: Array) -> Array:
    """(n,) seconds of the source at these times: between knots polynomials of the fifth degree that neither hurry nor slow down
    at the knots."""
    table = np.array(knots)
    k = np.clip(np.searchsorted(table[:, 0], times, side="right") - 1, 0, len(table) - 2)
    (t0, p0, r0), (t1, p1, r1) = table[k].T, table[k + 1].T
    length = t1 - t0
    u = (times - t0) / length
    own = r0 * (u - u**3 * (6 - 8 * u + 3 * u**2)) - r1 * u**3 * (4 - 7 * u + 3 * u**2)
    return p0 + (p1 - p0) * minimum_jerk(u) + length * own  # type: ignore[no-any-return]


def _fits(before: Knot, behind: Knot) -> bool:
    """Whether time can go from one knot to the other."""
    ahead = behind.time - before.time
    return ahead >= _NEXT[0] and _RATES[0] <= (behind.source - before.source) / ahead <= _RATES[1]
