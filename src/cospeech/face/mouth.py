"""What a face can be given to speak with, in the place of the mouth that rules make: a mouth that was learnt, say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from ..audio.features.shared_prosody import SharedProsody
from ..errors import InputError
from ..motion.rotations import Array

__all__ = ["Mouth", "MouthMaker", "Sharing", "WaitLimited", "limit_wait"]


class Mouth(Protocol):
    """The mouth of one speech, which comes in pieces; what it says of a time has the same bits however the speech is cut."""

    @property
    def certain_until(self) -> float:
        """Seconds for which it is certain; at most `cospeech.rules.session.MOUTH_WAITS` behind what was pushed."""
        ...

    def push(self, samples: Array) -> None:
        """Hear (n,) more samples at 16 kHz, in -1 … 1."""
        ...

    def finish(self) -> None:
        """The speech is over: all of it becomes known; after its end the mouth stays as it is."""
        ...

    def at(self, times: Array) -> Array:
        """What speech does to the face at (T,) ascending seconds, which were never before those of the last call.

        Returns:
            (T, 52) ARKit weights in the order of `cospeech.motion.skeletons.arkit.ARKIT`; only jaw, mouth and tongue are looked
            at.
        """
        ...


@runtime_checkable
class Sharing(Protocol):
    """A mouth that can hear with what others hear, which saves it work."""

    def share(self, prosody: SharedProsody) -> None:
        """Asked once, before anything is pushed."""
        ...


@runtime_checkable
class WaitLimited(Protocol):
    """A mouth that can do with less speech ahead than it usually waits for."""

    def limit_wait(self, seconds: float) -> None:
        """Asked once, before anything is pushed: what was pushed so long ago must be certain.

        Raises:
            InputError: that is too short for it.
        """
        ...


def limit_wait(mouth: Mouth, seconds: float) -> None:
    """Make a mouth certain of what was pushed so many seconds ago.

    Raises:
        InputError: it cannot do that.
    """
    if not isinstance(mouth, WaitLimited):
        raise InputError("this mouth waits for more speech than a short look_ahead gives", "leave look_ahead out")
    mouth.limit_wait(seconds)


MouthMaker = Callable[[], Mouth]
"""Makes a mouth for every performance."""
