"""Laughter that a transcript tells of ("haha", "[laughter]"): a laughing face, and the smile that it leaves behind.

Sound alone does not decide here. Laughter comes in some five bursts per second (Bachorowski et al. 2001, J. Acoust. Soc. Am.
110), and so do syllables; a rule from rhythm, pitch and breath took 3 % of earnest recordings for laughter.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

import numpy as np

from ..audio.laughter_words import is_laughed, names_laughter
from ..audio.speech import Word
from ..motion.curves import smoothstep
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX

__all__ = ["AFTER", "LAUGHS", "laughter"]

AFTER = 1.4
"""Seconds in which a smile fades after laughter [ours]."""
_BEFORE = 0.18  # s before the sound at which the face begins to laugh [ours]
_OPEN, _CLOSE = "[(<*【", "])>*】"
_AMOUNTS = {
    "mouthSmile": 0.95, "cheekSquint": 0.9, "eyeSquint": 0.3, "mouthUpperUp": 0.3, "mouthLowerDown": 0.15, "jawOpen": 0.16,
    "browOuterUp": 0.2, "browInnerUp": 0.2,
}  # fmt: skip
LAUGHS = np.zeros(len(ARKIT))
"""(52,) a laughing face: AU 6 + 12 + 25 + 26 (Ruch & Ekman 2001); the amounts are ours."""
for _name, _amount in _AMOUNTS.items():
    LAUGHS[[ARKIT_INDEX[n] for n in (_name, _name + "Left", _name + "Right") if n in ARKIT_INDEX]] = _amount


def _is_laugh(text: str, language: str) -> bool:
    word = unicodedata.normalize("NFKC", text).rstrip(".!,~。！、")
    inside = word.strip(_OPEN + _CLOSE)
    return names_laughter(inside) if word[:1] and word[0] in _OPEN else is_laughed(inside, language)


def laughter(times: Array, words: Sequence[Word]) -> Array:
    """Strength of laughter, and of the smile after it.

    Args:
        times: (T,) seconds.
        words: those from `AFTER` seconds before to `_BEFORE` after them; more do no harm.

    Returns:
        (T,) 0 … 1: 1 in laughter, fading within `AFTER`.
    """
    amount = np.zeros(len(times))
    for word in words:
        if _is_laugh(word.text, word.language):
            course = np.minimum((times - word.start + _BEFORE) / _BEFORE, (word.end + AFTER - times) / AFTER)
            amount = np.maximum(amount, course)
    return smoothstep(amount)
