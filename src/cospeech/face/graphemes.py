"""Spelling → rough phones: enough to choose mouth shapes, not to pronounce. The tables are in `cospeech.face.spelling`."""

from __future__ import annotations

import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from functools import cache, lru_cache
from importlib import import_module
from typing import Any

from ..audio.languages import LANGUAGES, script_of
from ..audio.word import Word
from ..errors import CospeechWarning
from .spelling.rules import Spelling, read_letters

__all__ = ["graphemes_to_phones", "note_unread_words"]

# Each table is made when the first word needs it: to make all of them takes as long as the rest of the face.
_LATIN = {
    "": "english:ENGLISH", "en": "english:ENGLISH", "de": "germanic:GERMAN", "nl": "germanic:DUTCH", "fr": "french:FRENCH",
    "es": "romance:SPANISH", "it": "romance:ITALIAN", "pt": "romance:PORTUGUESE",
}  # fmt: skip
"""Language in Latin letters → module and name of its table; others are in `cospeech.face.spelling.latin`."""
_SCRIPTS = {
    "Grek": "cyrillic_greek:GREEK", "Hebr": "abugida_abjad:HEBREW", "Arab": "abugida_abjad:ARABIC",
    "Deva": "abugida_abjad:DEVANAGARI", "Kana": "east_asian:KANA",
}  # fmt: skip
_OF_LANGUAGE = {"el": "Grek", "he": "Hebr", "ar": "Arab", "hi": "Deva", "ja": "Kana", "ko": "Hang", "ru": "Cyrl"}
"""Languages whose digits are read in another script."""
_OTHER_CYRILLIC = frozenset({"be", "bg", "kk", "mk", "sr", "uk"})
_BASES = str.maketrans({"ø": "o", "đ": "d", "ð": "d", "þ": "t", "ł": "l", "æ": "ae", "œ": "oe", "ß": "ss", "ı": "i", "ħ": "h"})
"""Letters with a stroke and ligatures: Unicode does not take them apart, so they stand here."""
_LONGEST, _WHOLE = 64, 256  # letters read of a part, and of a word: longer text is no word, and must not take long


@cache
def _find(name: str) -> Any:
    """The object ``module:name`` of `cospeech.face.spelling`."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(f".spelling.{module}", __package__), attribute)


def _find_latin(language: str) -> Spelling:
    """The spelling of a language in Latin letters."""
    own = _LATIN.get(language)
    spelling: Spelling = _find("latin:OWN_LATIN").get(language, _find("latin:LATIN")) if own is None else _find(own)
    return spelling


def _split(text: str) -> Iterator[tuple[str, str]]:
    """(script, letters) of a word; the script of a digit is ``""``. An apostrophe belongs to Latin letters."""
    script, part = "", ""
    for character in text:
        own = script_of(character) or ("Latn" if character == "'" else script if unicodedata.combining(character) else "")
        if own != script or not own:
            if part and script:
                yield script, part
            script, part = own, ""
            if character.isdecimal():
                yield "", str(unicodedata.decimal(character))
        if own:
            part += character
    if part and script:
        yield script, part


def _fold(text: str, spelling: Spelling) -> str:
    """The text in letters that a spelling knows: others lose their diacritics, or are dropped."""
    letters = "".join(
        character if character in spelling.letters else unicodedata.normalize("NFKD", character.translate(_BASES))
        for character in text
    )
    return "".join(character for character in letters if character in spelling.letters)


def _read(part: str, spelling: Spelling) -> list[str]:
    """Phones of letters of one script."""
    phones = spelling.whole.get(part)
    return phones.split() if phones is not None else read_letters(_fold(part, spelling)[:_LONGEST], spelling)


@lru_cache(maxsize=4096)
def graphemes_to_phones(word: str, language: str = "") -> tuple[str, ...]:
    """Rough phones of one written word, as lower-case ARPAbet names without stress.

    Other letters than Latin ones are read by the rules of their script; digits one by one. A word with a sign that does not say
    how it sounds, as Chinese ones do not, gives ``()``; so does a script that has no rules here.

    Args:
        word: as it is written, in any normal form of Unicode.
        language: of the word, see `cospeech.audio.languages`; without it, Latin letters are read as English.

    >>> graphemes_to_phones("bishop")
    ('b', 'ih', 'sh', 'aa', 'p')
    >>> graphemes_to_phones("will"), graphemes_to_phones("will", "de")
    (('w', 'ih', 'l'), ('v', 'ih', 'l'))
    >>> graphemes_to_phones("мама"), graphemes_to_phones("媽媽")
    (('m', 'aa', 'm', 'aa'), ())
    """
    text = unicodedata.normalize("NFKC", word[:_WHOLE].lower()).replace("’", "'")
    phones: list[str] = []
    for script, part in _split(text):
        script = script or _OF_LANGUAGE.get(language, "Latn")
        if script == "Latn":
            for each in [part.strip("'")] if language in ("", "en") else part.split("'"):
                phones += _read(each, _find_latin(language))
        elif script == "Cyrl":
            phones += _read(part, _find(f"cyrillic_greek:{'CYRILLIC' if language in _OTHER_CYRILLIC else 'RUSSIAN'}"))
        elif script == "Hang":
            phones += _find("east_asian:spell_hangul")(part)
        elif script in _SCRIPTS:
            part = _find("east_asian:to_katakana")(part) if script == "Kana" else part
            phones += _read(part, _find(_SCRIPTS[script]))
        else:
            return ()
    return tuple(phones)


def note_unread_words(words: Sequence[Word] | None) -> None:
    """Warn (`CospeechWarning`) if most words of a speech say nothing about the lips."""
    words = [word for word in words or () if any(map(script_of, word.text))]
    unread = [word for word in words if not graphemes_to_phones(word.text, word.language)]
    if 2 * len(unread) > len(words):
        name = LANGUAGES.get(unread[0].language, "these words")
        problem = f"the spelling of {name} does not tell how {unread[0].text[:20]!r} sounds: lips follow the sound alone"
        warnings.warn(problem, CospeechWarning, stacklevel=3)
