"""Laughter that a transcript tells of ("haha", "[laughter]"): a laughing face, and the smile that it leaves behind.

Sound alone does not decide here. Laughter comes in some five bursts per second (Bachorowski et al. 2001, J. Acoust. Soc. Am.
110), and so do syllables; a rule from rhythm, pitch and breath took 3 % of earnest recordings for laughter.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

import numpy as np

from ..audio.speech import Word
from ..motion.curves import smoothstep
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX

__all__ = ["AFTER", "LAUGHS", "laughter"]

AFTER = 1.4
"""Seconds in which a smile fades after laughter [ours]."""
_BEFORE = 0.18  # s before the sound at which the face begins to laugh [ours]
_HAHA = "|".join((  # syllables that are laughed; one vowel throughout, or German "hohe" (high) would laugh
    r"(?:a(?=-?ha)|e(?=-?he))?h(?P<latin>[aeio])h?(?:-?h(?P=latin)h?)+", r"j(?P<spanish>[aeio])(?:j(?P=spanish)){2,}j?",
    r"(?:а(?=ха)|э(?=хэ))?х(?P<cyrillic>[аеиоэ])(?:-?х(?P=cyrillic))+х?", r"χ(?P<greek>[αειο])(?:χ(?P=greek))+",
    "あは{2,}|アハ{2,}",
    "は{3,}|ハ{3,}|ひ{3,}|ヒ{3,}|へ{3,}|ヘ{3,}|ふ{3,}|フ{3,}|うふふ|えへへ", "哈{2,}|呵{2,}|嘻{2,}|笑{2,}",
    "하{2,}|히{2,}|호{2,}|ㅋ{2,}|ㅎ{2,}",
    "(?:هه+ه)|(?:ها){2,}", "ח{3,}", "(?:हा){2,}|(?:हे){2,}|(?:ही){2,}",
))  # fmt: skip
_EVENTS = "|".join((  # what transcribers write in brackets, where it is said outside them
    "laugh(?:s|ter|ing)?|chuckl(?:es?|ing)|giggl(?:es?|ing)", "lach(?:t|en|end)|gelächter|kicher(?:t|n)|gelach",
    "rires?|rit|rient",
    "risas?|ríen?", "risat[ae]|rid(?:e|ono)", "risos?|risadas?|riem?", "skratt(?:ar)?|latter|ler|naura[ua]",
    "śmiech|smích|gülme|gülüşmeler",
    "смех|смех[аи]|сме[её]тся|сміх", "γέλια|γελάει", "笑|笑い|笑う|笑い声|爆笑|大笑|笑声|笑聲", "웃음|웃음소리",
    "ضحك|يضحك|ضحكات",
    "צחוק|צוחקת?", "हँसी|हंसी",
))  # fmt: skip


def _fold(text: str) -> str:
    return unicodedata.normalize("NFKC", text.casefold())


_OPEN, _CLOSE = "[(<*【", "])>*】"
_LAUGH = re.compile(unicodedata.normalize("NFKC", _HAHA))
_EVENT = re.compile(unicodedata.normalize("NFKC", _EVENTS))
_BY_LANGUAGE = {"es": re.compile(r"j([aeio])(?:j\1)+j?"), "ja": re.compile("w{2,}"), "pt": re.compile("k{3,}|(?:rs){2,}")}
"""Spellings of laughter in one language only: in German, "jaja" is a word."""
_YES = frozenset({"af", "da", "de", "nl", "no", "sv"})  # there "ja" is yes, however often it is said
_AMOUNTS = {
    "mouthSmile": 0.95, "cheekSquint": 0.9, "eyeSquint": 0.3, "mouthUpperUp": 0.3, "mouthLowerDown": 0.15, "jawOpen": 0.16,
    "browOuterUp": 0.2, "browInnerUp": 0.2,
}  # fmt: skip
LAUGHS = np.zeros(len(ARKIT))
"""(52,) a laughing face: AU 6 + 12 + 25 + 26 (Ruch & Ekman 2001); the amounts are ours."""
for _name, _amount in _AMOUNTS.items():
    LAUGHS[[ARKIT_INDEX[n] for n in (_name, _name + "Left", _name + "Right") if n in ARKIT_INDEX]] = _amount


def _is_laugh(text: str, language: str) -> bool:
    word = _fold(text).rstrip(".!,~。！、")
    inside = word.strip(_OPEN + _CLOSE)
    if word[:1] in _OPEN and _EVENT.fullmatch(inside):
        return bool(inside)
    own = _BY_LANGUAGE.get(language)
    if own is not None and own.fullmatch(inside):
        return True
    return _LAUGH.fullmatch(inside) is not None and not (language in _YES and inside.startswith("j"))


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
