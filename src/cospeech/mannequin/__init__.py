"""The mannequin: our own character, sculpted by code, skinned to the humanoid, with the 52 ARKit expressions.

`build` gives the character as it ships; `sculpt` models it anew (some seconds, needs scipy). Facial movement is in the
morphs alone: the skeleton's ``jaw`` bone carries no weight, the eyeballs follow ``leftEye`` and ``rightEye``, and ``eyeLook*``
moves the lids.
"""

from __future__ import annotations

from functools import lru_cache

from .character import Character, Part, skin, skin_with_normals
from .volume import BodyVolume, Ellipsoid, Section, body_volume

__all__ = [
    "BodyVolume", "Character", "Ellipsoid", "Part", "Section", "body_volume", "build", "sculpt", "skin", "skin_with_normals",
]  # fmt: skip


@lru_cache(1)
def build() -> Character:
    """The character that ships with the package (some 20 ms the first time, then the same object)."""
    from .asset import load

    return load()


def sculpt() -> Character:
    """Model the character from nothing; see `cospeech.mannequin.modelling`."""
    from .modelling import sculpt

    return sculpt()
