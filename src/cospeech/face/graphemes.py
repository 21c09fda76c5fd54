"""Spelling → rough phones: enough to choose mouth shapes, not to pronounce. The tables are in `cospeech.face.spelling`."""

from __future__ import annotations

import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from functools import lru_cache

from ..audio.languages import LANGUAGES, script_of
from ..audio.word import Word
from ..errors import CospeechWarning
from .spelling.abugida_abjad import ARABIC, DEVANAGARI, HEBREW
from .spelling.cyrillic_greek import CYRILLIC, GREEK, RUSSIAN
from .spelling.east_asian import KANA, spell_hangul, to_katakana
from .spelling.english import ENGLISH
from .spelling.french import FRENCH
from .spelling.germanic import DUTCH, GERMAN
from .spelling.latin import LATIN, OWN_LATIN
from .spelling.romance import ITALIAN, PORTUGUESE, SPANISH
from .spelling.rules import Spelling, read_letters

__all__ = ["graphemes_to_phones", "note_unread_words"]

_LATIN = {
    "": ENGLISH, "en": ENGLISH, "de": GERMAN, "nl": DUTCH, "fr": FRENCH, "es": SPANISH, "it": ITALIAN, "pt": PORTUGUESE,
    **OWN_LATIN,
}  # fmt: skip
_SCRIPTS = {"Grek": GREEK, "Hebr": HEBREW, "Arab": ARABIC, "Deva": DEVANAGARI, "Kana": KANA}
_OF_LANGUAGE = {"el": "Grek", "he": "Hebr", "ar": "Arab", "hi": "Deva", "ja": "Kana", "ko": "Hang", "ru": "Cyrl"}
"""Languages whose digits are read in another script."""
_OTHER_CYRILLIC = frozenset({"be", "bg", "kk", "mk", "sr", "uk"})
_BASES = str.maketrans({"ø": "o", "đ": "d", "ð": "d", "þ": "t", "ł": "l", "æ": "ae", "œ": "oe", "ß": "ss", "ı": "i", "ħ": "h"})
"""Letters with a stroke and ligatures: Unicode does not take them apart, so they stand here."""
_LONGEST, _WHOLE = (
    64,
    256,
)  # letters of a part, and of a word; what is longer is none, and must not take long


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
    known = "".join(
        character if character in spelling.letters else unicodedata.normalize("NFKD", character.translate(_BASES))
        for character in text
    )
    return "".join(character for character in known if character in spelling.letters)


def _read(part: str, spelling: Spelling) -> list[str]:
    """Phones of letters of one script."""
    known = spelling.whole.get(part)
    return known.split() if known is not None else read_letters(_fold(part, spelling)[:_LONGEST], spelling)


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
            spelling = _LATIN.get(language, LATIN)
            for each in [part.strip("'")] if spelling is ENGLISH else part.split("'"):
                phones += _read(each, spelling)
        elif script == "Cyrl":
            phones += _read(part, CYRILLIC if language in _OTHER_CYRILLIC else RUSSIAN)
        elif script == "Hang":
            phones += spell_hangul(part)
        elif script in _SCRIPTS:
            phones += _read(to_katakana(part), _SCRIPTS[script])
        else:
            return ()
    return tuple(phones)


def note_unread_words(words: Sequence[Word] | None) -> None:
    """Tell, with a `CospeechWarning`, that most words of a speech say nothing about the lips."""
    words = [word for word in words or () if any(map(script_of, word.text))]
    unread = [word for word in words if not graphemes_to_phones(word.text, word.language)]
    if 2 * len(unread) > len(words):
        name = LANGUAGES.get(unread[0].language, "these words")
        problem = f"the spelling of {name} does not tell how {unread[0].text[:20]!r} sounds: lips follow the sound alone"
        warnings.warn(problem, CospeechWarning, stacklevel=3)
