"""The mannequin."""

from .character import Character, Part, skin, skin_with_normals

__all__ = ["Character", "Part", "build", "sculpt", "skin", "skin_with_normals"]


def sculpt():
    from ..skeleton import humanoid
    from .clothes import clothes
    from .hands import hands

    return Character(humanoid(), (*clothes(), *hands()))


build = sculpt
