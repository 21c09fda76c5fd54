"""The clothes: the body as it is seen, sculpted with the arms hanging."""

from __future__ import annotations

from cospeech.export.mannequin.character import Part

from .footwear import shoes
from .shirt import shirt
from .trousers import trousers

__all__ = ["clothes"]


def clothes() -> list[Part]:
    """All garments."""
    return [*shirt(), trousers(), *shoes()]
