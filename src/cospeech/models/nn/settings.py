"""Checks of the settings of networks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...errors import InputError

__all__ = ["check_least"]


def check_least(config: Any, what: str, low: Mapping[str, float]) -> None:
    """Check that numbers of a network's settings are at least as large as they must be.

    Args:
        config: the settings; or name → value of numbers, such as settings and the width of a pose.
        what: the network, for the message.
        low: field → the least that it may be.

    Raises:
        InputError: one is less, or no number.
    """
    values = config if isinstance(config, Mapping) else vars(config)
    for name, least in low.items():
        value = values[name]
        if not value >= least:
            raise InputError(f"{name} of {what} is {value}", f"{least} at least")
