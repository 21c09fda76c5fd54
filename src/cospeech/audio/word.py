"""A word of a speech."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isfinite

import numpy as np

from ..errors import InputError

__all__ = ["LAUGHTER", "Word", "check_words", "is_spoken"]

_CODE = re.compile(r"(?:[a-z]{2,3})?")  # primary subtags of BCP 47
LAUGHTER = "[laughter]"
"""Text of a `Word` that is a laugh: it is heard, and not said."""


def is_spoken(text: str) -> bool:
    """Whether the text of a word is said. A text in square brackets is only heard, as laughter is: it has no meaning.

    >>> is_spoken("laughter"), is_spoken(LAUGHTER)
    (True, False)
    """
    return not (text.startswith("[") and text.endswith("]"))


@dataclass(frozen=True, slots=True)
class Word:
    """A word and when it is spoken, in seconds from the start of the speech.

    A sound that is no word, such as laughter, is a `Word`, too: its text is in square brackets (`is_spoken`). At `LAUGHTER`,
    the face laughs.
    """

    text: str
    start: float
    end: float
    language: str = ""
    """Primary subtag of BCP 47, see `cospeech.audio.languages`; ``""``: not known, Latin letters are read as English."""


def check_words(words: object) -> None:
    """Check the words of a speech.

    Raises:
        InputError: one is no `Word`, has no text, or its times are no times.
    """
    if words is None:
        return
    for word in words if isinstance(words, tuple | list) else (words,):
        if not isinstance(word, Word) or not isinstance(word.text, str):
            raise InputError(f"{str(word)[:60]!r} among the words of a speech", 'Word("huge", 0.5, 0.9)')
        if not isinstance(word.language, str) or not _CODE.fullmatch(word.language):
            raise InputError(f"the word {word.text[:40]!r} in the language {str(word.language)[:40]}", 'a code, such as "de"')
        times = word.start, word.end
        if not all(isinstance(time, int | float | np.number) and isfinite(time) for time in times) or word.end < word.start:
            raise InputError(f"the word {word.text[:40]!r} from {times[0]} to {times[1]}", "seconds, and the start first")
