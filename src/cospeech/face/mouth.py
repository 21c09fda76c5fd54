"""Interfaces of a mouth that takes the place of the one that rules make, such as a learnt mouth."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from ..audio.features.shared_prosody import SharedProsody
from ..errors import InputError
from ..motion.rotations import Array

__all__ = ["Mouth", "MouthMaker", "Sharing", "WaitLimited", "limit_wait"]


class Mouth(Protocol):
    """The mouth of one speech, which comes in pieces. Its weights at a time have the same bits however the speech is cut."""

    @property
    def certain_until(self) -> float:
        """Seconds up to which its weights are certain: at most `cospeech.rules.session.MOUTH_WAITS` behind what was pushed."""
        ...

    def push(self, samples: Array) -> None:
        """Hear (n,) more samples at 16 kHz, in -1 … 1."""
        ...

    def finish(self) -> None:
        """The speech is over: all of it becomes known; after its end the mouth stays as it is."""
        ...

    def at(self, times: Array) -> Array:
        """Weights of the face at (T,) ascending seconds, none of them before those of the last call.

        Returns:
            (T, 52) ARKit weights in the order of `cospeech.motion.skeletons.arkit.ARKIT`; only jaw, mouth and tongue are used.
        """
        ...


@runtime_checkable
class Sharing(Protocol):
    """A mouth that can use the prosody that others compute, which saves work."""

    def share(self, prosody: SharedProsody) -> None:
        """Use this prosody; called once, before anything is pushed."""
        ...


@runtime_checkable
class WaitLimited(Protocol):
    """A mouth that can do with less speech ahead than it usually waits for."""

    def limit_wait(self, seconds: float) -> None:
        """Be certain of what was pushed so many seconds ago; called once, before anything is pushed.

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
