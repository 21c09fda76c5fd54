"""ZeroEGGS (Ghorbani et al. 2023): one actress in 19 styles, ``clean/NNN_Style_K_x_1_0.{bvh,wav}`` (or ``train/``).

60 fps BVH of 75 joints and 48 kHz WAV. ``info.csv`` beside the folder (or the one of the code repository put there) says which
takes are for validation. The style is ``extra["style"]``: the label of how she speaks, not of who speaks.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

from ..errors import CospeechWarning, InputError
from .clip import Clip, Dropped
from .reading import check_lengths, files_of, load_motion, load_sound, read_each, read_rows, usable_folder

__all__ = ["FPS", "read", "read_info"]

FPS = 60.0
_FOLDERS = ("clean", "train")
_LISTS = ("info.csv", "metadata.csv")
_NAME = re.compile(r"(\d{3}_([A-Za-z]+)_\d+)((?:_mirror)?)((?:_x_?\d+(?:_\d+)?)?)((?:_mirror)?)")


def read(raw: str | PathLike[str]) -> Iterator[Clip | Dropped]:
    """Takes in order of name, one at a time, on the file's own skeleton.

    Args:
        raw: the unpacked ``Zeggs_data``, or ``clean`` or ``train`` itself.

    Returns:
        Clips with ``extra["style"]``, ``extra["take"]`` (the recording without its speed and mirroring) and, for mirrored
        ones, ``extra["mirrored"]``. The split is that of ``info.csv``, None without one.

    Raises:
        InputError: no such folder, no BVH or WAV in it, or a damaged ``info.csv``.
    """
    root = usable_folder(raw, "ZeroEGGS")
    place = next((root / name for name in _FOLDERS if (root / name).is_dir()), root)
    motions, sounds = files_of(place, ".bvh"), files_of(place, ".wav")
    if not motions and not sounds:
        raise InputError(f"there is neither BVH nor WAV in {str(place)!r}", "name the folder that holds 'clean'")
    lists = (folder / name for folder in (place, root, root.parent) for name in _LISTS)
    info = next((path for path in lists if path.is_file()), None)
    split = {} if info is None else read_info(info)
    if info is None:
        note = f"'info.csv' is not beside {str(place)!r}: its takes have no split, and prepare draws one by their names"
        warnings.warn(note, CospeechWarning, stacklevel=2)

    def one(name: str) -> Clip:
        match = _NAME.fullmatch(name)
        if match is None:
            raise InputError(f"{name!r} is not the name of a take", "such as 003_Neutral_2_x_1_0")
        if name not in motions:
            raise InputError(f"'{name}.bvh' is not there", "a take needs motion")
        mirrored = bool(match[3] or match[5])
        sound = sounds.get(name) or sounds.get(match[1] + match[4])
        motion = load_motion(motions[name], fps=FPS, units="cm", up="y")
        speech = load_sound(sound, None)
        check_lengths(name, motion, speech)
        return Clip(
            name=name,
            speaker="zeroeggs",
            corpus="zeroeggs",
            speech=speech,
            motion=motion,
            split=split.get(match[1]),
            extra={"style": match[2], "take": match[1], **({"mirrored": True} if mirrored else {})},
        )

    return read_each(sorted({*motions, *sounds} if motions else sounds), one)


def read_info(path: Path) -> dict[str, str]:
    """Take → split, from the columns ``anim_bvh`` and ``validation`` (TRUE or FALSE).

    Raises:
        InputError: no such columns, or another value; the line is named.
    """
    rows = read_rows(path)
    header = [cell.strip() for cell in rows[0]] if rows else []
    if not {"anim_bvh", "validation"} <= set(header):
        raise InputError(
            f"{path.name!r} has no columns 'anim_bvh' and 'validation'", f"its first line: {','.join(header)[:60]}"
        )
    name, flag = header.index("anim_bvh"), header.index("validation")
    splits = {}
    for line, row in enumerate(rows[1:], 2):
        if not row:
            continue
        value = row[flag].strip().lower() if len(row) > max(name, flag) else ""
        if value not in ("true", "false"):
            raise InputError(f"{path.name!r}, line {line}: {value[:40]!r} where TRUE or FALSE belongs", "is it damaged?")
        splits[row[name].strip().removesuffix(".bvh")] = "validation" if value == "true" else "train"
    return splits
