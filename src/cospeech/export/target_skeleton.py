"""The skeleton that motion is brought to: one by name, or that of somebody's rig."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from ..errors import InputError, nearest
from ..motion.bone_mapping import names_joints, recognise
from ..motion.skeleton import Skeleton, find_skeleton
from ..motion.skeletons import SKELETONS
from ..motion.tpose import on_floor

__all__ = ["RIGS", "find_target", "rig_files"]

RIGS = (".bvh", ".glb", ".gltf", ".vrm")
"""Suffixes of files whose skeleton can be taken."""


def find_target(name: str | PathLike[str] | Skeleton, bones: Mapping[str, str] | None = None) -> Skeleton:
    """A skeleton to retarget to.

    Args:
        name: one of `cospeech.motion.skeletons.SKELETONS`, or a rig: a file with one of the suffixes `RIGS`. A BVH gives its
            skeleton, whatever its frames are; its T-pose stands on the floor at height 0.
        bones: our name → name of a joint of the BVH, where it is not recognised; a map of other names changes nothing.

    Raises:
        InputError: no skeleton and no file has that name, or the file has no skeleton that is recognised.

    >>> find_target("mixamo").names[0]
    'mixamorig:Hips'
    """
    if isinstance(name, Skeleton):
        return name
    if str(name) in SKELETONS:
        return find_skeleton(str(name))
    path = Path(name)
    if path.suffix.lower() not in RIGS:
        hint = f"{nearest(str(name), SKELETONS)}, or name a rig: {' '.join(RIGS)}"
        raise InputError(f"no skeleton is called {str(name)!r}", hint)
    if path.suffix.lower() != ".bvh":
        from .avatar import load_avatar

        return load_avatar(path).skeleton
    from .bvh_reader import load

    skeleton = load(path, bone_map=bones).skeleton
    try:
        names = recognise(skeleton, bones if bones and names_joints(bones, skeleton) else None)
    except InputError as error:
        raise InputError(f"{path.name!r}: {error.problem}", error.hint) from None
    return on_floor(skeleton, skeleton.index[names["hips"]])


def rig_files(skeleton: str | PathLike[str] | Skeleton | None) -> tuple[Path, ...]:
    """The file that `find_target` reads for a skeleton, if it reads one."""
    known = skeleton is None or isinstance(skeleton, Skeleton) or str(skeleton) in SKELETONS
    return () if known else (Path(skeleton),)  # type: ignore[arg-type]
