"""Who speaks, written before what is said: ``ANNA: Hello``, ``>> BOB: Hi``, ``Dr. Smith: …``. A name is not spoken."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

__all__ = ["drop_labels"]

# One to three words, each with a capital letter or a digit first; before it the signs of captions for another speaker
_LABEL = re.compile(r"\s*(?:>>+ ?|[-–—] ?)?((?:[^\W\d_][\w.'’-]{0,30}+)(?: [^\W_][\w.'’-]{0,30}+){0,2}) ?:(?=\s)")
_TWICE = 2  # [ours] what begins so many lines is a name, and no word such as "Remember:"


def drop_labels(lines: Sequence[str]) -> list[str]:
    """Lines of a transcript without the names of speakers.

    A label ends with a colon. It is in capitals, beside words that are not; or it begins two lines, each of its words with a
    capital letter.

    >>> drop_labels(["ANNA: Hello there.", "Remember: hands.", "Bob: Hi.", "Bob: Yes."])
    [' Hello there.', 'Remember: hands.', ' Hi.', ' Yes.']
    """
    found = [_LABEL.match(line) for line in lines]
    names = [match[1] if match is not None and _is_name(match[1]) else "" for match in found]
    count = Counter(names)
    kept = []
    for line, match, name in zip(lines, found, names, strict=True):
        rest = line[match.end() :] if match is not None else ""
        shouted = name.isupper() and any(letter.islower() for letter in rest)
        kept.append(rest if name and (shouted or count[name] >= _TWICE) else line)
    return kept


def _is_name(label: str) -> bool:
    return all(word[:1].isupper() or word[:1].isdigit() for word in label.split(" "))
