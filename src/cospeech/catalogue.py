"""What there is, by kind: the tables behind ``cospeech list`` and the documentation, read from the registries themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import getdoc

from .errors import InputError, nearest

__all__ = ["CATALOGUES", "catalogue"]

Row = dict[str, str]


def _first_line(thing: object) -> str:
    return (getdoc(thing) or "").partition("\n")[0].rstrip(".")


def _registered(registry: Mapping[str, str]) -> list[Row]:
    """Rows of a registry of ``module:name``, described by the first line of the docstrings."""
    rows = []
    for name, where in registry.items():
        module, _, attribute = where.partition(":")
        rows.append({"name": name, "what": _first_line(getattr(import_module(module), attribute))})
    return rows


def _models() -> list[Row]:
    from .models import MODELS

    return _registered(MODELS)


def _styles() -> list[Row]:
    from .rules.styles import STYLES

    return [{"name": name, "what": style.what} for name, style in STYLES.items()]


def _emotions() -> list[Row]:
    from .rules.manners import EMOTIONS

    return [{"name": "auto", "what": "heard from the speech; the default"}] + [
        {"name": name, "what": f"{name}, whatever the speech sounds like"} for name in EMOTIONS
    ]


def _formats() -> list[Row]:
    from .export import FORMATS

    return [
        {"name": suffix, "what": entry.what, "access": "read and write" if entry.readable else "write"}
        for suffix, entry in FORMATS.items()
    ]


def _skeletons() -> list[Row]:
    from .skeletons import SKELETONS

    return [{"name": name, "what": _first_line(import_module(module))} for name, module in SKELETONS.items()]


def _metrics() -> list[Row]:
    from .metrics import METRICS

    return _registered(METRICS)


def _corpora() -> list[Row]:
    from .corpora import CORPORA

    return [
        {"name": name, "what": entry.what, "access": "read and write" if entry.writable else "read"}
        for name, entry in CORPORA.items()
    ]


CATALOGUES: dict[str, Callable[[], list[Row]]] = {
    "models": _models,
    "styles": _styles,
    "emotions": _emotions,
    "formats": _formats,
    "skeletons": _skeletons,
    "metrics": _metrics,
    "corpora": _corpora,
}
"""Kind → function that lists it."""


def catalogue(what: str) -> list[Row]:
    """Everything of a kind: rows with ``name`` and ``what`` (one line of description), in order of importance.

    Raises:
        InputError: there is no such kind.
    """
    if what not in CATALOGUES:
        raise InputError(f"cannot list {what!r}", nearest(what, CATALOGUES))
    return CATALOGUES[what]()
