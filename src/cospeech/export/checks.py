"""Checks of files and options, before the work begins."""

from __future__ import annotations

import os
import unicodedata
import warnings
from collections.abc import Collection, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import CospeechWarning, InputError
from ..motion.bone_map_checks import check_fit
from ..motion.skeleton import Skeleton
from .registry import FORMATS, format_of, suffixes
from .target_skeleton import read_target, rig_joints

if TYPE_CHECKING:
    from .avatar import Avatar

__all__ = ["File", "check_apart", "check_avatar", "check_files", "check_map", "check_skeleton", "note_idle_gain"]

File = str | PathLike[str]


def check_skeleton(skeleton: File | Skeleton, formats: set[str], bones: Mapping[str, str] | None = None) -> Skeleton:
    """Read a skeleton or a rig; check that one of the ``formats``, if any, can hold it. ``bones``: of `read_target`."""
    target = read_target(skeleton, bones)
    if formats and not any(FORMATS[suffix].any_skeleton for suffix in formats):
        raise InputError(
            f"skeleton {str(skeleton)!r} would not be seen in {' '.join(sorted(formats))}",
            f"it is for {' '.join(suffixes(lambda entry: entry.any_skeleton))} files; the other formats have their own",
        )
    return target


def check_avatar(
    avatar: File, formats: set[str], bones: Mapping[str, str] | None = None, parts: Collection[str] = ()
) -> Avatar:
    """Read a character; check that it has a surface, and that one of the ``formats`` can show it. ``bones``: of `read_avatar`.

    Warns if it has no face, and the face is one of the ``parts`` that are to move.
    """
    if not any(FORMATS[suffix].wears_avatar for suffix in formats):
        fit = " ".join(suffixes(lambda entry: entry.wears_avatar))
        raise InputError(f"avatar {str(avatar)!r} would not be seen", f"it is for {fit} files")
    if not Path(avatar).is_file():
        raise InputError(f"no avatar at {str(avatar)!r}", "name a .vrm, .glb or .fbx file")
    from .avatar import check_surface, read_avatar

    character = read_avatar(avatar, bones)
    check_surface(character.file)
    if "face" in parts:
        _note_faceless(character, parts)
    return character


def check_map(bones: Mapping[str, str], skeletons: Mapping[str, Skeleton], avatar: Avatar | None) -> None:
    """Check that a map names joints of a skeleton or of the character.

    Args:
        bones: our name → their name.
        skeletons: name of a skeleton, or its file → the skeleton.
        avatar: as `check_avatar` returns it.

    Raises:
        InputError: it does not; the message is about the file that it fits best.
    """
    files: dict[str, Collection[str]] = {repr(str(name)): rig_joints(name, skeleton) for name, skeleton in skeletons.items()}
    check_fit(bones, files | ({} if avatar is None else {repr(str(avatar.path)): avatar.joints}))


def _note_faceless(avatar: Avatar, parts: Collection[str]) -> None:
    """Warn if a character has no face to drive, and no eyes.

    Raises:
        InputError: nothing else is to move.
    """
    if avatar.face.alphabet or {"leftEye", "rightEye", "jaw"} & {*avatar.rig.bones}:
        return
    problem = f"{avatar.path.name} has no face that can be driven"
    if {*parts} == {"face"}:
        raise InputError(f"{problem}, so it would not move", "leave --parts out")
    warnings.warn(f"{problem}: its body alone moves", CospeechWarning, stacklevel=4)


def note_idle_gain(face_gain: object, parts: Collection[str], why: str) -> None:
    """Warn if a gain of the face is given and no face is shown; ``why`` says who lacks it."""
    if "face" not in parts and face_gain not in (1.0, "1"):
        warnings.warn(f"face_gain changes nothing: {why}", CospeechWarning, stacklevel=3)


def check_files(audio: File, outputs: list[Path], inputs: list[File], report: File | None) -> None:
    """Check that each output has a known format, and that none would overwrite another one or an input."""
    if not outputs:
        raise InputError("no file to write", f"name one with a suffix of {' '.join(FORMATS)}")
    for path in outputs:
        format_of(path)
    check_apart([*outputs, *([Path(report)] if report else [])], [audio, *inputs])


def check_apart(outputs: Sequence[Path], inputs: Sequence[File]) -> None:
    """Check that no output would overwrite an input or another output."""
    uses: dict[str, str] = {_place(path): "what is read" for path in inputs}
    for path in outputs:
        place = _place(path)
        if place in uses:
            raise InputError(f"{str(path)!r} would overwrite {uses[place]}", "give the output another name")
        uses[place] = "another output"


def _place(path: File) -> str:
    """A name of a file that no other file has; it ignores case where the system does."""
    real = os.path.realpath(os.fsdecode(path))
    return unicodedata.normalize("NFC", real).casefold() if _ignores_case(Path(real)) else real


def _ignores_case(path: Path) -> bool:
    """Whether capital and small letters are the same in names of files, as Windows and macOS have it.

    Args:
        path: of a file or folder; it need not be there.
    """
    for place in (path, *path.parents):
        other = place.with_name(place.name.swapcase()) if place.name else place
        if other.name != place.name and place.exists():
            return other.exists() and other.samefile(place)
    return False
