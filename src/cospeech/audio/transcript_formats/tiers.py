"""Tiers of a file of annotations: which of them holds the words.

Aligners and annotators write several tiers: words, the sounds that they are made of, gestures. The user names the tier that
counts. Else names tell which is which; where they do not, the length of the labels does, and a note names the tier that was
taken.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from ...errors import InputError, nearest
from ..spoken_text import is_silence
from ..word_entries import Entry, Note

__all__ = ["Tier", "find_tier", "find_word_tier"]

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
# Names of tiers of sentences, which count where no tier is called words
_SPEECH = re.compile(r"speech|transcri|utter|spoken|sprache|transkri|discours|habla|fala|\btext", re.IGNORECASE)
_MOST_NAMES = 12  # tiers in a message [ours]
_LONGEST_SOUND = 2  # letters of a label that may be a sound: "a", "u:", "AH0" counts its letters [ours]


class Tier(NamedTuple):
    """A tier of annotations with a start and an end."""

    name: str
    entries: list[Entry]

    @property
    def label_count(self) -> int:
        """How many annotations are more than silence."""
        return sum(not is_silence(text) for text, _, _ in self.entries)


def find_tier(tiers: Sequence[Tier], name: str) -> list[Entry]:
    """The entries of the tier that the user names; capital and small letters are the same where no other tier is called so.

    Raises:
        InputError: no tier is called so, several are, or it has no words.
    """
    key = name.strip()
    same = [tier for tier in tiers if tier.name.strip() == key]
    same = same or [tier for tier in tiers if tier.name.strip().casefold() == key.casefold()]
    if len(same) == 1 and same[0].label_count:
        return same[0].entries
    names = [tier.name.strip()[:40] for tier in tiers if tier.label_count][:_MOST_NAMES]
    if not same:
        raise InputError(f"no tier is called {key[:40]!r}", nearest(key[:40], names) if names else "no tier has labels")
    if len(same) > 1:
        raise InputError(f"{len(same)} tiers are called {key[:40]!r}", f"rename one; the tiers are {', '.join(names)}")
    raise InputError(f"the tier {key[:40]!r} has no words", f"those with labels: {', '.join(names) or 'none'}")


def find_word_tier(tiers: Sequence[Tier], note: Note) -> list[Entry]:
    """The tier called words (Wörter, mots, …), else speech; else of those not named after smaller things that with most labels.

    Tiers of which most labels have one or two letters are sounds, where another has longer ones.
    """
    counts = {id(tier): tier.label_count for tier in tiers}
    full = [tier for tier in tiers if counts[id(tier)]] or list(tiers)
    words = [tier for tier in full if _WORDS.search(tier.name)]
    words = [tier for tier in words if not _NO_WORDS.search(tier.name)] or words
    others = [tier for tier in full if not _NO_WORDS.search(tier.name)] or full
    speech = [tier for tier in others if _SPEECH.search(tier.name)]
    candidates = words or speech or [tier for tier in others if not _holds_sounds(tier)] or others
    best = max(candidates, key=lambda tier: counts[id(tier)])
    if len(candidates if words else full) > 1:
        names = ", ".join(repr(tier.name[:40]) for tier in full[:5])
        others_named = f"of {names}{' …' if len(full) > 5 else ''}"
        note(f"the words are those of the tier {best.name[:40]!r}, {others_named}; --transcript-tier NAME takes another")
    return best.entries


def _holds_sounds(tier: Tier) -> bool:
    """Whether most labels have one or two letters. Han, kana, Hangul and Thai do not count: their words are as short."""
    labels = [text.strip() for text, _, _ in tier.entries if not is_silence(text)]
    short = sum(sum(map(str.isalpha, label)) <= _LONGEST_SOUND and max(label) < "\u0e00" for label in labels)
    return 2 * short > len(labels)
