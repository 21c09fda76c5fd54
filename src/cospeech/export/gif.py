"""``.gif``: a moving picture for places that show no video, such as a README; it loops for ever.

All pictures share one palette, made from the first two seconds, and each holds only what has changed since the one before,
so that some seconds stay within two or three megabytes.
"""

from __future__ import annotations

import struct
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..motion.skeleton import Skeleton
from .render.patch import Patch
from .render.worker import Pictures
from .video_writer import MovingWriter

__all__ = ["Writer"]

_SIZE = (480, 480)  # ours: a little more than half of a README's column
_MOST_RATE = 15.0  # pictures per second; ours: smooth enough for gestures, and half the bytes of 30
_RATES = (1.0, 50.0)  # browsers slow down pictures of less than 2/100 s
_BACKDROP_COLOURS = 48  # of the palette at most, so that the backdrop shows no bands
_CLEAR = 255  # the index that means "as before"
_PALETTE_FROM = 30  # pictures that the palette is made from


class Writer(MovingWriter):
    """Writes a ``.gif``.

    Args:
        audio: not used: these have no sound.
        size: (width, height) in pixels.
        camera: ``body``, ``full``, ``face`` or ``hands``.
        rate: pictures per second; 15, or those of the motion if fewer, where not given.
        look: ``background``, as `MovingWriter` takes it.

    Raises:
        InputError: the rate is outside 1 … 50.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        skeleton: Skeleton,
        fps: float,
        audio: str | PathLike[str] | None = None,
        rate: float | None = None,
        size: tuple[int, int] = _SIZE,
        camera: str = "body",
        **look: Any,
    ) -> None:
        rate = max(min(float(fps), _MOST_RATE), _RATES[0]) if rate is None else rate
        if not _RATES[0] <= rate <= _RATES[1]:
            raise InputError(f"{rate} pictures per second in a .gif", f"{_RATES[0]:g} … {_RATES[1]:g}")
        super().__init__(path, skeleton=skeleton, fps=fps, audio=audio, rate=rate, size=size, camera=camera, **look)
        self._file: BinaryIO | None = None
        self._pending: list[Pictures] = []
        self._before: NDArray[np.uint8] | None = None
        self._count = 0

    def _open(self, temporary: Path) -> None:
        self._file = temporary.open("wb")

    def _picture(self, patch: Patch) -> None:
        picture = patch.paste(self._blank.copy())
        if self._before is not None:
            self._append(picture)
            return
        self._pending.append(picture)
        if len(self._pending) == _PALETTE_FROM:
            self._head()

    def _close(self) -> None:
        if self._before is None:
            self._head()
        assert self._file is not None
        self._file.write(b";")
        self._file.close()

    def _discard(self) -> None:
        super()._discard()
        if self._file is not None:
            self._file.close()

    def _head(self) -> None:
        """Choose the palette; write the file's head and the pictures that wait."""
        from PIL import Image

        some = np.concatenate(self._pending[:: max(1, len(self._pending) // 5)])
        edge = np.unique(some[:, 0], axis=0)  # the picture's left edge shows the backdrop
        edge = edge[:: -(-len(edge) // _BACKDROP_COLOURS)]
        figure = some[(some != some[:, :1]).any(2)].reshape(1, -1, 3)
        count = _CLEAR - len(edge)
        palette = Image.fromarray(figure if figure.size else some).quantize(count, method=Image.Quantize.MEDIANCUT, kmeans=1)
        colours = edge.tobytes() + bytes(palette.getpalette() or [])[: 3 * count]
        colours += edge.tobytes()[:3] * (256 - len(colours) // 3)
        self._palette = Image.new("P", (1, 1))
        self._palette.putpalette(colours)
        assert self._file is not None
        self._file.write(b"GIF89a" + struct.pack("<HHBBB", *self.size, 0xF7, 0, 0) + colours)
        self._file.write(b"!\xff\x0bNETSCAPE2.0\x03\x01" + struct.pack("<H", 0) + b"\0")  # 0: loop for ever
        pictures, self._pending = self._pending, []
        for picture in pictures:
            self._append(picture)

    def _append(self, picture: Pictures) -> None:
        """Write the part that differs from the picture before."""
        from PIL import GifImagePlugin, Image

        index = np.asarray(Image.fromarray(picture).quantize(palette=self._palette, dither=Image.Dither.NONE))
        left, top, part = 0, 0, index
        if self._before is not None:
            differs = index != self._before
            rows, columns = np.flatnonzero(differs.any(1)), np.flatnonzero(differs.any(0))
            top, bottom = (rows[0], rows[-1] + 1) if len(rows) else (0, 1)
            left, right = (columns[0], columns[-1] + 1) if len(columns) else (0, 1)
            part = np.where(differs, index, np.uint8(_CLEAR))[top:bottom, left:right]
        self._before = index
        # in hundredths of a second, rounded so that the sum never drifts
        ticks = round(100 * (self._count + 1) / self.rate) - round(100 * self._count / self.rate)
        self._count += 1
        image = Image.fromarray(np.ascontiguousarray(part))
        assert self._file is not None
        options = {"duration": 10 * ticks, "transparency": _CLEAR, "disposal": 1}
        self._file.writelines(GifImagePlugin.getdata(image, (int(left), int(top)), **options))
