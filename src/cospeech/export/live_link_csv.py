"""Live Link Face recordings: a CSV of 61 channels per frame, for Unreal, MotionBuilder, Maya and Blender importers.

The app spells ARKit's names in PascalCase and has *JawRight before JawLeft and MouthRight before MouthLeft*; all else is
ARKit's order. Columns are therefore written in the app's order and read by name.

Angles (head, left eye, right eye) are radians, as in ARKit's ``eulerAngles``, whose face axes are ours (+X to the character's
left, +Y up, +Z out of the face): intrinsic YXZ, so that positive yaw turns to the character's own left, positive pitch looks
down, positive roll tilts the crown to its right. The head is taken relative to the upper chest, since importers lay it on a
body that moves by itself. The app's maker states no unit; see the documents of your importer if a head turns too far (Unreal's
own streaming plugin divides degrees by 180 instead).
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array, euler_to_quat, quat_conjugate, quat_identity, quat_multiply, quat_slerp, quat_to_euler
from ..motion.skeleton import Skeleton, humanoid
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from . import Writer as BaseWriter
from .reading import check_frames, open_file, size_of
from .timing import frame_rate, frames_of, on_grid
from .to_humanoid import as_humanoid, make_standing

__all__ = ["COLUMNS", "Writer", "head_and_eyes", "load"]


def _app_order() -> tuple[str, ...]:
    names = list(ARKIT)
    for left, right in (("jawLeft", "jawRight"), ("mouthLeft", "mouthRight")):
        a, b = names.index(left), names.index(right)
        names[a], names[b] = right, left
    return tuple(name[0].upper() + name[1:] for name in names)


_SHAPES = _app_order()
_ANGLES = tuple(part + angle for part in ("Head", "LeftEye", "RightEye") for angle in ("Yaw", "Pitch", "Roll"))
COLUMNS = ("Timecode", "BlendShapeCount", *_SHAPES, *_ANGLES)
"""The 63 columns in the app's order."""

_COLUMN_OF = np.array([ARKIT_INDEX[name[0].lower() + name[1:]] for name in _SHAPES])
_CHANNELS = len(_SHAPES) + len(_ANGLES)
_ROW = f",{_CHANNELS}" + ",%.6f" * _CHANNELS + "\n"
_NECK_SHARE = 0.4  # ours: of a head turn when it is read back, the neck takes the smaller half
_MAX_LINE = 1 << 16  # bytes; ours: a row has some 600


class Writer(BaseWriter):
    """Writes the recording row by row; body motion other than head and eyes is not in this format."""

    _file: IO[str] | None = None

    def _begin(self, temporary: Path) -> None:
        self._file = temporary.open("w", encoding="ascii", newline="")
        self._file.write(",".join(COLUMNS) + "\n")

    def _write(self, motion: Motion) -> None:
        assert self._file is not None
        face = np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face
        values = np.concatenate([face[:, _COLUMN_OF], head_and_eyes(as_humanoid(motion))], 1)
        base = max(1, round(self.fps))
        for k, row in enumerate((values + 0.0).tolist(), start=self.frames):  # + 0.0: no negative zeros
            seconds, rest = divmod(round(k / self.fps * base * 1000), base * 1000)
            clock = f"{seconds // 3600 % 24:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
            self._file.write(f"{clock}:{rest // 1000:02d}.{rest % 1000:03d}" + _ROW % tuple(row))

    def _finish(self) -> None:
        assert self._file is not None
        self._file.close()

    def _discard(self) -> None:
        if self._file is not None:
            self._file.close()


def head_and_eyes(motion: Motion) -> Array:
    """(T, 9) yaw, pitch, roll of the head (relative to the upper chest) and of both eyes, radians."""
    skeleton, q = motion.skeleton, motion.rotations
    head = quat_multiply(q[:, skeleton.index["neck"]], q[:, skeleton.index["head"]])
    turns = [head, q[:, skeleton.index["leftEye"]], q[:, skeleton.index["rightEye"]]]
    return np.concatenate([quat_to_euler(x.astype(np.float64), "YXZ") for x in turns], 1)


