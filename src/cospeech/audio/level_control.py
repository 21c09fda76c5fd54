"""Level control: how much louder quiet speech must be made before a network hears it.

Networks are trained on speech of usual levels. Quiet speech, such as that of a far microphone, makes them move less: at 24 dB
less, the hands of the three that ship move .59 to .77 times as fast. So the level of loud syllables is followed, and a gain
brings it up. Speech of usual levels keeps its bits, but for its first syllable. Each row's gain follows from the rows up to it:
a stream has the gains of the whole.
"""

from __future__ import annotations

from math import exp, inf, log10

import numpy as np

from ..motion.rotations import Array

__all__ = ["MOST", "USUAL", "LevelControl"]

USUAL = -20.0
"""dB of full scale: loud syllables that are louder get no gain [ours: those of LJ Speech, JFK and an actress are at −20 to
−12 dB, of LibriVox at −25 to −18 dB]."""
MOST = 24.0
"""dB: the highest gain [ours: with more, the noise of a room becomes as loud as speech]."""
_SYLLABLE = 0.2  # s, the time constant that the power is smoothed with [ours: the length of a syllable]
_FALL = 0.25  # dB per second by which the level of loud syllables falls [ours: as `event_detection` lets it fall in pauses]
_RISE = 20.0  # dB per second of voice by which the gain rises [ours: a weak first word of loud speech changes little]
_VOICE = 0.5  # voicing from which a row is voice [that of `features.prosody`]


class LevelControl:
    """The gain of a speech that comes in pieces.

    Args:
        fps: rows per second.

    >>> control = LevelControl(20)
    >>> loud, voice = np.full(40, -15.0), np.ones(40)
    >>> float(control.follow(loud, voice)[-1]), float(control.follow(loud - 400, 0 * voice).max())
    (0.0, 0.0)
    """

    def __init__(self, fps: float) -> None:
        self._share = 1 - exp(-1 / (fps * _SYLLABLE))
        self._fall, self._rise = _FALL / fps, _RISE / fps
        self._power, self._level, self._gain = 0.0, -inf, 0.0

    def follow(self, energy: Array, voicing: Array) -> Array:
        """Give the gains of more rows.

        Args:
            energy: (n,) dB of full scale.
            voicing: (n,) 0 to 1, how surely there is voice.

        Returns:
            (n,) gains, dB, 0 to `MOST`.
        """
        gains = np.empty(len(energy))
        for row, (loud, voice) in enumerate(zip(energy.tolist(), voicing.tolist(), strict=True)):
            self._hear(loud, voice > _VOICE)
            gains[row] = self._gain
        return gains

    def _hear(self, energy: float, voiced: bool) -> None:
        self._power += self._share * (10 ** (energy / 10) - self._power)
        self._level -= self._fall
        if not voiced:
            return
        self._level = max(self._level, 10 * log10(self._power))
        target = min(max(USUAL - self._level, 0.0), MOST)
        self._gain = min(target, self._gain + self._rise)
