"""Draw pictures from rows of numbers: in this process, or in a child process, which `cospeech.audio.worker` starts.

The child process (`_draw.py`) gets the look of the pictures in JSON as its argument.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...audio.worker import Worker, WorkerEnded, worker_command
from ...errors import InternalError
from ...motion.rotations import Array
from ...motion.skeleton import humanoid
from ...motion.skeletons.arkit import ARKIT
from ..mannequin.character import Character
from .camera import Camera, View
from .framing import FramedPose
from .patch import Patch

__all__ = ["ROW", "FrameRenderer", "Helper", "Look", "find_character", "pack"]

Pictures = NDArray[np.uint8]
_WIDTHS = (4 * len(humanoid()), 3 * len(humanoid()), len(ARKIT), 6)  # of a row: rotations, positions, face, box
_ENDS = np.cumsum(_WIDTHS)
_PLACE = np.dtype("<u4")  # of each number of the place of a patch
ROW = sum(_WIDTHS)
"""Numbers in a row of `pack`."""


@dataclass(frozen=True)
class Look:
    """Settings that all pictures of a film share.

    Args:
        width: pixels.
        height: pixels.
        view: how the character is looked at.
        background: 8-bit sRGB colour of the backdrop.
        avatar: the file of the character that is drawn; our mannequin where empty.
        bone_map: of that file.
        shirt: of our mannequin, see `cospeech.export.mannequin.build`.
    """

    width: int
    height: int
    view: View
    background: tuple[int, int, int]
    avatar: str = ""
    bone_map: Mapping[str, str] = field(default_factory=dict)
    shirt: int = 0


def pack(pose: FramedPose, box: Array) -> Array:
    """A row of float32 with all that one picture needs; ``box (6,)`` as `framing.Framing` gives it."""
    return np.concatenate([pose.rotations.ravel(), pose.positions.ravel(), pose.face, box]).astype("<f4")


def find_character(avatar: str, bone_map: Mapping[str, str] | None = None, shirt: int = 0) -> Character:
    """The character that is drawn: that of the file ``avatar`` with its ``bone_map``, or our mannequin in that shirt.

    Raises:
        InputError: the file is no character that can be drawn.
    """
    if avatar:
        from ..avatar_character import load_character

        return load_character(avatar, bone_map)
    from ..mannequin import build

    return build(shirt)


class FrameRenderer:
    """Draws pictures, in this process.

    Args:
        look: of the pictures.
        character: in the pictures, if `find_character` has found it already.
    """

    def __init__(self, look: Look, character: Character | None = None) -> None:
        from .scene import Scene

        self._look = look
        self._scene = Scene(
            character or find_character(look.avatar, look.bone_map, look.shirt), look.width, look.height, look.background
        )
        self._camera: Camera | None = None
        self._box = np.empty(0)

    def pictures(self, rows: Array) -> Pictures:
        """Rows (N, …) of `pack` → (N, H, W, 3) 8-bit sRGB."""
        whole = [patch.paste(self._scene.blank.copy()) for patch in self.draw(rows)]
        return np.stack(whole)

    def draw(self, rows: Array) -> Iterator[Patch]:
        """Rows (N, …) of `pack` → the patch of each picture."""
        look = self._look
        for row in rows:
            rotations, positions, face, box = np.split(row, _ENDS[:-1])
            if self._camera is None or not np.array_equal(box, self._box):  # mostly the camera stands still
                self._camera, self._box = look.view.camera(box[:3], box[3:], look.width, look.height), box
            yield self._scene.draw_part(self._camera, rotations.reshape(-1, 4), positions.reshape(-1, 3), face)


class Helper:
    """A renderer in a child process."""

    def __init__(self, look: Look) -> None:
        self._longest = _PLACE.itemsize * 4 + 3 * look.height * look.width
        # keep the memory of big arrays instead of giving it back to the system (glibc): this saves a sixth of the time
        settings = {"MALLOC_TRIM_THRESHOLD_": "500000000", "MALLOC_MMAP_THRESHOLD_": "500000000"}
        command = worker_command(Path(__file__).with_name("_draw.py"), json.dumps(asdict(look)))
        self._worker = Worker(command, settings, quiet=False)

    def draw(self, rows: Array) -> list[Patch]:
        """As `FrameRenderer.draw`.

        Raises:
            InternalError: the process died.
        """
        self._worker.request(b"R", rows.astype("<f4").tobytes())
        return [self._receive() for _ in rows]

    def _receive(self) -> Patch:
        try:
            _, answer = self._worker.receive(self._longest)
        except WorkerEnded as ended:
            raise InternalError(f"a process that draws pictures ended early (code {ended.code})", "is memory short?") from None
        top, left, height, width = np.frombuffer(answer, _PLACE, 4).tolist()
        pixels = np.frombuffer(answer, np.uint8, offset=4 * _PLACE.itemsize)
        return Patch(top, left, pixels.reshape(height, width, 3))

    def close(self) -> None:
        """End the process, also while it works."""
        self._worker.close()
