"""Names of speakers before the text: ``ANNA: Hello``, ``>> BOB: Hi``, ``Dr. Smith: …``. They are not spoken."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

__all__ = ["drop_labels", "split_labels"]

# A letter of a name, or a sign on one (Indic, Thai and Semitic vowels, accents), which Python's \w leaves out
_IN = r"[\w.'’·・\-\u0300-\u036f\u0591-\u05c7\u0610-\u061a\u064b-\u065f\u0900-\u0dff\u0e31-\u0e4e]"
# One to three words, each with a capital letter or a digit first, in a script that has capitals. Before them may stand the
# signs of captions for another speaker, or a sound in brackets; behind them how they are heard, as in NARRATOR (V.O.)
_LABEL = re.compile(
    rf"\s*(?P<sound>[(（\[［【][^()（）\[\]［］【】\n]{{0,40}}+[)）\]］】]\s*)?(?P<sign>>>+ ?|[-–—] ?)?"
    rf"(?P<name>[^\W\d_]{_IN}{{0,30}}+(?: [^\W_]{_IN}{{0,30}}+){{0,2}}) ?(?:[(（][^()（）\n]{{1,30}}[)）])?"
    r"[ \u00a0\u202f]?(?::(?=\s)|：)"
)
_MOST_UNCASED = 8  # letters of a name in a script without capitals, at most: more are a phrase [ours]
_TWICE = 2  # [ours] a label that begins so many lines is a name, and no word such as "Remember:"


def drop_labels(lines: Sequence[str]) -> list[str]:
    """Lines of a transcript without the names of speakers.

    A label ends with a colon. It is in capitals, beside words that are not; or stands behind ``>>``; or it begins two lines,
    each of its words with a capital letter, where the script has any.

    >>> drop_labels(["ANNA: Hello there.", "Remember: hands.", "Bob: Hi.", "Bob: Yes."])
    [' Hello there.', 'Remember: hands.', ' Hi.', ' Yes.']
    """
    return [rest for _, rest in split_labels(lines)]


def split_labels(lines: Sequence[str]) -> list[tuple[str, str]]:
    """The name of the speaker of each line, empty where it begins with none, and what is said; see `drop_labels`."""
    matches = [_LABEL.match(line) for line in lines]
    names = [match["name"] if match is not None and _is_name(match["name"]) else "" for match in matches]
    count = Counter(names)
    pairs = []
    for line, match, name in zip(lines, matches, names, strict=True):
        rest = (match["sound"] or "") + line[match.end() :] if match is not None else ""
        is_shouted = name.isupper() and any(letter.islower() for letter in rest)
        changes = match is not None and (match["sign"] or "").startswith(">>")
        is_label = name and (is_shouted or changes or count[name] >= _TWICE)
        pairs.append((name, rest) if is_label else ("", line))
    return pairs


def _is_name(label: str) -> bool:
    if label.lower() == label.upper():  # a script without capitals
        return len(label) <= _MOST_UNCASED
    return all(word[:1].isupper() or word[:1].isdigit() for word in label.split(" "))
