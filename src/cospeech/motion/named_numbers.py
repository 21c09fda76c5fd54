"""Numbers that users write: one alone, and the grammar of mixtures, style controls and gains, ``calm:0.7,lively:0.3``."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

from ..errors import InputError

__all__ = ["NamedNumber", "read_named_numbers", "read_number"]


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
