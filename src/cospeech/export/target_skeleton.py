"""Find the skeleton to which motion is retargeted: one by name, or that of somebody's rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path

from ..errors import InputError, nearest
from ..motion.bone_map_checks import check_fit
from ..motion.bone_mapping import names_joints, recognise, recognise_file
from ..motion.skeleton import Skeleton, find_skeleton
from ..motion.skeletons import SKELETONS
from ..motion.tpose import on_floor
from .character_files import CHARACTERS, read_character

__all__ = ["RIGS", "find_target", "read_target", "rig_files", "rig_joints"]

RIGS = (".bvh", *CHARACTERS)
"""Suffixes of files whose skeleton can be read."""


def find_target(name: str | PathLike[str] | Skeleton, bones: Mapping[str, str] | None = None) -> Skeleton:
    """Find a skeleton to retarget to.

    Args:
        name: one of `cospeech.motion.skeletons.SKELETONS`, or a rig: a file with one of the suffixes `RIGS`. A BVH gives its
            skeleton, whatever its frames are; its T-pose stands on the floor at height 0.
        bones: our name → name of a joint; it overrides what is recognised.

    Raises:
        InputError: no skeleton and no file has that name, the file has no skeleton that is recognised, or the map names joints
            that it lacks.

    >>> find_target("mixamo").names[0]
    'mixamorig:Hips'
    """
    target = read_target(name, bones)
    if bones:
        check_fit(bones, {repr(name.kind if isinstance(name, Skeleton) else str(name)): rig_joints(name, target)})
    return target


def read_target(name: str | PathLike[str] | Skeleton, bones: Mapping[str, str] | None = None) -> Skeleton:
    """As `find_target`; a map of other joints changes nothing."""
    if isinstance(name, Skeleton) or str(name) in SKELETONS:
        target = name if isinstance(name, Skeleton) else find_skeleton(str(name))
        return replace(target, bone_map=recognise(target, bones)) if bones and names_joints(bones, target) else target
    path = Path(name)
    if path.suffix.lower() not in RIGS:
        hint = f"{nearest(str(name), SKELETONS)}, or name a rig: {' '.join(RIGS)}"
        raise InputError(f"no skeleton is called {str(name)!r}", hint)
    if path.suffix.lower() != ".bvh":
        from .avatar import read_avatar

        avatar = read_avatar(path, bones)
        if not avatar.rig.bones:
            raise InputError(
                f"{avatar.file.name} has no bones to carry motion to", "it holds a face alone; as an avatar it plays"
            )
        return avatar.skeleton
    from .bvh_reader import load

    skeleton = load(path, bone_map=bones).skeleton
    names = recognise_file(skeleton, None, repr(path.name), bones)
    return on_floor(skeleton, skeleton.index[names["hips"]])


def rig_joints(name: str | PathLike[str] | Skeleton, skeleton: Skeleton) -> tuple[str, ...]:
    """Names that a map of a skeleton may use.

    Args:
        name: as `find_target` takes it.
        skeleton: the one that `find_target` returns.
    """
    if isinstance(name, Skeleton) or Path(name).suffix.lower() not in RIGS[1:]:
        return skeleton.names
    from .bind_skeleton import read_node_names

    return tuple(read_node_names(read_character(name)))  # the skeleton of a VRM has VRM's names instead


def rig_files(skeleton: str | PathLike[str] | Skeleton | None) -> tuple[Path, ...]:
    """The file that `find_target` reads for a skeleton, if it reads one."""
    is_known = skeleton is None or isinstance(skeleton, Skeleton) or str(skeleton) in SKELETONS
    return () if is_known else (Path(skeleton),)  # type: ignore[arg-type]
