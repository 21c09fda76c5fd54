"""``.mp4``: preview video, H.264 in yuv420p with the speech as AAC; plays in browsers, chats and every editor.

Motion and speech both start at time 0. The index is at the beginning ("faststart"), so that a film starts while it is still
being loaded. Needs PyAV, which carries FFmpeg: ``pip install -e ".[av]"``.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from ..motion.skeleton import Skeleton
from .film_encoder import MADE_BY, MOST_RATE, FilmEncoder, import_pyav
from .render.camera import View
from .render.patch import Patch
from .video_writer import MovingWriter

__all__ = ["Writer", "is_own_film"]

_SIZE = (720, 720)  # ours: square shows arms spread wide and a face of 100 pixels, and suits phones and slides alike


class Writer(MovingWriter):
    """Writes an ``.mp4``.

    Args:
        audio: the speech; the film is as long as the motion, the sound is cut or ends early where it differs.
        size: (width, height) in pixels; odd numbers are made even, as H.264 wants.
        camera: ``body``, ``full``, ``face`` or ``hands``, or a view of your own.
        rate: pictures per second; those of the motion, but at most 60, where not given.
        look: ``background``, as `MovingWriter` takes it.

    Raises:
        InputError: PyAV is not installed, or the audio cannot be read.
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
        camera: str | View = "body",
        **look: Any,
    ) -> None:
        import_pyav()
        rate = min(float(fps), MOST_RATE) if rate is None else rate
        super().__init__(path, skeleton=skeleton, fps=fps, audio=audio, rate=rate, size=size, camera=camera, **look)
        self._encoder: FilmEncoder | None = None

    def _open(self, temporary: Path) -> None:
        sounds = () if self.audio is None else (self.audio,)
        self._encoder = FilmEncoder(temporary, self.size, self.rate, self._blank, sounds)

    def _picture(self, patch: Patch) -> None:
        assert self._encoder is not None
        self._encoder.add(patch)

    def _close(self) -> None:
        assert self._encoder is not None
        self._encoder.close()

    def _discard(self) -> None:
        super()._discard()
        if self._encoder is not None:
            self._encoder.discard()


def is_own_film(path: Path) -> bool:
    """Whether a file is a video that we wrote; False where PyAV is not installed."""
    try:
        import av

        with av.open(str(path)) as film:
            key, name = MADE_BY
            return bool(film.metadata.get(key) == name)
    except (ImportError, OSError, ValueError):  # FFmpeg's errors are of the last two kinds
        return False
