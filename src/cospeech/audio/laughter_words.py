"""Words for laughter in many languages: its names, as transcribers write them in brackets, and syllables that are laughed."""

from __future__ import annotations

import re
import unicodedata

__all__ = ["is_laughed", "names_laughter"]


def _compile(pattern: str) -> re.Pattern[str]:
    return re.compile(unicodedata.normalize("NFKC", pattern))


_SYLLABLES = _compile("|".join((  # one vowel throughout, or German "hohe" (high) would laugh
    r"(?:a(?=-?ha)|e(?=-?he))?h(?P<latin>[aeio])h?(?:-?h(?P=latin)h?)+", r"j(?P<spanish>[aeio])(?:j(?P=spanish)){2,}j?",
    r"(?:а(?=ха)|э(?=хэ))?х(?P<cyrillic>[аеиоэ])(?:-?х(?P=cyrillic))+х?", r"χ(?P<greek>[αειο])(?:χ(?P=greek))+",
    "あは{2,}|アハ{2,}",
    "は{3,}|ハ{3,}|ひ{3,}|ヒ{3,}|へ{3,}|ヘ{3,}|ふ{3,}|フ{3,}|うふふ|えへへ", "哈{2,}|呵{2,}|嘻{2,}|笑{2,}",
    "하{2,}|히{2,}|호{2,}|ㅋ{2,}|ㅎ{2,}",
    "(?:هه+ه)|(?:ها){2,}", "ח{3,}", "(?:हा){2,}|(?:हे){2,}|(?:ही){2,}",
)))  # fmt: skip
_BY_LANGUAGE = {"es": re.compile(r"j([aeio])(?:j\1)+j?"), "ja": re.compile("w{2,}"), "pt": re.compile("k{3,}|(?:rs){2,}")}
"""Syllables of one language only: in German, "jaja" is a word."""
_YES = frozenset({"af", "da", "de", "nl", "no", "sv"})  # there "ja" is yes, however often it is said
# Names of laughter, or how they begin [ours: what subtitles of these languages write]
_NAMES = _compile(
    r"\b(?:laugh|chuckl|giggl|snicker|cackl|guffaw|lach(?:t|en|end|er)?\b|gelächter|kicher|rires?\b|rient\b|riant\b|rigol"
    r"|glouss|risas?\b|ríen?\b|ríe|carcajad|risos?\b|rindo\b|risadas?\b|gargalhad|risat[ae]\b|ridono\b|ridacchi|gelach"
    r"|skratt|śmi(?:ech|ej)|směje|smích|сме[хё]|смеют|смеет|хохо|хихик|смі[хє]|gül(?:me|er|üyor|üş)|kahkaha|γέλι|γελ[άώ]"
    r"|cười|tertawa|naur)"
    r"|(?<![微苦冷嘲])笑|웃음|웃는|웃으|ㅋㅋ|ضحك|צחוק|צוחק|हँस|हंस|หัวเราะ"
)
_NAMES_ALONE = _compile(r"\W*(?:latter|ler|ride|riem?|rit)\W*")  # which are other words in other languages [ours]
# Laughter of an audience: no face shows it [ours]
_OTHERS = _compile(r"audience|crowd|publi[ckq]|spectat|canned|観客|会場|观众|觀眾|зрител")
_TOKEN = re.compile(r"[^\s.,;:!?~。、！？]+")
_LONGEST = 200  # characters in brackets that are looked at [ours: names have up to five words]


def _fold(text: str) -> str:
    return unicodedata.normalize("NFKC", text.casefold())


def names_laughter(text: str) -> bool:
    """Whether a text in brackets says that who speaks laughs. Laughter of an audience does not count.

    >>> names_laughter("laughs"), names_laughter("haha!"), names_laughter("audience laughter"), names_laughter("sighs")
    (True, True, False, False)

    Args:
        text: what stands between the brackets.
    """
    text = _fold(text[:_LONGEST])
    is_named = _NAMES.search(text) is not None or _NAMES_ALONE.fullmatch(text) is not None
    return (is_named or any(map(_SYLLABLES.fullmatch, _TOKEN.findall(text)))) and not _OTHERS.search(text)


def is_laughed(word: str, language: str = "") -> bool:
    """Whether a word is laughed and not said, as "haha" is.

    >>> is_laughed("Hahaha"), is_laughed("jaja"), is_laughed("jaja", "es"), is_laughed("laughter")
    (True, False, True, False)

    Args:
        word: without signs around it.
        language: its code; empty if nobody knows it.
    """
    word, own = _fold(word), _BY_LANGUAGE.get(language)
    if own is not None and own.fullmatch(word):
        return True
    return _SYLLABLES.fullmatch(word) is not None and not (language in _YES and word.startswith("j"))