def load(path: str | PathLike[str], *, fps: float | None = None) -> Motion:
    """Read a recording of the app (or of ours): face, head and eyes on a standing body.

    Rows that the app left empty (``BlendShapeCount`` 0) are bridged. Uneven clocks are put on a constant rate, and in a gap the
    values change linearly. ``fps``: how many frames the timecode counts per second, where the file does not show it (clips
    under a second).

    Raises:
        InputError: no such header, a row with missing or non-finite values, a broken timecode, no rows, or times so far apart
            that the motion would be too large.
    """
    stamps, rows, joints = [], [], len(humanoid())
    with open_file(path) as file:
        size = size_of(file)
        columns = _read_header(file.readline(_MAX_LINE), path)
        width = max(columns.values()) + 1
        number = 1
        while line := file.readline(_MAX_LINE):
            number += 1
            cells = line.decode("utf-8", "replace").strip().split(",")
            if cells == [""] or (len(cells) > 1 and cells[columns["BlendShapeCount"]].strip() == "0"):
                continue
            if len(cells) < width:
                raise InputError(f"line {number} of {str(path)!r} has {len(cells)} of {width} columns", "is it cut off?")
            stamps.append(_timecode(cells[columns["Timecode"]], number))
            rows.append(_numbers(cells[2:width], number))
            check_frames(repr(str(path)), len(rows), joints, size)
    if not rows:
        raise InputError(f"{str(path)!r} has a header but no frames", "was the recording stopped at once?")
    values = np.stack(rows)
    times = _seconds(np.array(stamps), fps)
    rate = frame_rate(times, fps or 30.0)
    check_frames(repr(str(path)), frames_of(times, rate), joints, size)
    return _motion(on_grid(times, values, rate), columns, rate)


def _read_header(line: bytes, path: str | PathLike[str]) -> dict[str, int]:
    names = [name.strip().strip('"') for name in line.decode("utf-8-sig", "replace").split(",")]
    columns = {name[:1].upper() + name[1:]: k for k, name in enumerate(names)}
    missing = [name for k, name in enumerate(COLUMNS[:2]) if columns.get(name) != k]
    if missing or not any(name in columns for name in _SHAPES):
        what = missing[0] if missing else _SHAPES[0]
        raise InputError(f"{str(path)!r} is not a Live Link Face recording: no column {what!r}", "export it as CSV in the app")
    return {name: columns[name] for name in COLUMNS if name in columns}


def _numbers(cells: list[str], line: int) -> Array:
    row = np.empty(len(cells))
    for k, cell in enumerate(cells):
        try:
            row[k] = float(cell or 0)
        except ValueError:
            raise InputError(f"line {line}: {cell[:40]!r} is not a number", "decimals are written with a point") from None
    if not np.isfinite(row).all():
        raise InputError(f"line {line}: a value is not finite", "is the recording damaged?")
    return row


def _timecode(cell: str, line: int) -> tuple[float, float]:
    parts = cell.strip().strip('"').replace(";", ":").split(":")
    try:
        hours, minutes, seconds = (int(p) for p in parts[:3])
        frames = float(parts[3])
    except (ValueError, IndexError):
        raise InputError(f"line {line}: timecode {cell[:40]!r}", "expected HH:MM:SS:FF.sss") from None
    if not (0 <= hours < 100 and 0 <= minutes < 60 and 0 <= seconds < 60 and 0 <= frames < 1000):
        raise InputError(f"line {line}: timecode {cell[:40]!r} is out of range", "expected HH:MM:SS:FF.sss")
    return hours * 3600.0 + minutes * 60 + seconds, frames


def _seconds(stamps: Array, fps: float | None) -> Array:
    """(T, 2) whole seconds and frames → seconds from the first row, at the frames per second that the timecode counts."""
    seconds, frames = np.unwrap(stamps[:, 0], period=86400), stamps[:, 1]  # recordings may run past midnight
    most = int(frames.max()) + 1
    wraps = bool(np.any(np.diff(seconds) > 0))
    common = next((base for base in (24, 25, 30, 48, 50, 60, 72, 90, 100, 120) if base >= most), most)
    if fps is not None:
        bases: tuple[float, ...] = (max(round(fps), 1),)
    elif wraps:
        bases = (common, most)
    else:
        bases = (30 if most <= 30 else common,)

    def unevenness(base: float) -> float:
        steps = np.diff(seconds + frames / base)
        return float(np.abs(steps - np.median(steps)).sum())

    base = min(bases, key=unevenness) if len(seconds) > 1 else bases[0]
    times = seconds + frames / base
    return times - times[0]


def _motion(values: Array, columns: dict[str, int], fps: float) -> Motion:
    def column(name: str) -> Array:
        return values[:, columns[name] - 2] if name in columns else np.zeros(len(values))

    face = np.zeros((len(values), len(ARKIT)))
    for name, k in zip(_SHAPES, _COLUMN_OF, strict=True):
        face[:, k] = np.clip(column(name), 0, 1)
    motion = make_standing(len(values), fps=fps, face=face)
    skeleton: Skeleton = motion.skeleton
    turns = {
        part: euler_to_quat(np.stack([column(part + angle) for angle in ("Yaw", "Pitch", "Roll")], 1), "YXZ")
        for part in ("Head", "LeftEye", "RightEye")
    }
    neck = quat_slerp(quat_identity(len(values)), turns["Head"], np.full(len(values), _NECK_SHARE))
    motion.rotations[:, skeleton.index["neck"]] = neck
    motion.rotations[:, skeleton.index["head"]] = quat_multiply(quat_conjugate(neck), turns["Head"])
    motion.rotations[:, skeleton.index["leftEye"]] = turns["LeftEye"]
    motion.rotations[:, skeleton.index["rightEye"]] = turns["RightEye"]
    return motion
