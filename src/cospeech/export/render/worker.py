"""Draws pictures from rows of numbers: in this process, or in one of its own (``python -m cospeech.export.render.worker``).

A helper process is started with the look of the pictures in JSON as its argument. It reads batches from its standard input,
a 4-byte count (little endian) and that many rows of float32, and writes the pictures, one after the other, as bare RGB
bytes. The end of its input is the end of its work. Nothing is pickled, and the script that uses cospeech is not imported
again, so it needs no ``if __name__ == "__main__"``.
"""

from __future__ import annotations

import json
import os
import signal
import struct
import subprocess
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InternalError
from ...motion.rotations import Array
from ...motion.skeleton import humanoid
from ...motion.skeletons.arkit import ARKIT
from .camera import View
from .framing import FramedPose

__all__ = ["FrameRenderer", "Helper", "Look", "pack"]

Pictures = NDArray[np.uint8]
_WIDTHS = (4 * len(humanoid()), 3 * len(humanoid()), len(ARKIT), 6)  # of a row: rotations, positions, face, box
_ENDS = np.cumsum(_WIDTHS)


@dataclass(frozen=True)
class Look:
    """What all pictures of a film have in common.

    Args:
        width: pixels.
        height: pixels.
        view: how the character is looked at.
        background: 8-bit sRGB colour of the backdrop.
    """

    width: int
    height: int
    view: View
    background: tuple[int, int, int]


def pack(pose: FramedPose, box: Array) -> Array:
    """A row of float32 that says all there is to say about one picture; ``box (6,)`` as `stage.Framing` gives it."""
    return np.concatenate([pose.rotations.ravel(), pose.positions.ravel(), pose.face, box]).astype("<f4")


class FrameRenderer:
    """Draws our mannequin, in this process."""

    def __init__(self, look: Look) -> None:
        from ..mannequin import build
        from .scene import Scene

        self._look = look
        self._scene = Scene(build(), look.width, look.height, look.background)

    def draw(self, rows: Array) -> Pictures:
        """Rows (N, …) of `pack` → (N, H, W, 3) 8-bit sRGB."""
        look = self._look
        pictures = np.empty((len(rows), look.height, look.width, 3), np.uint8)
        for picture, row in zip(pictures, rows, strict=True):
            rotations, positions, face, box = np.split(row, _ENDS[:-1])
            camera = look.view.camera(box[:3], box[3:], look.width, look.height)
            picture[:] = self._scene.draw(camera, rotations.reshape(-1, 4), positions.reshape(-1, 3), face)
        return pictures


class Helper:
    """A renderer in a process of its own."""

    def __init__(self, look: Look) -> None:
        self._shape = (look.height, look.width, 3)
        path = os.pathsep.join([str(Path(__file__).parents[3]), *filter(None, [os.environ.get("PYTHONPATH")])])
        # -P: a numpy.py in the folder we work in is none of ours;
        # one thread each, as there is one helper per core; and memory of big arrays is kept instead of given back to the
        # system (glibc), which saves a sixth of the time
        settings = {"OPENBLAS_NUM_THREADS": "1", "MALLOC_TRIM_THRESHOLD_": "500000000", "MALLOC_MMAP_THRESHOLD_": "500000000"}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "cospeech.export.render.worker", json.dumps(asdict(look))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **settings, "PYTHONPATH": path},
        )

    def draw(self, rows: Array) -> Pictures:
        """As `FrameRenderer.draw`.

        Raises:
            InternalError: the process died.
        """
        pictures = np.empty((len(rows), *self._shape), np.uint8)
        try:
            self._process.stdin.write(struct.pack("<I", len(rows)) + rows.astype("<f4").tobytes())  # type: ignore[union-attr]
            self._process.stdin.flush()  # type: ignore[union-attr]
            if _fill(self._process.stdout, pictures):
                return pictures
        except (OSError, ValueError):
            pass
        try:
            code = self._process.wait(1)  # its pipes close a moment before it is gone
        except subprocess.TimeoutExpired:
            code = None
        raise InternalError(f"a process that draws pictures ended early (code {code})", "is memory short?")

    def close(self) -> None:
        """End the process, at work or not."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # what was not yet written cannot be any more
                pipe.close()  # type: ignore[union-attr]


def _fill(pipe: IO[bytes] | None, array: NDArray[Any]) -> bool:
    """Read exactly as many bytes as fit in ``array``; whether there were as many."""
    view = memoryview(array.data).cast("B")
    while view:
        count = pipe.readinto(view)  # type: ignore[union-attr]
        if not count:
            return False
        view = view[count:]
    return True


def _serve(look: Look) -> None:
    renderer = FrameRenderer(look)
    head = np.zeros(1, "<u4")
    while _fill(sys.stdin.buffer, head):
        rows = np.empty((int(head[0]), _ENDS[-1]), "<f4")
        if not _fill(sys.stdin.buffer, rows):
            return
        sys.stdout.buffer.write(renderer.draw(rows).data)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which then ends this process
    _look = json.loads(sys.argv[1])
    try:
        _serve(Look(_look["width"], _look["height"], View(**_look["view"]), tuple(_look["background"])))
    except BrokenPipeError:  # the parent is gone: nobody to tell, nobody to flush for
        os._exit(1)
