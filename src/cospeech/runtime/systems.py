"""Bundles of every kind, opened."""

from __future__ import annotations

from collections.abc import Callable

from ..errors import InputError
from . import chain_bundle, flow_bundle, window_bundle
from .bundle import Bundle
from .chain_bundle import open_chain
from .flow_bundle import open_flow
from .manifest import System
from .window_bundle import open_window

__all__ = ["open_system"]

_KINDS: dict[str, Callable[[Bundle], System]] = {
    flow_bundle.KIND: open_flow,
    window_bundle.KIND: open_window,
    chain_bundle.KIND: open_chain,
}


def open_system(bundle: Bundle) -> System:
    """What a bundle holds, ready to perform.

    Raises:
        InputError: the bundle is of no kind that is known, or its parts do not fit together.
    """
    kind = bundle.manifest.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise InputError(f"{bundle.name!r} holds a {str(kind)[:40]!r}", f"this version plays {', '.join(_KINDS)}")
    try:
        return _KINDS[kind](bundle)
    except InputError as error:
        if repr(bundle.name) in error.problem:
            raise
        raise InputError(f"{bundle.name!r}: {error.problem}", error.hint) from error
