"""Entries, which every reader of a transcript gives: a text, and when it is said; and readers of times."""

from __future__ import annotations

import re
from collections.abc import Callable

from ..errors import InputError

__all__ = ["Entry", "Note", "check_number", "check_text", "read_clock", "read_google_time", "read_time"]

Entry = tuple[str, float, float]
"""Text, start, end; times in seconds."""
Note = Callable[[str], None]
"""Takes a message to the user about a file that is read in spite of a fault."""
_MOST = 1e15  # above what any unit of time needs [ours: ten years in ticks of 100 ns]; infinity is above it, too


def read_time(text: object) -> float:
    """A time in seconds; a decimal comma is read too.

    Raises:
        InputError: it is no number.
    """
    if isinstance(text, bool) or not isinstance(text, (str, int, float)):
        raise InputError(f"{str(text)[:40]!r} is not a time", "times are in seconds")
    try:
        return float(text.replace(",", ".") if isinstance(text, str) else text)
    except (ValueError, OverflowError):
        raise InputError(f"{str(text)[:40]!r} is not a time", "times are in seconds") from None


_SECONDS = re.compile(r"(\d{1,9}(?:\.\d{1,12})?)s")


def read_google_time(value: object) -> float:
    """As `read_time`; ``1.25s`` is read, too, as Google writes times.

    Raises:
        InputError: it is no time.
    """
    match = _SECONDS.fullmatch(value) if isinstance(value, str) else None
    return float(match[1]) if match else read_time(value)


_CLOCK = re.compile(r"\s*+(?:(\d{1,4}):)?(\d{1,4}):(\d{1,2})(?:[.,](\d{1,9})\d*+)?\s*+")


def read_clock(text: str) -> float | None:
    """Seconds of a clock time, hours:minutes:seconds or minutes:seconds; None for any other text, also with frames at its end.

    >>> read_clock("01:00:02,500"), read_clock("00:12.5"), read_clock("00:00:01:12")
    (3602.5, 12.5, None)
    """
    match = _CLOCK.fullmatch(text)
    if match is None:
        return None
    hours, minutes, seconds, fraction = match.groups()
    return int(hours or 0) * 3600 + int(minutes) * 60 + int(seconds) + float(f"0.{fraction or 0}")


def check_number(value: object, name: str, unit: str) -> float:
    """A number from 0 on, of a field.

    Args:
        value: of the field; None where there is none.
        name: of the field, for the message.
        unit: what the number counts, for the message.

    Raises:
        InputError: there is none, or it is no number, or below 0, or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not (0 <= value <= _MOST):
        problem = f"there is no {name}" if value is None else f"{name} is {str(value)[:40]}"
        raise InputError(problem, f"{unit}, 0 and more")
    return float(value)


def check_text(value: object, name: str, hint: str) -> str:
    """A text, of a field.

    Args:
        value: of the field; None where there is none.
        name: of the field, for the message.
        hint: of the message.

    Raises:
        InputError: there is none, or it is no text.
    """
    if not isinstance(value, str):
        raise InputError(f"there is no {name}" if value is None else f"{name} is {str(value)[:40]}", hint)
    return value
