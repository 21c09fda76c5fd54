"""What every reader of a transcript gives: a text, and when it is said."""

from __future__ import annotations

from ..errors import InputError

__all__ = ["Entry", "read_time"]

Entry = tuple[str, float, float]
"""Text, start, end; times in seconds."""


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
