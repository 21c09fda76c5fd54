"""Read the numbers of a BVH as joints in metres, Y up, with a T-pose; quaternions; a frame rate.

A BVH does not state its unit, its up axis and its zero pose. We guess them by these rules:

* **Unit**: the highest joint of the T-pose is that of a person. From the floor it is less than 4.5 metres, 25 decimetres
  (MakeHuman), 48 units of Carnegie Mellon's database, 80 inches or 500 centimetres; else the unit is millimetres. Where there
  are no legs, the height of the whole person follows from the distance between hips and head. Skeletons that are not
  recognised are in centimetres. ``units=`` overrides.
* **Up**: +Y, unless hips and head of the frames stand along +Z. ``up=`` overrides.
* **Rest**: `cospeech.motion.tpose.with_tpose`, for skeletons that `cospeech.motion.bone_mapping` knows or a map names; else the
  zero pose.
"""

from __future__ import annotations

import io
from codecs import getincrementaldecoder
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import InputError
from ..motion.bone_mapping import names_joints, recognise_file
from ..motion.limbs import lacks_limb
from ..motion.motion import Motion
from ..motion.rest_calibration import calibrate_rest, on_motions_floor
from ..motion.rotations import (
    Array,
    make_continuous,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
)
from ..motion.skeleton import Skeleton, find_skeleton, humanoid
from ..motion.skeletons import SKELETONS
from ..motion.tpose import on_floor, with_tpose
from .bvh_frames import decode_frames
from .bvh_hierarchy import file_names
from .bvh_layout import BvhLayout
from .bvh_text import read_header
from .reading import open_file, size_of
from .timing import rate_of_step
from .up_axis import Z_TO_Y, has_z_up

__all__ = ["UNITS", "load"]

UNITS = {"m": 1.0, "dm": 0.1, "cmu": 0.0254 / 0.45, "inch": 0.0254, "cm": 0.01, "mm": 0.001}
"""Unit of a file → metres; the Carnegie Mellon database counts in inches / 0.45 (its FAQ)."""

_HEIGHTS = ((4.5, "m"), (25.0, "dm"), (48.0, "cmu"), (80.0, "inch"), (500.0, "cm"), (np.inf, "mm"))  # ours, see above
_NAMES = 1 << 18  # bytes at the beginning of a file that show its encoding: a thousand joints; ours
_BLOCK = 1024  # frames at once; ours
_SAMPLE = 64  # ours: frames from which the up axis is found


def load(
    path: str | PathLike[str],
    *,
    units: str | None = None,
    up: str | None = None,
    fps: float | None = None,
    bone_map: Mapping[str, str] | None = None,
) -> Motion:
    """Read a BVH of any exporter.

    Args:
        path: the file.
        units: of the file, one of `UNITS`; found from the height of the character where not given.
        up: ``"y"`` or ``"z"``; found from the motion where not given.
        fps: instead of the file's ``Frame Time``.
        bone_map: our name → name of a joint, where the joints are not recognised; a map of other joints changes nothing.

    Returns:
        Motion in metres, Y up; rotations float64. Its skeleton's ``rest`` brings the file's zero pose into a T-pose, its
        ``layout`` is the file's.

    Raises:
        InputError: it is no BVH, or damaged; the message names the line. Or the map lacks joints that a T-pose needs.
    """
    if units is not None and units not in UNITS:
        raise InputError(f"unknown unit {units!r}", f"known: {', '.join(UNITS)}")
    if up not in (None, "y", "z"):
        raise InputError(f"up is {up!r}", "'y' or 'z'")
    with open_file(path) as binary, io.TextIOWrapper(binary, _find_encoding(binary), errors="replace") as file:
        try:
            header = read_header(file)
            rate = fps if fps is not None else rate_of_step(header.frame_time, header.precision)
            frames = decode_frames(file, header, size_of(binary))
        except InputError as error:
            raise InputError(f"{str(Path(path).name)!r}, {error.problem}", error.hint) from None
    names = file_names(header.names)
    ends = {names[joint]: end for joint, end in header.ends.items()}
    skeleton, order = _in_table_order(Skeleton(names, header.parents, frames.offsets, ends=ends))  # type: ignore[arg-type]
    skeleton = replace(skeleton, layout=BvhLayout(header, np.argsort(order), frames.places))
    joints = _find_joints(skeleton, bone_map, repr(str(Path(path).name)))
    if skeleton.kind == "custom" or (bone_map and joints):
        skeleton = replace(skeleton, bone_map=joints)
    _reorder(frames.rotations, order)
    return _as_motion(skeleton, joints, frames.rotations, frames.root, rate, units, up)


