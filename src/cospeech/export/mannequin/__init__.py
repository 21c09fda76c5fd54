"""The mannequin: our own character, skinned to the humanoid, with the 52 ARKit expressions.

`build` gives the character of the package; ``tools/mannequin`` sculpts it anew by code. Facial movement is in the morphs alone:
the skeleton's ``jaw`` bone carries no weight, the eyeballs follow ``leftEye`` and ``rightEye``, and ``eyeLook*`` moves the
lids.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from .character import Character, Part, pose_surface, skin, skin_with_normals

__all__ = ["Character", "Part", "build", "pose_surface", "skin", "skin_with_normals"]


# Linear RGB of the shirts of further persons in one picture, of the brightness of the first one [ours, by eye]: brick, mustard,
# plum, moss, slate
_SHIRTS = ((0.52, 0.16, 0.10), (0.46, 0.27, 0.06), (0.27, 0.11, 0.28), (0.17, 0.25, 0.09), (0.16, 0.18, 0.26))
_CLOTH = ("shirt", "pocket")
_BLUER = 1.25  # a vertex of these parts with so many times more blue than red is cloth; the vest and the buttons are white


@lru_cache(6)
def build(shirt: int = 0) -> Character:
    """The character that ships with the package (some 20 ms the first time, then the same object).

    Args:
        shirt: 0: as in the package; from 1 on: another colour, so that persons in one picture look different.
    """
    from .asset import load

    if not shirt:
        return load()
    character = build()
    return replace(character, parts=tuple(_dye(part, shirt) for part in character.parts))


def _dye(part: Part, shirt: int) -> Part:
    """The same part with cloth of another colour; each place keeps its brightness."""
    if part.name not in _CLOTH:
        return part
    colour = np.array(part.colour, np.float32)
    cloth = colour[:, 2] > _BLUER * colour[:, 0]
    brightness = colour[cloth].mean(1, keepdims=True)
    target = np.array(_SHIRTS[(shirt - 1) % len(_SHIRTS)], np.float32)
    colour[cloth] = brightness * target / target.mean()
    return replace(part, colour=colour)
