"""BVH: skeleton animation as text.

A skeleton that was read from a BVH is written as that file has it: the same HIERARCHY, unit, axes and zero pose. The curves can
then be pasted onto the rig. Other skeletons get our layout: the zero pose is the T-pose, facing +Z, Y up, in centimetres. The
root has six channels and OFFSET 0; its height is in the position channels. All other joints have three channels, ``ZXY``.

Channel order is rotation order, intrinsic, read left to right. Units are not in a BVH file: Blender wants scale 0.01 for
centimetres.
"""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import CospeechWarning, InputError
from ..motion.motion import Motion
from ..motion.rotations import quat_normalize
from ..motion.skeleton import Skeleton
from . import Writer as _Writer
from .bvh_frames import RowEncoder
from .bvh_hierarchy import format_hierarchy
from .bvh_layout import make_layout
from .bvh_reader import load
from .bvh_text import format_rows

__all__ = ["UNITS", "Writer", "load"]

UNITS = {"cm": 100.0, "m": 1.0}
"""Name of a unit that can be written → units per metre."""

_DECIMALS = 5  # ours: 5e-6° on a chain of 10 joints and 1 m is 9e-5 cm at the worst
_BLOCK = 512  # ours: frames formatted at once, bounds the memory
_COUNT_WIDTH = 10  # ours: digits kept free for the number of frames, patched in at the end
_LEAST_LOSS = (np.radians(1.0), 0.01)  # ours: no warning of errors below 1° or 1 cm


class Writer(_Writer):
    """Writes one BVH from pieces of motion in constant memory.

    Args:
        path, skeleton, fps, audio: as for `cospeech.export.Writer`; the audio is not used.
        units: ``"cm"`` or ``"m"``: our layout in that unit. If None, the layout of the BVH that the skeleton was read from;
            where there is none, or where the skeleton's bones were changed since, our layout in centimetres.

    Raises:
        InputError: unknown units.

    Warns:
        CospeechWarning: joints of the file have too few channels for the motion; the joints are named.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        skeleton: Skeleton,
        fps: float,
        audio: str | PathLike[str] | None = None,
        units: str | None = None,
    ) -> None:
        super().__init__(path, skeleton=skeleton, fps=fps, audio=audio)
        if units is not None and units not in UNITS:
            raise InputError(f"cannot write BVH in {units!r}", f"known units: {', '.join(UNITS)}")
        own = skeleton.layout if units is None and skeleton.layout is not None and skeleton.layout.fits(skeleton) else None
        scale = UNITS[units or "cm"] if own is None else own.scale
        self._decimals = _DECIMALS + round(np.log10(UNITS["cm"] / scale))  # of lengths
        self._layout = own or make_layout(skeleton, scale, self._decimals + 1)
        self._encoder = RowEncoder(self._layout.header, self._layout.places)
        self._row_decimals = np.full(self._layout.header.columns, _DECIMALS)
        self._row_decimals[self._encoder.moving] = self._decimals
        self._file: IO[bytes] | None = None

    def _begin(self, temporary: Path) -> None:
        self._file = temporary.open("wb")
        self._file.write("\n".join(format_hierarchy(self._layout.header, self._decimals + 1)).encode() + b"\nMOTION\nFrames: ")
        self._count_at = self._file.tell()
        self._file.write(b" " * _COUNT_WIDTH + f"\nFrame Time: {1 / self.fps:.9f}\n".encode())

    def _write(self, motion: Motion) -> None:
        assert self._file is not None
        for start in range(0, len(motion), _BLOCK):
            piece = slice(start, start + _BLOCK)
            rotations = quat_normalize(np.asarray(motion.rotations[piece], float))
            rows = self._encoder.encode(*self._layout.convert_frames(rotations, motion.root[piece]))
            self._file.write(format_rows(rows, self._row_decimals).encode())

    def _finish(self) -> None:
        assert self._file is not None
        self._file.seek(self._count_at)
        self._file.write(str(self.frames).encode())
        self._file.close()
        self._note_losses()

    def _note_losses(self) -> None:
        """Warn of motion that the channels of the file cannot hold."""
        turns, shift = self._encoder.losses, self._encoder.root_loss / self._layout.scale
        problems = [f"{name} by up to {np.degrees(turns[name]):.0f}°" for name in turns if turns[name] > _LEAST_LOSS[0]]
        problems += [f"the place of the root by up to {shift:.2f} m"] if shift > _LEAST_LOSS[1] else []
        if problems:
            problem = f"{str(self.path)!r} has too few channels for the motion, as its rig has: off are {', '.join(problems)}"
            warnings.warn(problem, CospeechWarning, stacklevel=4)

    def _discard(self) -> None:
        if self._file is not None:
            self._file.close()
