"""Parse numbers that users write: a number, a time, and mixtures, style controls and gains, ``calm:0.7,lively:0.3``."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

from ..errors import InputError

__all__ = ["NamedNumber", "read_named_numbers", "read_number", "read_seconds"]

_CLOCK = re.compile(
    r"(?:(\d{1,5}):(?=\d\d:))?(\d{1,5}):([0-5]\d(?:[.,]\d{0,9})?)", re.ASCII
)  # as players and subtitles show it
_UNITS = re.compile(r"(?=\d)(?:(\d{1,5})h)?(?:(\d{1,5})m)?(?:(\d{1,7}(?:\.\d{0,9})?)s?)?", re.ASCII)


class NamedNumber(NamedTuple):
    """One part of such a text."""

    name: str
    number: float | None
    """None if the part has no number."""
    text: str
    """The part as it was written."""


def read_number(text: str, problem: str, hint: str) -> float:
    """Parse a finite number.

    Args:
        text: what the user wrote.
        problem, hint: for the message.

    Raises:
        InputError: it is no finite number.
    """
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(problem, hint)
    return value


def read_seconds(text: str, problem: str, hint: str) -> float:
    """Parse a time in seconds: a number, a clock time, or hours, minutes and seconds with their letters.

    Letters are needed for minutes where a colon separates two times.

    >>> [read_seconds(text, "", "") for text in ("2230.5", "37:10.5", "1:02:03", "37m10s", "1h2m3", "5m")]
    [2230.5, 2230.5, 3723.0, 2230.0, 3723.0, 300.0]

    Args:
        text: what the user wrote.
        problem, hint: for the message.

    Raises:
        InputError: it is no time.
    """
    match = _CLOCK.fullmatch(text.strip()) or _UNITS.fullmatch(text.strip())
    if match is None:
        return read_number(text, problem, hint)
    hours, minutes, seconds = (float((part or "0").replace(",", ".")) for part in match.groups())
    return 3600 * hours + 60 * minutes + seconds


def read_named_numbers(
    text: str, *, number: str, of: str, hint: str, is_name: Callable[[str], bool] = lambda name: True
) -> list[NamedNumber]:
    """Parse parts between commas; each is ``NAME:NUMBER`` or ``NAME``. Blanks around them are ignored.

    >>> [part[:2] for part in read_named_numbers("calm:0.7, lively", number="weight", of="style", hint="")]
    [('calm', 0.7), ('lively', None)]

    Args:
        text: what the user wrote.
        number, of, hint: for the message: what the numbers are, of what, and which ones can be used.
        is_name: whether a text is a name. If the text before the last colon is no name, and no number follows the colon, the
            colon belongs to the name, as in a path.

    Raises:
        InputError: something other than a number follows a name.
    """
    parts = []
    for part in (part.strip() for part in text.split(",")):
        name, colon, value = (piece.strip() for piece in part.rpartition(":"))
        try:
            parts.append(NamedNumber(name, float(value), part) if colon else NamedNumber(part, None, part))
        except ValueError:
            if is_name(name):
                raise InputError(f"{number} {value[:60]!r} of {of} {name[:60]!r}", hint) from None
            parts.append(NamedNumber(part, None, part))
    return parts
