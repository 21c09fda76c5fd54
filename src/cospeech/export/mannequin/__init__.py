"""The mannequin: our own character, skinned to the humanoid, with the 52 ARKit expressions.

`build` gives the character as it ships; ``tools/mannequin`` sculpts it anew by code. Facial movement is in the morphs alone:
the skeleton's ``jaw`` bone carries no weight, the eyeballs follow ``leftEye`` and ``rightEye``, and ``eyeLook*`` moves the
lids.
"""

from __future__ import annotations

from functools import lru_cache

from .character import Character, Part, pose_surface, skin, skin_with_normals

__all__ = ["Character", "Part", "build", "pose_surface", "skin", "skin_with_normals"]


@lru_cache(1)
def build() -> Character:
    """The character that ships with the package (some 20 ms the first time, then the same object)."""
    from .asset import load

    return load()
