"""The common base of the moving previews, .mp4 and .gif: a film is drawn while motion comes in."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from os import PathLike
from pathlib import Path

from ..motion.motion import Motion
from ..motion.skeleton import Skeleton
from . import Writer
from .avatar import Avatar
from .pictures import Subject, background_of, size_of
from .render.camera import View, find_view
from .render.frames import FrameStream
from .render.light import draw_backdrop
from .render.patch import Patch
from .render.worker import Look

__all__ = ["MovingWriter"]


class MovingWriter(Writer):
    """A Writer of a sequence of pictures.

    Subclasses implement ``_open(temporary)`` and ``_picture(patch)``, and end their file in ``_close()``.

    Args:
        size: (width, height) in pixels.
        camera: name of a view (`cospeech.export.render.camera.CAMERAS`), or a view.
        rate: pictures per second.
        background: sRGB colour of the backdrop, 0 … 255 each.
        avatar: file of somebody's character, in place of our mannequin.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        skeleton: Skeleton,
        fps: float,
        audio: str | PathLike[str] | None = None,
        size: tuple[int, int],
        camera: str | View,
        rate: float,
        background: tuple[int, int, int] | None = None,
        avatar: Avatar | str | PathLike[str] | None = None,
    ) -> None:
        super().__init__(path, skeleton=skeleton, fps=fps, audio=audio)
        self.size, self.rate, self.pictures = size_of(size), float(rate), 0
        self._subject, view, colour = Subject(avatar), find_view(camera), background_of(background)
        look = Look(*self.size, self._subject.fit(view), colour, self._subject.path, self._subject.bone_map)
        self._frame_stream = FrameStream(look, self.fps, self.rate, self._subject.character)
        self._blank = draw_backdrop(*self.size, colour)

    @abstractmethod
    def _open(self, temporary: Path) -> None: ...

    @abstractmethod
    def _picture(self, patch: Patch) -> None: ...

    @abstractmethod
    def _close(self) -> None: ...

    def _begin(self, temporary: Path) -> None:
        self._open(temporary)

    def _write(self, motion: Motion) -> None:
        self._take(self._frame_stream.push(self._subject.pose(motion)))

    def _finish(self) -> None:
        self._take(self._frame_stream.flush())
        self._close()

    def _take(self, patches: Iterable[Patch]) -> None:
        for patch in patches:
            self._picture(patch)
            self.pictures += 1

    def _discard(self) -> None:
        with suppress(OSError):
            self._frame_stream.close()
