"""Numbers that users write: one, a time, and the grammar of mixtures, style controls and gains, ``calm:0.7,lively:0.3``."""

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
    """One part."""

    name: str
    number: float | None
    """None where none is said."""
    text: str
    """As it stood there."""


def read_number(text: str, problem: str, hint: str) -> float:
    """A finite number.

    Args:
        text: what the user said.
        problem, hint: for the message.

    Raises:
        InputError: it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(problem, hint)
    return value


def read_seconds(text: str, problem: str, hint: str) -> float:
    """A time in seconds: a number, a clock, or hours, minutes and seconds with their letters.

    Where a colon parts two times, only the letters can say minutes.

    >>> [read_seconds(text, "", "") for text in ("2230.5", "37:10.5", "1:02:03", "37m10s", "1h2m3", "5m")]
    [2230.5, 2230.5, 3723.0, 2230.0, 3723.0, 300.0]

    Args:
        text: what the user said.
        problem, hint: for the message.

    Raises:
        InputError: it is none.
    """
    found = _CLOCK.fullmatch(text.strip()) or _UNITS.fullmatch(text.strip())
    if found is None:
        return read_number(text, problem, hint)
    hours, minutes, seconds = (float((part or "0").replace(",", ".")) for part in found.groups())
    return 3600 * hours + 60 * minutes + seconds


def read_named_numbers(
    text: str, *, number: str, of: str, hint: str, is_name: Callable[[str], bool] = lambda name: True
) -> list[NamedNumber]:
    """Parts between commas; each is ``NAME:NUMBER`` or ``NAME``. Blanks around either mean nothing.

    >>> [part[:2] for part in read_named_numbers("calm:0.7, lively", number="weight", of="style", hint="")]
    [('calm', 0.7), ('lively', None)]

    Args:
        text: what the user said.
        number, of, hint: for the message: what the numbers are, of what, and which ones can be used.
        is_name: whether something is a name; where what stands before a last colon is none, and no number follows, the colon is
            one of the name itself, as in a path.

    Raises:
        InputError: something else than a number follows a name.
    """
    found = []
    for part in (part.strip() for part in text.split(",")):
        name, colon, said = (piece.strip() for piece in part.rpartition(":"))
        try:
            found.append(NamedNumber(name, float(said), part) if colon else NamedNumber(part, None, part))
        except ValueError:
            if is_name(name):
                raise InputError(f"{number} {said[:60]!r} of {of} {name[:60]!r}", hint) from None
            found.append(NamedNumber(part, None, part))
    return found
