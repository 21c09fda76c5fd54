"""The spoken words of a text, without what is only heard: signs in brackets, sounds between asterisks, music, tags.

A laugh stays as `LAUGHTER`, because the face shows it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from ..errors import InputError
from ..limits import WORDS
from .forced_alignment import tokenise
from .laughter_words import names_laughter
from .word import LAUGHTER

__all__ = ["is_silence", "list_tokens"]

_SILENCES = frozenset({"sil", "sp", "spn", "pau", "eps", "silence", "#", "_", "-"})  # of HTK, MFA, Festival, MAUS
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")  # words are printed: no escape codes for terminals
_VARIANT = re.compile(r"(?<=\w)\(\d+\)$")  # CMU dictionaries number pronunciations: "and(2)"
# What is heard but not spoken: <sil>, {SL}, [laughter], (sighs), also in the brackets of Chinese and Japanese; *coughs*; ♪
_NOT_SPOKEN = re.compile(
    r"<[^<>\s][^<>]*>|\{[^{}]*\}|[\[［【〔](?P<square>[^\[\]［］【】〔〕]*)[\]］】〕]|[(（](?P<round>[^()（）]*)[)）]"
    r"|\*(?P<stars>[^*\n]{1,60})\*|[♩♪♫♬🎵🎶]"
)
_FEW = 3  # most words in round brackets of a plain text for a sound; more are an aside, which is read aloud [ours]
_RELATIVE = re.compile(r"(?:who|that|which|where|when|if|as)\s", re.IGNORECASE)  # begins a clause, which is no sound [ours]
# What is written between asterisks, and is a sound; any other word there is said louder [ours]
_SOUNDS = re.compile(
    r"\W*(?:\w+ )?(?:(?:sigh|cough|gasp|sneez|sniff|sob|groan|moan|yawn|clap|whistl|inhal|exhal)"
    r"(?:e|es|s|ed|ing|bing|bed|ping|ped)?|cries|crying|breathes?|breathing|applause|applauds|applauding|music"
    r"|clears (?:\w+ )?throat|seufz(?:t|en)|hust(?:et|en)"
    r"|räuspert(?: sich)?|schnief(?:t|en)|nies(?:t|en)|gähn(?:t|en)|soupirs?|soupire|tousse|toux|suspir[ao]|tose|aplausos?"
    r"|sospir[ao]|tossisce)(?: \w+)?\W*",
    re.IGNORECASE,
)
_SIGNS = re.compile(r"\s*([^\w\s]+)")


def list_tokens(text: str, *, prose: bool = False) -> list[str]:
    """The tokens of a text that are said, and a `LAUGHTER` for each laugh between them.

    >>> list_tokens("Hello [laughter]. It's (sighs) <i>huge</i>, *really*.")
    ['Hello.', '[laughter]', "It's", 'huge,', '*really*.']

    Args:
        text: of an entry of a transcript, or the whole of one without times.
        prose: it is a text that somebody reads: round brackets with more than three words in them are read, too.

    Raises:
        InputError: there are too many tokens.
    """
    if not text:
        return []
    text = _VARIANT.sub("", _CONTROL.sub(" ", text).strip())
    if is_silence(text):
        return []
    tokens: list[str] = []
    for number, piece in enumerate(_split_laughs(text, prose)):
        if number and tokens[-1:] != [LAUGHTER]:
            signs = _SIGNS.match(piece)
            if signs and tokens:
                tokens[-1] += signs[1]
            tokens.append(LAUGHTER)
        tokens += tokenise(piece)
        if len(tokens) > WORDS:
            raise InputError(f"a transcript of more than {WORDS:,} words", "cut it into pieces")
    return tokens


def is_silence(text: str) -> bool:
    """Whether a label stands for a silence: "sil", "#", nothing."""
    return not text.strip() or text.strip().lower() in _SILENCES


def _split_laughs(text: str, prose: bool) -> Iterator[str]:
    """The spoken text before, between and behind the laughs."""
    parts, last = list[str](), 0
    for match in _NOT_SPOKEN.finditer(text):
        stars, aside = match["stars"], match["round"]
        inside = match["square"] or aside or stars or ""
        laughs = names_laughter(inside)
        if stars is not None and not laughs and not _SOUNDS.fullmatch(stars):
            continue
        if prose and aside is not None and (len(aside.split()) > _FEW or _RELATIVE.match(aside)):
            continue
        parts.append(text[last : match.start()])
        last = match.end()
        if laughs:
            yield " ".join(parts)
            parts = []
    yield " ".join([*parts, text[last:]])
