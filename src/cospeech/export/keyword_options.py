"""The keywords that a format's ``Writer`` and ``load`` have beyond those of all formats, and what is said about others."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ..errors import InputError, nearest

__all__ = ["check_options"]

_COMMON = ("skeleton", "fps")  # of every Writer: what is written says them


def check_options(code: Callable[..., Any], options: Mapping[str, object], suffix: str, verb: str) -> None:
    """The options are keywords of a class or of a function.

    Args:
        code: a ``Writer`` or a ``load``.
        options: keyword → value.
        suffix: of the format; for the message.
        verb: what is done with the file, such as ``"read"``; for the message.

    Raises:
        InputError: one is not.
    """
    known = _keywords(code)
    for name in options:
        if known is not None and name not in known:
            own = sorted(set(known) - {*_COMMON} if isinstance(code, type) else known)
            raise InputError(
                f"a {suffix} file is {verb} without an option {name!r}", nearest(name, own) if own else "there are none"
            )


def _keywords(code: Callable[..., Any]) -> list[str] | None:
    """All keywords; None where any will do. What a class passes on is that of the class it is made from."""
    found = list[str]()
    for step in _constructors(code) if isinstance(code, type) else [code]:
        kinds = {name: parameter.kind for name, parameter in inspect.signature(step).parameters.items()}
        found += [name for name, kind in kinds.items() if kind is inspect.Parameter.KEYWORD_ONLY]
        if inspect.Parameter.VAR_KEYWORD not in kinds.values():
            return found
    return None


def _constructors(made: type) -> Iterable[Callable[..., Any]]:
    return (vars(kind)["__init__"] for kind in made.__mro__[:-1] if "__init__" in vars(kind))
