"""The base of the configurations of all networks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

__all__ = ["ModelConfig"]


class ModelConfig:
    """Base of a network's configuration, which is a frozen dataclass."""

    TINY: ClassVar[Mapping[str, Any]] = {}
    """What makes the network so small that a step takes milliseconds; windows keep their length. For tests. [ours]"""

    @classmethod
    def tiny(cls, **changes: Any) -> Self:
        """The configuration of the small network, with ``changes``."""
        return cls(**{**cls.TINY, **changes})