def _find_encoding(file: BinaryIO) -> str:
    """The encoding of the names of joints: UTF-8, or that of Windows programs of Western Europe."""
    names = file.read(_NAMES).partition(b"MOTION")[0]
    file.seek(0)
    try:
        getincrementaldecoder("utf-8")().decode(names)  # a letter that is cut at the end is no error
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _in_table_order(skeleton: Skeleton) -> tuple[Skeleton, list[int]]:
    """Give a skeleton of our tables its kind, and the table's order of joints; a BVH itself is always depth first."""
    above = {name: skeleton.names[p] if p >= 0 else None for name, p in zip(skeleton.names, skeleton.parents, strict=True)}
    for kind in SKELETONS:
        table = find_skeleton(kind)
        if above == {name: table.names[p] if p >= 0 else None for name, p in zip(table.names, table.parents, strict=True)}:
            order = [skeleton.index[name] for name in table.names]
            return replace(table, offsets=skeleton.offsets[order], ends=skeleton.ends), order
    return skeleton, list(range(len(skeleton)))


def _reorder(rotations: Array, order: list[int]) -> None:
    """Put the joints of rotations (T, J, 4) into an order, in place."""
    if order != list(range(len(order))):
        for first in range(0, len(rotations), _BLOCK):
            rotations[first : first + _BLOCK] = rotations[first : first + _BLOCK][:, order]


def _find_joints(skeleton: Skeleton, bone_map: Mapping[str, str] | None, file: str) -> dict[str, str]:
    """Our name → their name; empty where neither we nor the map know the joints."""
    if bone_map and names_joints(bone_map, skeleton):
        return recognise_file(skeleton, bone_map, file)
    try:
        return recognise_file(skeleton, None, file)
    except InputError:
        return {}


def _as_motion(
    skeleton: Skeleton, names: dict[str, str], rotations: Array, root: Array, rate: float, units: str | None, up: str | None
) -> Motion:
    """Find axes, T-pose and unit, and convert; ``names`` are those of `_find_joints`."""
    sample = np.unique(np.linspace(0, len(root) - 1, _SAMPLE).astype(int))
    points = skeleton.forward(rotations[sample], root[sample])[0]
    layout = skeleton.layout
    assert layout is not None
    if (up or _up(skeleton, names, points)) == "z":
        layout = replace(layout, turn=quat_conjugate(Z_TO_Y))
        rotations[:, 0] = quat_multiply(Z_TO_Y, rotations[:, 0])
        root = quat_rotate(Z_TO_Y, root)
    skeleton = with_tpose(skeleton, names) if names else on_floor(skeleton, 0)
    if names and skeleton.kind == "custom":
        skeleton = calibrate_rest(skeleton, names, rotations)
    scale = UNITS[units or (_guess_units(skeleton, names) if names else "cm")]
    ends = {name: (x * scale, y * scale, z * scale) for name, (x, y, z) in skeleton.ends.items()}
    layout = replace(layout, scale=1 / scale)
    skeleton = replace(skeleton, offsets=skeleton.offsets * scale, ends=ends, layout=layout)
    if names and skeleton.kind == "custom":
        skeleton = on_motions_floor(skeleton, names, rotations, root * scale)
    return Motion(fps=rate, rotations=make_continuous(rotations), root=root * scale, skeleton=skeleton)


def _up(skeleton: Skeleton, names: dict[str, str], points: Array) -> str:
    if not names:
        return "y"
    spine = points[:, skeleton.index[names["head"]]] - points[:, skeleton.index[names["hips"]]]
    return "z" if has_z_up(spine / np.maximum(np.linalg.norm(spine, axis=-1, keepdims=True), 1e-12)) else "y"


def _guess_units(skeleton: Skeleton, names: dict[str, str]) -> str:
    """The unit that makes the skeleton as tall as a person; in the T-pose it stands on the floor, if it has legs."""
    height = float(skeleton.tpose[:, 1].max())
    if lacks_limb(names, "legs"):
        ours, (hips, head) = humanoid(), (skeleton.tpose[skeleton.index[names[name]], 1] for name in ("hips", "head"))
        height = float(head - hips) * ours.tpose[:, 1].max() / (ours.tpose[ours.index["head"]] - ours.tpose[0])[1]
    return next(unit for limit, unit in _HEIGHTS if height < limit)
