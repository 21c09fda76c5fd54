"""How much of the coming speech a session of the rules hears before it moves: much, or little where nobody can wait.

A gesture begins before the word that it goes with. A session that hears 1.5 s ahead can plan that. One that hears half a
second ahead prepares in less time and strokes later. Both settings are here, and what follows from them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil, floor, inf
from numbers import Real

from ..audio.event_detection import ENVELOPE_DELAY, LEVEL_DELAY, PEAK_DELAY, TICK
from ..audio.features.prosody import DELAY
from ..audio.voice_emotion import LOOKS
from ..errors import InputError
from ..face.delays import FaceDelays
from .plan import HORIZON

__all__ = [
    "AROUSAL_DELAY", "DECISION", "LATENCY", "LEAST_FACE", "LEAST_LOOK_AHEAD", "LOOK_AHEAD", "MOUTH_WAITS", "USUAL", "Foresight",
    "foresee",
]  # fmt: skip

LOOK_AHEAD = HORIZON + LEVEL_DELAY + PEAK_DELAY + 0.15 + TICK
"""Seconds of speech beyond a frame that the frame depends on, at most (1.48 s): gestures begin before the word that they go
with, so somebody has to wait."""
LEAST_LOOK_AHEAD = 0.4
"""The shortest look-ahead of a session with body or hands, in seconds (ours: below, strokes come too late for their words)."""
LEAST_FACE = 0.2
"""The shortest of a session of the face alone, in seconds (ours: lips close by what is heard 0.17 s later)."""
_FACE_TICK = 0.05  # seconds between two decisions where less is heard ahead (ours: frames wait less for each other)
_SHORT_PEAK = 0.03  # seconds after a peak of the envelope until it counts as an accent (ours: the flank has begun to fall)
_WAIT, _SHORT_WAIT = 1 / 30, 1 / 50
"""Seconds; see `Foresight.wait` (ours: a third of a tick, for callers that push thirty times a second; usual small pieces)."""
_MARGIN = 0.02  # seconds: a row of the envelope, and one of the peak's right-hand side
_PREPARATION = 0.6  # seconds from a decision to an accent in which most preparations and half a stroke find room (ours)


@dataclass(frozen=True)
class Foresight:
    """How far a session looks ahead, and what follows.

    Attributes:
        look_ahead: seconds of speech beyond a frame that the frame depends on, at most.
        tick: seconds between two decisions.
        level_delay, peak_delay: see `cospeech.audio.event_detection`.
        horizon: seconds ahead of a tick up to which accents are taken up.
        late: seconds by which strokes come after the accents that they are made for.
        face: delays of what the face does.
    """

    look_ahead: float = LOOK_AHEAD
    tick: float = TICK
    level_delay: float = LEVEL_DELAY
    peak_delay: float = PEAK_DELAY
    horizon: float = HORIZON
    late: float = 0.0
    face: FaceDelays = field(default_factory=FaceDelays)

    @property
    def is_usual(self) -> bool:
        """Whether it is the setting of files."""
        return self.look_ahead == LOOK_AHEAD

    @property
    def sound_ahead(self) -> float:
        """Seconds of prosody beyond a tick that are certain when it is decided, at least."""
        return self.look_ahead - self.level_delay

    @property
    def decision(self) -> float:
        """Seconds of sound at 16 kHz after a frame's time until the frame is decided, at most: what it depends on, in whole
        ticks, and what the features of a hundredth wait for."""
        return ceil(self.sound_ahead / self.tick - 1e-9) * self.tick + self.level_delay + DELAY

    @property
    def wait(self) -> float:
        """Seconds: a piece of sound that is no longer leaves the frames that it decides to the next piece.

        So no piece is both heard and made into frames, and the longest push is shorter. A face alone that looks ahead by little
        does not wait.
        """
        if self.is_usual:
            return _WAIT
        return _SHORT_WAIT if self.look_ahead >= LEAST_LOOK_AHEAD else 0.0

    @property
    def latency(self) -> float:
        """Seconds of sound at 16 kHz after a frame's time until the frame is given, at most."""
        return self.decision + self.wait

    @property
    def mouth_waits(self) -> float:
        """Seconds of speech beyond a frame that have been heard, at least, when its face is made: what a mouth may wait for."""
        return self.look_ahead - self.tick


USUAL = Foresight()
LATENCY = USUAL.latency
"""Seconds of sound at 16 kHz after a frame's time until the frame is given, at most (1.628 s)."""
MOUTH_WAITS = USUAL.mouth_waits
"""See `Foresight.mouth_waits`."""
DECISION = USUAL.decision
"""Seconds of sound at 16 kHz after a frame's time until the frame is decided, at most (1.595 s)."""
AROUSAL_DELAY = DECISION + LOOKS + 0.15
"""Seconds by which others play the arousal late (2.25 s): then it is known whenever they need it, however the speech is
cut. It is looked at every half second (`cospeech.rules.arousal`), and 0.15 s are for resampling."""


def foresee(seconds: float | None, *, least: float = LEAST_LOOK_AHEAD) -> Foresight:
    """The setting that looks ahead by at most so many seconds; the usual one where None.

    Args:
        seconds: as `GenerationOptions.look_ahead`.
        least: the shortest that is possible.

    Raises:
        InputError: no number, or shorter than that.
    """
    if seconds is None:
        return USUAL
    if not isinstance(seconds, Real) or isinstance(seconds, bool) or not least - 1e-9 <= seconds <= inf:
        raise InputError(f"look_ahead is {seconds!r:.60}", f"seconds: {least:g} or more; above {LOOK_AHEAD:g} nothing changes")
    if seconds >= LOOK_AHEAD:
        return USUAL
    tick = TICK if seconds >= LEAST_LOOK_AHEAD else _FACE_TICK
    ahead = round(floor(float(seconds) / tick + 1e-6) * tick, 2)
    certain = ahead - _SHORT_PEAK - ENVELOPE_DELAY - _MARGIN
    horizon = min(certain, HORIZON)
    face = FaceDelays.for_foresight(accents=certain - tick, sound=ahead - tick)
    return Foresight(ahead, tick, 0.0, _SHORT_PEAK, horizon, max(_PREPARATION - horizon, 0.0), face)
