"""TextGrid of Praat, long or short: https://www.fon.hum.uva.nl/praat/manual/TextGrid_file_formats.html.

Aligners write several tiers: words, and the sounds that they are made of. Names tell which is which; where they do not, the
length of the labels does, and a note names the tier that was taken.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from ...errors import InputError
from ...limits import WORDS
from ..spoken_text import is_silence
from ..word_entries import Entry, Note

__all__ = ["fits", "read"]

# Names of tiers of words: of MFA, SPPAS (TokensAlign), WebMAUS (ORT-MAU), and as people of other languages call them
_WORDS = re.compile(
    r"word|wort|wört|\bmots?\b|palabra|palavra|parol[ae]|\bord\b|token|\bort\b|ortho?gra|слов|słow|\bslova|kelime|λέξ|λεξ"
    r"|单词|單詞|単語|단어|어절|词语|詞語|^[语語词詞]$|^分[词詞]$|كلم|מילים|शब्द",
    re.IGNORECASE,
)
# Names of tiers of smaller units, or of annotations that are not said
_NO_WORDS = re.compile(
    r"phon|seg|syl|silb|tone|tobi|break|pitch|point|gest|state|\bmau\b|\bkan\b|\bmas\b|laut|\bapi\b|\bipa\b|sampa"
    r"|\bsons?\b|stress|accent|wortart|klasse|sound|fonem|lemma|\bpos\b|pinyin|romaji|^音$|音素|音节|音節|音韻|拼音|음소|음절|звук",
    re.IGNORECASE,
)
_LONGEST_SOUND = 2  # letters of a label that may be a sound: "a", "u:", "AH0" counts its letters [ours]


class _Tier(NamedTuple):
    name: str
    entries: list[Entry]


def fits(text: str) -> bool:
    """Whether a text begins as a TextGrid does."""
    return "ooTextFile" in text.lstrip()[:400]


# "++", "*+": what was taken is not given back, so that each character is looked at once
_TOKEN = re.compile(r'"([^"]*+(?:""[^"]*+)*+)"|(<[a-z]++>)|![^\n]*+|[^\s"]++')
_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?$")


def read(text: str, note: Note) -> Iterator[Entry]:
    """The entries of the tier of words. Only free-standing numbers, quoted strings and <flags> count, as in Praat itself.

    Raises:
        InputError: it is no TextGrid, is cut off, or has no tier of intervals.
    """
    values: Iterator[str | float] = _praat_values(text)

    def take(kind: type) -> str | float:
        value = next(values, None)
        if value is None or not isinstance(value, kind):
            value_name = "its end" if value is None else repr(value)[:40]
            raise InputError(
                f"a TextGrid with {value_name} where a {'text' if kind is str else 'number'} belongs", "is it cut off?"
            )
        return value

    if (take(str), take(str)) != ("ooTextFile", "TextGrid"):
        raise InputError("not a TextGrid: no 'ooTextFile', 'TextGrid' at its head", "save it as text from Praat")
    take(float), take(float)
    if take(str) != "<exists>":
        raise InputError("a TextGrid without tiers", "add a word tier")
    tiers: list[_Tier] = []
    read = 0
    for _ in range(_count(take(float))):
        kind, name = str(take(str)), str(take(str))
        take(float), take(float)
        entries: list[Entry] = []
        for _ in range(_count(take(float))):
            read += 1
            if read > 4 * WORDS:  # a word and the sounds that it is made of
                raise InputError(f"a TextGrid of more than {4 * WORDS:,} entries", "cut it into pieces")
            start = float(take(float))
            end = float(take(float)) if kind == "IntervalTier" else start
            entries.append((str(take(str)), start, end))
        if kind == "IntervalTier":
            tiers.append(_Tier(name, entries))
    yield from _find_word_tier(tiers, note)


def _praat_values(text: str) -> Iterator[str | float]:
    for match in _TOKEN.finditer(text):
        if match[1] is not None:
            yield match[1].replace('""', '"')
        elif match[2]:
            yield match[2]
        elif _NUMBER.match(match[0]):
            yield float(match[0])


def _count(number: str | float) -> int:
    if not (isinstance(number, float) and 0 <= number < 1e8 and number == int(number)):
        raise InputError(f"a TextGrid that announces {number} entries", "is it damaged?")
    return int(number)


def _find_word_tier(tiers: Sequence[_Tier], note: Note) -> list[Entry]:
    """The tier called words (Wörter, mots, …); else of those not named after smaller things that with most labels.

    Tiers of which most labels have one or two letters are sounds, where another has longer ones.
    """
    if not tiers:
        raise InputError("a TextGrid without an interval tier", "words have a start and an end")
    count = {id(tier): sum(not is_silence(text) for text, _, _ in tier.entries) for tier in tiers}
    full = [tier for tier in tiers if count[id(tier)]] or list(tiers)
    words = [tier for tier in full if _WORDS.search(tier.name)]
    words = [tier for tier in words if not _NO_WORDS.search(tier.name)] or words
    others = [tier for tier in full if not _NO_WORDS.search(tier.name)] or full
    candidates = words or [tier for tier in others if not _holds_sounds(tier)] or others
    best = max(candidates, key=lambda tier: count[id(tier)])
    if len(candidates if words else full) > 1:
        names = ", ".join(repr(tier.name[:40]) for tier in full[:5])
        note(f"the words are those of the tier {best.name[:40]!r}, of {names}{' …' if len(full) > 5 else ''}")
    return best.entries


def _holds_sounds(tier: _Tier) -> bool:
    """Whether most labels have one or two letters. Han, kana, Hangul and Thai do not count: their words are as short."""
    labels = [text.strip() for text, _, _ in tier.entries if not is_silence(text)]
    short = sum(sum(map(str.isalpha, label)) <= _LONGEST_SOUND and max(label) < "\u0e00" for label in labels)
    return 2 * short > len(labels)
