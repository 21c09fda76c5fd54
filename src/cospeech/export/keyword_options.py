"""Check the keywords of a format's ``Writer`` and ``load``."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ..errors import InputError, nearest

__all__ = ["check_options"]

_COMMON = ("skeleton", "fps")  # of every Writer; the motion gives them


def check_options(code: Callable[..., Any], options: Mapping[str, object], suffix: str, verb: str) -> None:
    """Check that options are keywords of a class or of a function.

    Args:
        code: a ``Writer`` or a ``load``.
        options: keyword → value.
        suffix: of the format; for the message.
        verb: for the message, such as ``"read"``.

    Raises:
        InputError: one is no keyword.
    """
    keywords = _keywords(code)
    for name in options:
        if keywords is not None and name not in keywords:
            own = sorted(set(keywords) - {*_COMMON} if isinstance(code, type) else keywords)
            raise InputError(
                f"a {suffix} file is {verb} without an option {name!r}", nearest(name, own) if own else "there are none"
            )


def _keywords(code: Callable[..., Any]) -> list[str] | None:
    """All keywords; None where any is accepted. A class that passes keywords on has those of its base class, too."""
    names = list[str]()
    for step in _constructors(code) if isinstance(code, type) else [code]:
        kinds = {name: parameter.kind for name, parameter in inspect.signature(step).parameters.items()}
        names += [name for name, kind in kinds.items() if kind is inspect.Parameter.KEYWORD_ONLY]
        if inspect.Parameter.VAR_KEYWORD not in kinds.values():
            return names
    return None


def _constructors(cls: type) -> Iterable[Callable[..., Any]]:
    return (vars(kind)["__init__"] for kind in cls.__mro__[:-1] if "__init__" in vars(kind))
