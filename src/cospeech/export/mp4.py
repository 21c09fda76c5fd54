"""``.mp4``: preview video, H.264 in yuv420p with the speech as AAC; plays in browsers, chats and every editor.

Motion and speech both start at time 0. The first bytes say where everything is ("faststart"), so that the film starts while
it is still being loaded. Needs PyAV, which carries FFmpeg: ``pip install -e '.[av]'``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..audio.speech import SpeechSource, open_speech
from ..errors import InputError, describe_extra
from ..motion.skeleton import Skeleton
from .render.camera import View
from .render.patch import Patch
from .video_writer import MovingWriter

__all__ = ["Writer", "is_own_film"]

_SIZE = (720, 720)  # ours: square shows arms spread wide and a face of 100 pixels, and suits phones and slides alike
_MOST_RATE = 60.0  # pictures per second; screens show no more
_AUDIO_RATE = 48_000  # Hz; what every player expects beside video
_AUDIO_BITS = 128_000  # bit/s; mono speech is transparent at this
# the clock in which the film's length is written is fine enough for 24, 25, 30, 60 Hz and the sound; usually it is 1/1000 s
_CONTAINER = {"movflags": "+faststart", "movie_timescale": "720000"}
_THREADS = 1  # of the encoder; a second one takes a third more processor time. Fixed, because the bytes depend on it
# without the macroblock tree, whose AVX code does not give the same bytes every time (2 films of 100 differ); CRF 21 then: no
# visible loss on this material. "veryfast" without what looks ahead, for cuts or for fades, with one picture to predict from,
# coarse search by whole pixels, whole blocks and one size of transform: of a figure before a backdrop the file is two fifths
# larger and looks the same, in less than half the time
_X264 = "scenecut=0:b-adapt=0:rc-lookahead=0:weightp=0:ref=1:me=dia:subme=0:partitions=none:trellis=0:8x8dct=0"
_MADE_BY = ("comment", "cospeech")  # of the file's metadata
_ENCODERS = {
    "libx264": {"crf": "21", "preset": "veryfast", "tune": "animation", "mbtree": "0", "x264-params": _X264},
    "libopenh264": {"b": "2500000"},
    "mpeg4": {"qscale": "3"},
}


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
        self._av = _pyav()
        rate = min(float(fps), _MOST_RATE) if rate is None else rate
        super().__init__(path, skeleton=skeleton, fps=fps, audio=audio, rate=rate, size=size, camera=camera, **look)
        self._reformatter = self._av.video.reformatter.VideoReformatter()  # kept: it prepares itself for a size once
        self._container: Any = None
        self._speech: SpeechSource | None = None
        self._sound: Iterator[np.ndarray] = iter(())
        self._heard = 0

    def _open(self, temporary: Path) -> None:
        if self.audio is not None:
            self._speech = open_speech(self.audio, rate=_AUDIO_RATE)
            self._sound = self._speech.blocks()
        # the name of the temporary file ends as the path's does, in upper case perhaps: hence the format by name
        self._container = self._av.open(str(temporary), "w", format="mp4", options=_CONTAINER)
        self._container.metadata.update([_MADE_BY])
        self._video = self._add_video()
        self._bare = [plane.copy() for plane in self._planes_of(self._blank)]
        self._voice: Any = None
        if self._speech is not None:
            self._voice = self._container.add_stream("aac", rate=_AUDIO_RATE, layout="mono")
            self._voice.bit_rate = _AUDIO_BITS

    def _add_video(self) -> Any:
        name = next(name for name in _ENCODERS if name in self._av.codecs_available)
        rate = Fraction(self.rate).limit_denominator(1001)
        video = self._container.add_stream(name, rate=rate, options=_ENCODERS[name])
        video.width, video.height = (side + side % 2 for side in self.size)
        video.pix_fmt = "yuv420p"
        video.codec_context.thread_count = _THREADS
        video.codec_context.time_base = 1 / rate
        # BT.709, limited range: said in the file, so that all players show the same colours
        video.codec_context.colorspace, video.codec_context.color_range = 1, 1
        video.codec_context.color_primaries, video.codec_context.color_trc = 1, 1
        return video

    def _picture(self, patch: Patch) -> None:
        frame = self._av.VideoFrame(self._video.width, self._video.height, "yuv420p")
        changed = self._planes_of(patch.pixels) if patch.pixels.size else ()
        for k, (plane, bare) in enumerate(zip(_views(frame), self._bare, strict=True)):
            plane[:] = bare
            if changed:
                top, left = (patch.top, patch.left) if k == 0 else (patch.top // 2, patch.left // 2)
                height, width = changed[k].shape
                plane[top : top + height, left : left + width] = changed[k]
        frame.pts, frame.duration, frame.time_base = self.pictures, 1, self._video.codec_context.time_base
        self._container.mux(self._video.encode(frame))
        self._speak(Fraction(self.pictures + 1) * self._video.codec_context.time_base)

    def _planes_of(self, picture: np.ndarray) -> list[np.ndarray]:
        """Brightness (H, W) and the two colour planes, half as high and wide, of (h, w, 3) sRGB; odd sides grow by a pixel."""
        odd = [(0, side % 2) for side in picture.shape[:2]]
        if odd != [(0, 0), (0, 0)]:
            picture = np.pad(picture, [*odd, (0, 0)], mode="edge")
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        return _views(self._reformatter.reformat(frame, format="yuv420p", dst_colorspace=1, dst_color_range=1))

    def _speak(self, until: Fraction) -> None:
        """Encode speech up to a time in seconds, so that sound and picture lie side by side in the file."""
        while self._voice is not None and self._heard < until * _AUDIO_RATE:
            block = next(self._sound, None)
            if block is None:
                return
            for start in range(0, len(block), _AUDIO_RATE):
                self._hear(block[start : start + _AUDIO_RATE])

    def _hear(self, samples: np.ndarray) -> None:
        frame = self._av.AudioFrame.from_ndarray(np.clip(samples, -1, 1)[None], format="fltp", layout="mono")
        frame.sample_rate, frame.pts, frame.time_base = _AUDIO_RATE, self._heard, Fraction(1, _AUDIO_RATE)
        self._heard += len(samples)
        self._container.mux(self._voice.encode(frame))

    def _close(self) -> None:
        self._container.mux(self._video.encode(None))
        if self._voice is not None:
            self._container.mux(self._voice.encode(None))
        self._container.close()
        self._container = None

    def _discard(self) -> None:
        super()._discard()
        if self._speech is not None:
            self._speech.close()
        if self._container is not None:
            with suppress(self._av.FFmpegError):
                self._container.close()
            self._container = None


def _views(frame: Any) -> list[np.ndarray]:
    """The planes of a picture of PyAV, (height, width) each, in its own memory."""
    rows = ((np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size), plane) for plane in frame.planes)
    return [whole[: plane.height, : plane.width] for whole, plane in rows]


def is_own_film(path: Path) -> bool:
    """Whether a file is a video that we wrote; False where PyAV is not installed."""
    try:
        import av

        with av.open(str(path)) as film:
            key, name = _MADE_BY
            return bool(film.metadata.get(key) == name)
    except (ImportError, OSError, ValueError):  # those of FFmpeg are among the last two
        return False


def _pyav() -> ModuleType:
    try:
        import av
    except ImportError:
        raise InputError("writing .mp4 needs PyAV, which is not installed", describe_extra("av")) from None
    return av
