"""Listening: speech in pieces → normalised prosody, accents and phrases, with a bounded delay.

Everything is computed in ticks of 0.1 s from the sound up to then. So the result does not depend on the size of the pieces: a
stream equals the whole.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import fields

import numpy as np

from ..motion.rotations import Array
from .features.mel import overlapping
from .features.prosody import Features, ProsodyStream, samples_for
from .features.shared_prosody import Prosody, SharedProsody
from .prosodic_events import RATE, Accent, Heard, Phrase
from .speech import Speech

__all__ = ["ENVELOPE_DELAY", "LEVEL_DELAY", "PEAK_DELAY", "TICK", "EventDetector", "listen", "quantile"]

TICK = 0.1  # seconds between two decisions; ours
LEVEL_DELAY = 0.25  # seconds the running level sees ahead of the frame that it scales (ours)
PEAK_DELAY = 0.20  # seconds after a peak over which its prominence is measured (ours)
_KEEP = (
    20.0  # seconds of the past that stay in memory (ours: `cospeech.audio.speech_chunks.MOST_AT_ONCE` and what is heard around)
)
_WEAKEST = -58.0  # dBFS; a peak level below this is treated as silence (ours: room noise of a quiet microphone)
_RANGE = (22.0, 38.0)  # dB between the floor and the loud syllables: least and most that are believed
_SPEAKING = 0.40  # loudness above which somebody speaks (≈ 20 dB under the loud syllables)
_PAUSE = 0.28  # seconds of silence that separate two phrases; shorter ones are stops and hesitations
_SMOOTH = np.hanning(21)[1:-1] / np.hanning(21)[1:-1].sum()  # ≈ 6 Hz low-pass at 100 Hz (motion.md: accents)
_HALF = len(_SMOOTH) // 2
ENVELOPE_DELAY = _HALF / RATE
"""Seconds by which the envelope is known later than the energy."""
_LEVEL_SPAN = round((TICK + LEVEL_DELAY) * RATE)  # rows that the level is taken from at every tick
_ROOM = 500  # free rows behind those in memory (ours)
_SURE = round(PEAK_DELAY * RATE)  # rows after a peak that show how far it falls


class _Buffer:
    """Rows appended at the end, dropped from the front; addressed by absolute index.

    There is free room behind the rows, so that few appends copy them. Rows that were handed out are never overwritten.
    """

    def __init__(self, width: int = 0) -> None:
        self.first, self.end = 0, 0
        self._begin = 0  # index of the first row of the memory
        self._rows = np.empty((_ROOM, width) if width else _ROOM)

    def append(self, rows: Array) -> None:
        if self.end + len(rows) - self._begin > len(self._rows):
            old = self._rows[self.first - self._begin : self.end - self._begin]
            self._rows = np.empty((len(old) + len(rows) + _ROOM, *old.shape[1:]))
            self._rows[: len(old)] = old
            self._begin = self.first
        at = self.end - self._begin
        self._rows[at : at + len(rows)] = rows
        self.end += len(rows)

    def rows(self, a: int, b: int) -> Array:
        return self._rows[max(a, self.first) - self._begin : max(min(b, self.end), self.first) - self._begin]

    def drop_before(self, index: int) -> None:
        self.first = max(min(index, self.end), self.first)


class EventDetector:
    """Finds prosody, accents and phrases in speech that comes in pieces.

    Attributes:
        certain_until: seconds up to which `window` can answer.
        accents: recent accents in time order, each known ``LEVEL_DELAY + PEAK_DELAY + 0.1`` s after it happened.
        phrases: recent phrases; the last may still be going on (its end is then the time heard so far).

    Args:
        also: gets all prosody, with mel bands, as soon as it is certain.
        tick: seconds between two decisions.
        level_delay: seconds the running level sees ahead of the frame that it scales.
        peak_delay: seconds after a peak at which it is accepted; below `PEAK_DELAY`, its prominence is that of its rise alone.
    """

    def __init__(
        self,
        also: Callable[[Features], None] | None = None,
        *,
        tick: float = TICK,
        level_delay: float = LEVEL_DELAY,
        peak_delay: float = PEAK_DELAY,
    ) -> None:
        self._also = also
        self._tick_seconds, self._step = tick, round(tick * RATE)
        self._delay, self._wait = round(level_delay * RATE), round(peak_delay * RATE)
        self._prosody: Prosody = ProsodyStream(mel=also is not None)
        self._raw: dict[str, _Buffer] = {}
        self._loudness, self._tone, self._envelope = _Buffer(), _Buffer(), _Buffer()
        self._floor, self._peak, self._pitch = math.nan, math.nan, math.nan  # not heard yet
        self._peaks_end = 0
        self._speaking = False
        self._silent_since = 0
        self.accents: deque[Accent] = deque()
        self.phrases: deque[Phrase] = deque()
        self.finished = False

    def share(self, prosody: SharedProsody) -> None:
        """Take prosody that other listeners use, too; call it before anything is pushed."""
        self._prosody = prosody.tap()

    @property
    def certain_until(self) -> float:
        """Seconds for which normalised prosody is ready."""
        return self._loudness.end / RATE

    @property
    def judged_until(self) -> float:
        """Seconds up to which all accents are known, that time included."""
        return max(self._peaks_end - 1, 0) / RATE

    def push(self, samples: Array) -> None:
        """Take more samples, and do all steps that they allow."""
        self.hear(samples)
        self.catch_up()

    def hear(self, samples: Array) -> None:
        """Take more samples, but do no step: call `step` or `catch_up` for that."""
        self._take(self._prosody.push(samples))

    @property
    def needs(self) -> int:
        """Samples that must have been heard, in all, until the next `step` can be done."""
        return samples_for(self._loudness.end + self._step + self._delay)

    @property
    def is_ready(self) -> bool:
        """Whether enough was heard for the next `step`."""
        return bool(self._raw) and self._raw["energy"].end - self._delay >= self._loudness.end + self._step

    def step(self) -> bool:
        """Do one more tick, if enough was heard; give whether it was."""
        if not self.is_ready:
            return False
        self._know([self._loudness.end + self._step])
        return True

    def catch_up(self) -> None:
        """Do all steps that are possible; many ticks at once take hardly longer than one."""
        if self._wait < _SURE:  # without waiting for the rows after a peak, each tick judges the rows that it knows
            while self.step():
                pass
        elif self.is_ready:
            first, last = self._loudness.end + self._step, self._raw["energy"].end - self._delay
            self._know(range(first, last + 1, self._step))

    def finish(self) -> None:
        """End the speech: do the remaining steps, as if silence followed."""
        self._take(self._prosody.flush())
        if self._raw:
            while self._loudness.end < self._raw["energy"].end:
                self._know([min(self._loudness.end + self._step, self._raw["energy"].end)])
            self._smooth(self._loudness.end, max(self._peak, _WEAKEST), tail=_HALF)
        self.finished = True
        self._confirm_peaks(last=True)

    def _take(self, features: Features) -> None:
        if not len(features.energy):
            return
        if self._also is not None:
            self._also(features)
        for name in ("energy", "pitch", "voicing", "onset", "bands"):
            rows = np.asarray(getattr(features, name), float)
            self._raw.setdefault(name, _Buffer(rows.shape[1] if rows.ndim > 1 else 0)).append(rows)

    def _know(self, ends: Sequence[int]) -> None:
        """Do the ticks that end at these rows, one after the other."""
        first, end = self._loudness.end, ends[-1]
        energy = self._raw["energy"].rows(first, end + self._delay)
        levels = self._follow_levels(first, ends, energy.tolist())
        top, spread = np.repeat(levels, np.diff(ends, prepend=first), axis=0).T
        self._loudness.append(np.minimum(np.maximum((energy[: end - first] - (top - spread)) / spread, 0.0), 1.25))
        self._tone.append(self._semitones(first, ends))
        self._smooth_ticks(first, ends, [level[0] for level in levels])
        self._follow_phrases(first, end)
        self._confirm_peaks()
        oldest = end - round(_KEEP * RATE)
        for buffer in (self._loudness, self._tone, self._envelope, *self._raw.values()):
            buffer.drop_before(oldest)
        while self.accents and self.accents[0].time < oldest / RATE:
            self.accents.popleft()
        while len(self.phrases) > 1 and self.phrases[0].end < oldest / RATE:
            self.phrases.popleft()

    def _follow_levels(self, first: int, ends: Sequence[int], energy: list[float]) -> list[tuple[float, float]]:
        """Level of loud syllables, and dB from the floor up to it, at each tick; ``energy`` begins at the row ``first``."""
        levels, begin = [], first
        for end in ends:
            ahead = energy[begin - first : end + self._delay - first]
            if self._wait < _SURE:
                stop = end + self._delay
                ahead = self._raw["energy"].rows(max(stop - _LEVEL_SPAN, 0), stop).tolist()
            self._follow_level(ahead)
            spread = min(max(self._peak - self._floor, _RANGE[0]), _RANGE[1])
            levels.append((max(self._peak, _WEAKEST), spread))
            begin = end
        return levels

    def _smooth_ticks(self, first: int, ends: Sequence[int], tops: list[float]) -> None:
        """`_smooth` for each of the ticks."""
        before = self._envelope.end - _HALF
        if len(ends) == 1 or before < 0 or self._envelope.end != first - _HALF:
            for end, top in zip(ends, tops, strict=True):
                self._smooth(end, top)
            return
        energy = overlapping(self._raw["energy"].rows(before, ends[-1]), 2 * _HALF + self._step, self._step)
        amplitude = 10 ** ((energy - np.array(tops)[:, None]) / 20)
        self._envelope.append(np.concatenate([np.convolve(row, _SMOOTH, "valid") for row in amplitude]))

    def _smooth(self, end: int, top: float, tail: int = 0) -> None:
        """Extend the envelope (linear amplitude against the level of loud syllables) as far as the kernel reaches."""
        energy = self._raw["energy"].rows(self._envelope.end - _HALF, end)
        amplitude = 10 ** ((energy - top) / 20)
        before = max(_HALF - self._envelope.end, 0)
        amplitude = np.concatenate([np.zeros(before), amplitude, np.zeros(tail)])
        if len(amplitude) >= len(_SMOOTH):
            self._envelope.append(np.convolve(amplitude, _SMOOTH, "valid"))

    def _follow_level(self, ahead: list[float]) -> None:
        """Floor and level of loud syllables: quick towards new extremes, slow back (ours: 20 s down, 12 s up)."""
        levels = sorted(ahead)
        low, high = quantile(levels, 0.10), quantile(levels, 0.92)
        if math.isnan(self._peak):
            self._floor, self._peak = low, max(high, low + _RANGE[0])
        tick = self._tick_seconds
        self._peak = max(high, self._peak - 0.6 * tick) if high > self._peak - 14 else self._peak - 0.25 * tick
        self._floor = low if low < self._floor else self._floor + min(1.0, low - self._floor) * tick * 0.5

    def _semitones(self, first: int, ends: Sequence[int]) -> Array:
        """Semitones of the rows from ``first`` on, above the median pitch of the voice, which is updated at every tick."""
        pitch, voicing = (self._raw[name].rows(first, ends[-1]) for name in ("pitch", "voicing"))
        voiced = (pitch > 0) & (voicing > 0.5)
        usual, rows, flags = np.empty(len(pitch)), pitch.tolist(), voiced.tolist()
        begin = 0
        for end in (end - first for end in ends):
            tones = sorted([tone for tone, voice in zip(rows[begin:end], flags[begin:end], strict=True) if voice])
            if tones:
                median = (tones[(len(tones) - 1) // 2] + tones[len(tones) // 2]) / 2
                self._pitch = median if math.isnan(self._pitch) else self._pitch * (median / self._pitch) ** 0.03
            usual[begin:end] = self._pitch
            begin = end
        return np.where(voiced, np.minimum(np.maximum(12 * np.log2(np.maximum(pitch, 1) / usual), -12), 14), 0.0)

    def _follow_phrases(self, first: int, end: int) -> None:
        for k, loud in enumerate((self._loudness.rows(first, end) > _SPEAKING).tolist()):
            t = first + k
            if loud:
                self._silent_since = t + 1
                if not self._speaking:
                    self._speaking = True
                    self.phrases.append(Phrase(t / RATE, t / RATE))
            elif self._speaking and (t - self._silent_since) / RATE > _PAUSE:
                self._speaking = False
                self.phrases[-1] = Phrase(self.phrases[-1].start, self._silent_since / RATE)
        if self.phrases and self._speaking:
            self.phrases[-1] = Phrase(self.phrases[-1].start, self._silent_since / RATE)

    def _confirm_peaks(self, last: bool = False) -> None:
        """Accept peaks of the envelope where enough rows after them are known."""
        wait = 0 if last else self._wait
        a, b = self._peaks_end, self._envelope.end - wait
        if b <= a + 2:
            return
        e = self._envelope.rows(a - 60, b + wait)
        base = max(a - 60, self._envelope.first)
        first, end = max(1, a - base), min(b - base, len(e) - 1)
        near = e[first - 1 : max(end, first) + 1].tolist()
        for k, (before, here, after) in enumerate(zip(near, near[1:], near[2:], strict=False), first):
            if here < 0.12 or here <= before or here < after:
                continue
            if e[k] < e[max(0, k - 11) : k + 12].max():
                continue
            dip = e[max(0, k - 40) : k + 1].min()
            if self._wait >= _SURE:
                dip = max(dip, e[k : k + _SURE + 1].min())
            prominence = e[k] - dip
            if prominence < 0.10:
                continue
            t = base + k
            tone = self._tone.rows(t - 8, t + 9)
            rise = float(tone.max()) if len(tone) else 0.0
            strength = float(min(max(0.65 * prominence + 0.2 * e[k] + 0.02 * min(max(rise, 0), 7), 0.05), 1.0))
            self.accents.append(Accent(t / RATE, strength))
        self._peaks_end = b

    def window(self, start: float, end: float) -> Heard:
        """Everything known between two times in seconds (clipped to what is known and still kept)."""
        a = max(int(np.floor(start * RATE)), self._loudness.first, 0)
        b = min(int(np.ceil(end * RATE)) + 1, self._loudness.end)
        if b <= a:
            bands = self._raw["bands"].rows(0, 0).shape[1:] if self._raw else (5,)
            return Heard(a, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1), np.full((1, *bands), -80.0))
        raw = {name: self._raw[name].rows(a, b) for name in ("voicing", "onset", "bands")}
        return Heard(a, self._loudness.rows(a, b), self._tone.rows(a, b), raw["voicing"], raw["onset"], raw["bands"])


def quantile(values: Array | list[float], share: float) -> float:
    """As `numpy.quantile`, of values in ascending order; NumPy's takes twenty times as long over so few."""
    place = (len(values) - 1) * share
    low = int(place)
    below, above = float(values[low]), float(values[min(low + 1, len(values) - 1)])
    part = place - low
    return below + (above - below) * part if part < 0.5 else above - (above - below) * (1 - part)


def listen(speech: Speech) -> tuple[Heard, list[Accent], list[Phrase]]:
    """Analyse a whole speech at once: for tests, plots and short files (nothing is dropped)."""
    detector = EventDetector()
    parts: list[Heard] = []
    accents: dict[float, Accent] = {}
    phrases: dict[float, Phrase] = {}
    until = 0.0

    def collect() -> None:
        nonlocal until
        if detector.certain_until > until:
            parts.append(detector.window(until, detector.certain_until - 1.5 / RATE))
            until = detector.certain_until
        accents.update({a.time: a for a in detector.accents})
        phrases.update({p.start: p for p in detector.phrases})

    for chunk in speech.chunks(seconds=1.0):
        detector.push(chunk.samples)
        collect()
    detector.finish()
    collect()
    names = [f.name for f in fields(Heard)][1:]
    window = Heard(0, *(np.concatenate([getattr(p, n) for p in parts]) for n in names))
    return window, list(accents.values()), list(phrases.values())
