"""Imports scipy for all metrics. It comes with the extra ``corpora``, not with the core; without it, an error says so."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import InputError, describe_extra

__all__ = ["scipy"]


def scipy(module: str) -> Any:
    """A module of scipy by name, ``"signal"`` or ``"cluster.vq"``; it is imported at the call.

    Raises:
        InputError: scipy is not installed.
    """
    try:
        return import_module(f"scipy.{module}")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "scipy":
            raise
        problem = "metrics and the statistics of movement need scipy"
        raise InputError(problem, describe_extra("corpora")) from None
