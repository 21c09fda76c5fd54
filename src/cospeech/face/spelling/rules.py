"""Ordered rules that turn the letters of a language into rough phones: how they are written, and how they are read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

__all__ = ["Rule", "Spelling", "compile_spelling", "read_letters", "read_plain"]

Rule = tuple[str, str, str, str]
"""Letters, phones, what must match before, what must match after; ``#`` and ``$`` are the ends of the word."""
_CONTEXT = 12  # letters before that a rule can look at; a word of any length then takes time in proportion to it [ours]


class Spelling(NamedTuple):
    """How a language is spelt."""

    rules: dict[str, list[tuple[str, tuple[str, ...], re.Pattern[str], re.Pattern[str]]]]
    """First letter → its rules, those of most letters first."""
    letters: frozenset[str]
    """Letters that the rules know; other letters lose their diacritics, and are looked up again."""
    whole: Mapping[str, str]
    """Whole words, also digits → phones."""
    vowels: str
    """Letters that may follow themselves: any other one sounds once."""


def read_plain(text: str) -> list[Rule]:
    """Rules without contexts.

    >>> read_plain("a=aa ñ=n+y h=")
    [('a', 'aa', '', ''), ('ñ', 'n y', '', ''), ('h', '', '', '')]
    """
    return [
        (letters, phones.replace("+", " "), "", "") for letters, _, phones in (each.partition("=") for each in text.split())
    ]


def compile_spelling(
    rules: Iterable[Rule], *, whole: Mapping[str, str] | None = None, digits: str = "", vowels: str = "aeiou"
) -> Spelling:
    """A spelling from its rules: at each place the first one that matches gives its phones, longer letters first.

    Args:
        rules: in order, among those of equally many letters.
        whole: words that the rules would misread → phones.
        digits: the names of 0 … 9 in this spelling; none: digits are not read.
        vowels: letters that may follow themselves.
    """
    table: dict[str, list[tuple[str, tuple[str, ...], re.Pattern[str], re.Pattern[str]]]] = {}
    for letters, phones, before, after in sorted(rules, key=lambda rule: -len(rule[0])):
        contexts = (re.compile(f"(?:{before})$"), re.compile(after))
        table.setdefault(letters[0], []).append((letters, tuple(phones.split()), *contexts))
    spelling = Spelling(table, frozenset(letter for own in table.values() for each in own for letter in each[0]), {}, vowels)
    names = {str(digit): " ".join(read_letters(name, spelling)) for digit, name in enumerate(digits.split())}
    return spelling._replace(whole={**names, **(whole or {})})


def read_letters(word: str, spelling: Spelling) -> list[str]:
    """The phones of the letters of a word, all of which the spelling knows."""
    phones: list[str] = []
    at = 0
    while at < len(word):
        if at and word[at] == word[at - 1] and word[at] not in spelling.vowels:  # a doubled consonant sounds once
            at += 1
            continue
        sofar = ("#" + word[:at])[-_CONTEXT:]
        for letters, sounds, before, after in spelling.rules.get(word[at], ()):
            # "#" stands before the word so that a left context can ask for its beginning
            if word.startswith(letters, at) and after.match(word, at + len(letters)) and before.search(sofar):
                phones += sounds
                at += len(letters)
                break
        else:
            at += 1
    return phones
