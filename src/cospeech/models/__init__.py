"""The systems that turn speech into motion: a registry, and what all of them can do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import InputError, nearest

if TYPE_CHECKING:
    from ..motion import Motion
    from ..speech import Speech

__all__ = ["DEFAULT", "MODELS", "NETWORKS", "PARTS", "Gesturer", "Performance", "load"]

MODELS: dict[str, str] = {"rules": "cospeech.rules:RuleGesturer"}
"""Name → ``module:Class``; `cospeech list models`, the documentation and the tests iterate over it."""

NETWORKS: dict[str, str] = {
    "stylised-flow": "cospeech.models.stylised_flow:StylisedFlow",
    "moglow": "cospeech.models.moglow:MoGlow",
    "gesture-autoencoder": "cospeech.models.gesture_autoencoder:GestureAutoencoder",
    "fgd-autoencoder": "cospeech.models.gesture_autoencoder:FgdAutoencoder",
}
"""Name → ``module:Class`` of what recipes train: networks of systems, and those whose features are for losses and metrics."""

DEFAULT = "rules"
"""The best that ships: what ``generate`` uses when no model is named."""

PARTS = ("face", "body", "hands")
"""What can be generated alone or together."""


class Performance(Protocol):
    """One take under way: speech goes in, piece by piece; motion comes out."""

    @property
    def emotion(self) -> dict[str, float]:
        """Probability of each emotion, over all that was heard."""
        ...

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """Hear the next piece; yields the motion that has become certain."""
        ...

    def finish(self) -> Iterator[Motion]:
        """The speech is over; yields the rest of the motion."""
        ...


class Gesturer(Protocol):
    """What every model offers; all three with the keywords style, emotion, seed, intensity, temperature, fps, parts.

    The same seed gives the same motion, and pieces joined are what ``generate`` gives: ceil(duration × fps) frames.
    """

    def generate(self, speech: Speech, **options: Any) -> Motion:
        """Motion for the whole speech."""
        ...

    def stream(self, chunks: Iterable[Speech], **options: Any) -> Iterator[Motion]:
        """The same, in pieces, as the speech comes in."""
        ...

    def session(self, **options: Any) -> Performance:
        """The same, for those who push."""
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
