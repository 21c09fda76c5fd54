"""BVH: skeleton animation as text. The file's zero pose is the T-pose, facing +Z, Y up.

Centimetres (or metres, on request) and degrees live here and nowhere else. Channel order is rotation order, intrinsic,
read left to right; we write ``ZXY``. The root has six channels and OFFSET 0, its height is in the position channels;
all other joints have three. Units are not in a BVH file: Blender wants scale 0.01 for our centimetres.
"""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import (
    Array,
    continuous_euler,
    quat_conjugate,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    quat_to_euler,
)
from ..motion.skeleton import Skeleton
from . import Writer as _Writer
from .bvh_reader import file_names, load

__all__ = ["UNITS", "Writer", "file_names", "load"]

UNITS = {"cm": 100.0, "m": 1.0}
"""Name of a unit that can be written → units per metre."""

_ORDER = "ZXY"  # ours: the poles then lie at ±90° of X, where arms and head seldom are
_DECIMALS = 5  # ours: 5e-6° on a chain of 10 joints and 1 m is 9e-5 cm at the worst
_BLOCK = 512  # ours: frames formatted at once, bounds the memory
_COUNT_WIDTH = 10  # ours: digits kept free for the number of frames, patched in at the end


class Writer(_Writer):
    """Writes one BVH from pieces of motion in constant memory.

    Args:
        path, skeleton, fps, audio: as for `cospeech.export.Writer`; the audio is not used.
        units: ``"cm"`` (default) or ``"m"``.

    Raises:
        InputError: unknown units.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        skeleton: Skeleton,
        fps: float,
        audio: str | PathLike[str] | None = None,
        units: str = "cm",
    ) -> None:
        super().__init__(path, skeleton=skeleton, fps=fps, audio=audio)
        if units not in UNITS:
            raise InputError(f"cannot write BVH in {units!r}", f"known units: {', '.join(UNITS)}")
        self._scale = UNITS[units]
        self._decimals = _DECIMALS + round(np.log10(UNITS["cm"] / self._scale))  # of lengths
        self._order = _file_order(skeleton)
        self._rest = skeleton.forward(skeleton.rest, skeleton.offsets[0])[1]  # world rotations of the T-pose
        self._last: Array | None = None  # last row of angles, to go on without jumps
        self._file: IO[bytes] | None = None

    def _begin(self, temporary: Path) -> None:
        self._file = temporary.open("wb")
        self._file.write("\n".join(self._hierarchy()).encode() + b"\nMOTION\nFrames: ")
        self._count_at = self._file.tell()
        self._file.write(b" " * _COUNT_WIDTH + f"\nFrame Time: {1 / self.fps:.9f}\n".encode())

    def _hierarchy(self) -> Iterable[str]:
        """Lines of the HIERARCHY section, joints depth first, as the format wants them."""
        skeleton, names = self.skeleton, file_names(self.skeleton.names)
        above = self._rest[[max(p, 0) for p in skeleton.parents]]
        offsets = quat_rotate(above, skeleton.offsets) * self._scale
        offsets[0] = 0
        yield "HIERARCHY"
        stack: list[int] = []
        for joint in self._order:
            while stack and stack[-1] != skeleton.parents[joint]:
                stack.pop()
                yield "\t" * len(stack) + "}"
            indent = "\t" * len(stack)
            yield f"{indent}{'JOINT' if stack else 'ROOT'} {names[joint]}"
            yield f"{indent}{{"
            yield f"{indent}\tOFFSET {self._numbers(offsets[joint])}"
            places = "" if stack else "Xposition Yposition Zposition "
            yield f"{indent}\tCHANNELS {3 if stack else 6} {places}{' '.join(f'{a}rotation' for a in _ORDER)}"
            stack.append(joint)
            if not skeleton.children[joint]:
                end = np.array(skeleton.ends.get(skeleton.names[joint], (0.0, 0.0, 0.0)), float)
                tip = self._numbers(quat_rotate(self._rest[joint], end) * self._scale)
                yield f"{indent}\tEnd Site\n{indent}\t{{\n{indent}\t\tOFFSET {tip}\n{indent}\t}}"
        while stack:
            stack.pop()
            yield "\t" * len(stack) + "}"

    def _numbers(self, values: Iterable[float]) -> str:
        digits = self._decimals + 1
        return " ".join(f"{round(float(v), digits) + 0.0:.{digits}f}" for v in values)

    def _write(self, motion: Motion) -> None:
        assert self._file is not None
        for start in range(0, len(motion), _BLOCK):
            piece = slice(start, start + _BLOCK)
            angles = self._angles(motion.rotations[piece])[:, self._order]
            root = np.asarray(motion.root[piece], float) * self._scale
            turns = np.round(np.degrees(angles).reshape(len(angles), -1), _DECIMALS)
            rows = np.concatenate([np.round(root, self._decimals), turns], 1) + 0.0  # no "-0.00000"
            template = " ".join([f"%.{self._decimals}f"] * 3 + [f"%.{_DECIMALS}f"] * (rows.shape[1] - 3)) + "\n"
            self._file.write((template * len(rows) % tuple(rows.ravel().tolist())).encode())

    def _angles(self, rotations: Array) -> Array:
        """(T, J, 3) Euler angles relative to the T-pose, continuous in time and with the rows written before."""
        above = self._rest[[max(p, 0) for p in self.skeleton.parents]]
        above[0] = (0, 0, 0, 1)
        local = quat_multiply(quat_multiply(above, quat_normalize(np.asarray(rotations, float))), quat_conjugate(self._rest))
        angles = continuous_euler(quat_to_euler(local, _ORDER), self._last)
        self._last = angles[-1]
        return angles

    def _finish(self) -> None:
        assert self._file is not None
        self._file.seek(self._count_at)
        self._file.write(str(self.frames).encode())
        self._file.close()

    def _discard(self) -> None:
        if self._file is not None:
            self._file.close()


def _file_order(skeleton: Skeleton) -> list[int]:
    """Joints depth first."""
    order, stack = [], [0]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack.extend(reversed(skeleton.children[joint]))
    return order
