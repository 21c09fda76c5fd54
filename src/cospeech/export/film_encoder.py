"""Pictures and sound to an ``.mp4`` file: H.264 in yuv420p, and AAC. PyAV carries FFmpeg (the extra ``av``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from math import ceil
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..audio.sound_mix import SoundMix
from ..errors import InputError, describe_extra
from .render.patch import Patch

__all__ = ["MADE_BY", "MOST_RATE", "FilmEncoder", "import_pyav"]

MOST_RATE = 60.0
"""Pictures per second; screens show no more [ours]."""

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
MADE_BY = ("comment", "cospeech")
"""Key and value in the file's metadata."""
_ENCODERS = {
    "libx264": {"crf": "21", "preset": "veryfast", "tune": "animation", "mbtree": "0", "x264-params": _X264},
    "libopenh264": {"b": "2500000"},
    "mpeg4": {"qscale": "3"},
}


class FilmEncoder:
    """Encodes a film.

    Args:
        path: of the file, whatever its suffix.
        size: (width, height) in pixels; odd numbers are made even, as H.264 wants.
        rate: pictures per second.
        blank: (H, W, 3) the bare backdrop, under the patches.
        sounds: files that are mixed; they are cut where they are longer than the pictures.

    Raises:
        InputError: PyAV is not installed, or a sound cannot be read.
    """

    def __init__(
        self, path: Path, size: tuple[int, int], rate: float, blank: np.ndarray, sounds: Sequence[str | PathLike[str]]
    ) -> None:
        self._av = import_pyav()
        self._reformatter = self._av.video.reformatter.VideoReformatter()  # one for all: it prepares for a size once
        self._size, self._rate, self._pictures, self._sample_count = size, rate, 0, 0
        self._container: Any = None
        self._speech = SoundMix(sounds, _AUDIO_RATE) if sounds else None
        self._sound: Iterator[np.ndarray] = iter(()) if self._speech is None else self._speech.blocks()
        self._block: np.ndarray = np.zeros(0, np.float32)  # sound that comes after the pictures so far
        try:
            self._open(path, blank)
        except BaseException:
            self.discard()
            raise

    def _open(self, path: Path, blank: np.ndarray) -> None:
        # the temporary file has the suffix of the path, perhaps in upper case: hence the format by name
        self._container = self._av.open(str(path), "w", format="mp4", options=_CONTAINER)
        self._container.metadata.update([MADE_BY])
        self._video = self._add_video()
        self._bare = [plane.copy() for plane in self._planes_of(blank)]
        self._voice: Any = None
        if self._speech is not None:
            self._voice = self._container.add_stream("aac", rate=_AUDIO_RATE, layout="mono")
            self._voice.bit_rate = _AUDIO_BITS

    def _add_video(self) -> Any:
        name = next(name for name in _ENCODERS if name in self._av.codecs_available)
        rate = Fraction(self._rate).limit_denominator(1001)
        video = self._container.add_stream(name, rate=rate, options=_ENCODERS[name])
        video.width, video.height = (side + side % 2 for side in self._size)
        video.pix_fmt = "yuv420p"
        video.codec_context.thread_count = _THREADS
        video.codec_context.time_base = 1 / rate
        # BT.709, limited range: stated in the file, so that all players show the same colours
        video.codec_context.colorspace, video.codec_context.color_range = 1, 1
        video.codec_context.color_primaries, video.codec_context.color_trc = 1, 1
        return video

    def add(self, patch: Patch) -> None:
        """Encode the next picture: the bare backdrop with this part."""
        frame = self._av.VideoFrame(self._video.width, self._video.height, "yuv420p")
        planes = self._planes_of(patch.pixels) if patch.pixels.size else ()
        for k, (plane, bare) in enumerate(zip(_views(frame), self._bare, strict=True)):
            plane[:] = bare
            if planes:
                top, left = (patch.top, patch.left) if k == 0 else (patch.top // 2, patch.left // 2)
                height, width = planes[k].shape
                plane[top : top + height, left : left + width] = planes[k]
        frame.pts, frame.duration, frame.time_base = self._pictures, 1, self._video.codec_context.time_base
        self._container.mux(self._video.encode(frame))
        self._pictures += 1
        self._speak(Fraction(self._pictures) * self._video.codec_context.time_base)

    def _planes_of(self, picture: np.ndarray) -> list[np.ndarray]:
        """Brightness (H, W) and the two colour planes, half as high and wide, of (h, w, 3) sRGB; odd sides grow by a pixel."""
        odd = [(0, side % 2) for side in picture.shape[:2]]
        if odd != [(0, 0), (0, 0)]:
            picture = np.pad(picture, [*odd, (0, 0)], mode="edge")
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        return _views(self._reformatter.reformat(frame, format="yuv420p", dst_colorspace=1, dst_color_range=1))

    def _speak(self, until: Fraction) -> None:
        """Encode speech up to a time in seconds, so that sound and picture lie side by side in the file, and end together."""
        while self._voice is not None and (missing := ceil(until * _AUDIO_RATE) - self._sample_count) > 0:
            if not len(self._block):
                block = next(self._sound, None)
                if block is None:
                    return
                self._block = block
            count = min(missing, _AUDIO_RATE)
            part, self._block = self._block[:count], self._block[count:]
            if len(part):
                self._hear(part)

    def _hear(self, samples: np.ndarray) -> None:
        frame = self._av.AudioFrame.from_ndarray(np.clip(samples, -1, 1)[None], format="fltp", layout="mono")
        frame.sample_rate, frame.pts, frame.time_base = _AUDIO_RATE, self._sample_count, Fraction(1, _AUDIO_RATE)
        self._sample_count += len(samples)
        self._container.mux(self._voice.encode(frame))

    def close(self) -> None:
        """End the file."""
        self._container.mux(self._video.encode(None))
        if self._voice is not None:
            self._container.mux(self._voice.encode(None))
        self._container.close()
        self._container = None

    def discard(self) -> None:
        """Close what is open; after `close`, too."""
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


def import_pyav() -> ModuleType:
    """Import PyAV.

    Raises:
        InputError: it is not installed.
    """
    try:
        import av
    except ImportError:
        raise InputError("videos need PyAV, which is not installed", describe_extra("av")) from None
    return av
