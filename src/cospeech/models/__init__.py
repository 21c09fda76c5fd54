"""The systems that turn speech into motion: a registry, and what all of them can do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Protocol

from ..errors import InputError, nearest

if TYPE_CHECKING:
    from ..motion import Motion
    from ..speech import Speech

__all__ = ["DEFAULT", "MODELS", "PARTS", "Gesturer", "load"]

MODELS: dict[str, str] = {"rules": "cospeech.rules:RuleGesturer"}
"""Name → ``module:Class``; `cospeech list models`, the documentation and the tests iterate over it."""

DEFAULT = "rules"
"""The best that ships: what ``generate`` uses when no model is named."""

PARTS = ("face", "body", "hands")
"""What can be generated alone or together."""


class Gesturer(Protocol):
    """What every model offers. The same seed gives the same motion; the stream, joined, is what ``generate`` gives."""

    def generate(
        self,
        speech: Speech,
        *,
        style: str | Motion | None = None,
        emotion: str = "auto",
        seed: int = 0,
        intensity: float = 1.0,
        temperature: float = 1.0,
        fps: float = 30.0,
        parts: tuple[str, ...] = PARTS,
    ) -> Motion:
        """Motion for the whole speech: exactly ceil(duration × fps) frames."""
        ...

    def stream(
        self,
        chunks: Iterable[Speech],
        *,
        style: str | Motion | None = None,
        emotion: str = "auto",
        seed: int = 0,
        intensity: float = 1.0,
        temperature: float = 1.0,
        fps: float = 30.0,
        parts: tuple[str, ...] = PARTS,
    ) -> Iterator[Motion]:
        """The same, in pieces, as the speech comes in."""
        ...


def load(name: str = DEFAULT) -> Gesturer:
    """A model by its registry name.

    >>> type(load("rules")).__name__
    'RuleGesturer'

    Raises:
        InputError: there is no such model; the message names the nearest one.
    """
    if name not in MODELS:
        raise InputError(f"no model is called {name!r}", nearest(name, MODELS))
    module, _, attribute = MODELS[name].partition(":")
    model: Gesturer = getattr(import_module(module), attribute)()
    return model
