"""The base of the configurations of all networks, and the settings of training at small scale."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

__all__ = ["SMALL_CONVOLUTIONS", "SMALL_FLOW", "SMALL_RECURRENT", "ModelConfig"]

SMALL_FLOW: Mapping[str, Any] = {"steps": 400, "batch": 48, "warmup": 100, "validate_every": 0, "save_every": 100}
"""[train] of flows and feature networks at small scale. [ours] A row and seed train in two or three minutes on one core."""
SMALL_RECURRENT: Mapping[str, Any] = {"steps": 600, "batch": 32, "lr": 1e-3, "validate_every": 0, "save_every": 600}
"""The same for recurrent networks of windows. [ours] About a minute."""
SMALL_CONVOLUTIONS: Mapping[str, Any] = {"steps": 400, "batch": 16, "lr": 2e-3, "validate_every": 0, "save_every": 400}
"""The same for convolutions. [ours] All have one rate: at the 1e-4 of Speech2Gesture and MUNIT so few steps teach nothing."""


class ModelConfig:
    """Base of a network's configuration, which is a frozen dataclass."""

    TINY: ClassVar[Mapping[str, Any]] = {}
    """Settings of a network so small that a step takes milliseconds; windows keep their length. For tests. [ours]"""
    SMALL: ClassVar[Mapping[str, Any]] = {}
    """Settings that ``--small`` of a table changes in [model]; ``name`` replaces the network. It shows that a recipe works, and
    the order of the systems; its figures are not those of the paper's system. [ours]"""
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = {}
    """Settings that ``--small`` changes in [train]."""

    @classmethod
    def tiny(cls, **changes: Any) -> Self:
        """The configuration of the small network, with ``changes``."""
        return cls(**{**cls.TINY, **changes})
