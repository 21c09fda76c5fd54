"""``.png``: a strip, some moments of the motion above the waveform of the speech, as papers about gesture show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..audio.speech import Word, open_speech
from ..errors import InputError
from ..limits import PLAUSIBLE_SECONDS
from ..motion.motion import Motion
from ..motion.skeleton import Skeleton
from . import Writer as BaseWriter
from .avatar import Avatar
from .pictures import Subject, background_of, size_of
from .render.camera import View, find_view
from .render.crops import Crops, crop_poses
from .render.framing import FramedPose, PoseStage, boxes_of
from .render.keyframes import Keyframes
from .render.worker import FrameRenderer, Look, find_character, pack

if TYPE_CHECKING:
    from .mannequin.character import Character
    from .render.strip import StripLayout

__all__ = ["Writer"]

_SIZE = (1600, 640)  # ours: seven standing figures and a waveform, readable at the width of a page
_PICTURES, _FEWEST = 7, 4  # where no number is given; ours
_FAR = 1.25  # ours: more pictures are taken as long as the camera need not stand back by more than this
_FAR_FACE = 1.1  # the same of a view that follows the head: lips and eyes are small; ours
_AUDIO_RATE = 16_000  # Hz; enough to look at
_STEP = 160  # samples per value of the waveform: 10 ms, so that three hours take 9 MB


class Writer(BaseWriter):
    """Writes a strip as ``.png``, in constant memory.

    Args:
        audio: the speech, drawn as a waveform.
        size: (width, height) of the whole strip in pixels.
        camera: ``full``, ``body``, ``face`` or ``hands``.
        background: sRGB colour of the backdrop.
        pictures: how many moments to show, 1 … 24; where not given 4 to 7, as many as leave the figures large.
        words: of the speech, written below the waveform.
        start: seconds at which the motion begins, where it is a part of a longer take; it is added to the times in the picture.
        avatar: file of somebody's character, in place of our mannequin.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        skeleton: Skeleton,
        fps: float,
        audio: str | PathLike[str] | None = None,
        size: tuple[int, int] = _SIZE,
        camera: str = "full",
        background: tuple[int, int, int] | None = None,
        pictures: int | None = None,
        words: Sequence[Word] = (),
        start: float = 0.0,
        avatar: Avatar | str | PathLike[str] | None = None,
    ) -> None:
        super().__init__(path, skeleton=skeleton, fps=fps, audio=audio)
        self._size, self._view, self._background = size_of(size), find_view(camera), background_of(background)
        if not (200 <= self._size[0] <= 8192 and 160 <= self._size[1] <= 4096):
            raise InputError(f"a strip of {self._size[0]} × {self._size[1]} pixels", "200 × 160 … 8192 × 4096")
        if pictures is not None and not 1 <= pictures <= 24:
            raise InputError(f"a strip of {pictures} pictures", "1 … 24")
        if not 0 <= start < PLAUSIBLE_SECONDS:
            raise InputError(f"a strip that begins at {start} s", "seconds, from 0 on")
        self._pictures, self._words, self._start = pictures, tuple(words), start
        self._subject = Subject(avatar)
        self._view = self._subject.fit(self._view)
        self._stage = PoseStage(self._subject.skeleton, self.fps)
        self._moments = Keyframes(self._subject.skeleton, self.fps)

    def _begin(self, temporary: Path) -> None:
        self._temporary = temporary
        if self.audio is not None:  # a file that cannot be read is reported before the work
            open_speech(self.audio).close()

    def _write(self, motion: Motion) -> None:
        self._moments.push(self._stage.place(self._subject.pose(motion)))

    def _finish(self) -> None:
        from PIL import Image

        from .render.strip import draw_strip

        character = self._subject.character or find_character("")
        layout, moments, crops = self._lay_out(character)
        poses = [pose for _, pose in moments]
        boxes = boxes_of(self._view, self._subject.skeleton, poses) if crops is None else [crops.box] * len(poses)
        width, height = layout.cell[0] if crops is None else crops.width, layout.cell[1]
        look = Look(width, height, self._view, self._background, self._subject.path, self._subject.bone_map)
        rows = np.stack([pack(pose, box) for pose, box in zip(poses, boxes, strict=True)])
        pictures = list(FrameRenderer(look, character).pictures(rows))
        if crops is not None:
            pictures = [picture[:, left:right] for picture, (left, right) in zip(pictures, crops.columns, strict=True)]
        times = [frame / self.fps for frame, _ in moments]
        duration = self._moments.frames / self.fps
        sheet = draw_strip(layout, pictures, times, duration, self._sound(), self._words)
        Image.fromarray(sheet).save(self._temporary, "PNG", optimize=True)

    def _lay_out(self, character: Character) -> tuple[StripLayout, list[tuple[int, FramedPose]], Crops | None]:
        """The strip, the moments that it shows, and how their pictures are cropped; a view that follows a joint crops none."""
        from .render.strip import StripLayout

        for count in range(self._pictures or _PICTURES, 0, -1):
            moments = self._moments.best(count)
            layout = StripLayout(*self._size, len(moments), rows=2 if self._words else 0, start=self._start)
            if self._view.follows:
                if self._pictures or count <= _FEWEST or _stand_back(self._view, *layout.cell) <= _FAR_FACE:
                    return layout, moments, None
                continue
            crops = crop_poses(self._view, character, [pose for _, pose in moments], layout.room, layout.cell[1])
            if self._pictures or count <= _FEWEST or crops.far <= _FAR:
                break
        widths = tuple(right - left for left, right in crops.columns)
        return replace(layout, widths=widths), moments, crops

    def _sound(self):  # type: ignore[no-untyped-def]
        """The waveform of the speech, or None without one."""
        from .render.strip import Sound

        if self.audio is None:
            return None
        peaks, levels, rest = [], [], np.zeros(0, np.float32)
        with open_speech(self.audio, rate=_AUDIO_RATE) as speech:
            for block in speech.blocks():
                block = np.concatenate([rest, block])
                whole = len(block) // _STEP * _STEP
                rest, steps = block[whole:], block[:whole].reshape(-1, _STEP)
                peaks.append(np.abs(steps).max(1))
                levels.append(np.sqrt(np.square(steps).mean(1)))
        return Sound(_STEP / _AUDIO_RATE, np.concatenate(peaks), np.concatenate(levels))


def _stand_back(view: View, width: int, height: int) -> float:
    """How much farther the camera stands than for a picture without a limit to its width."""
    low, high = np.array(view.low), np.array(view.high)
    own, free = (view.camera(low, high, broad, height).position - (low + high) / 2 for broad in (width, max(width, height)))
    return float(np.linalg.norm(own) / np.linalg.norm(free))
