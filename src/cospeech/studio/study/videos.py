"""Videos that somebody brings to a study: copied without a word about the system, and compared with each other."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ...errors import CospeechWarning, InputError
from ...export.film_encoder import import_pyav

__all__ = ["VIDEOS", "check_alike", "copy_video", "look_at_video"]

VIDEOS = (".mp4", ".webm")
CODECS = ("h264", "vp8", "vp9", "av1")
"""That the common browsers play."""
_LENGTH = 0.5  # seconds by which clips of one speech may differ; ours: less than a rater sees in the player's clock


class VideoFacts(NamedTuple):
    """What of a video could tell which system it is of.

    Args:
        kind: suffix of the file.
        size: pixels.
        rate: pictures per second.
        sound: whether there is any.
        seconds: how long it is.
    """

    kind: str
    size: str
    rate: str
    sound: str
    seconds: float


def look_at_video(path: Path, *, muted: bool = False) -> VideoFacts:
    """The facts of a video.

    Args:
        path: of the video.
        muted: whether its sound is left out in the study.

    Raises:
        InputError: PyAV is not installed, it cannot be read, or browsers do not play it.
    """
    av = import_pyav()
    try:
        with av.open(str(path)) as read:
            if not read.streams.video:
                raise InputError(f"{str(path)!r} shows nothing", "a video is needed")
            video = read.streams.video[0]
            codec, rate = video.codec_context.name, float(video.average_rate or 0)
            seconds = float(read.duration or 0) / av.time_base
            size, sound = f"{video.width} × {video.height} pixels", bool(read.streams.audio) and not muted
    except (av.FFmpegError, ValueError, OSError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot copy the video {str(path)!r}: {error}", _PLAYED) from None
    if not any(codec.startswith(name) or name in codec for name in CODECS):
        raise InputError(f"browsers do not play {str(path)!r}: its pictures are {codec}", _PLAYED)
    suffix = path.suffix.lower()
    return VideoFacts(suffix, size, f"{rate:.4g} pictures per second", "sound" if sound else "no sound", seconds)


def check_alike(clips: Mapping[Path, tuple[str, VideoFacts]], *, allow: bool = False) -> None:
    """All clips look alike but for their motion.

    Args:
        clips: file → its speech, and its facts.
        allow: whether a difference is only told.

    Raises:
        InputError: two of them differ in kind, size, rate or sound, or two of one speech in length.
    """
    first, (_, usual) = next(iter(clips.items()))
    problems = []
    for path, (_, facts) in clips.items():
        if odd := [(a, b) for a, b in zip(usual[:4], facts[:4], strict=True) if a != b]:
            problems.append(f"{str(path)!r} has {odd[0][1]}, and {str(first)!r} {odd[0][0]}")
    by_speech: dict[str, list[tuple[float, Path]]] = {}
    for path, (stimulus, facts) in clips.items():
        by_speech.setdefault(stimulus, []).append((facts.seconds, path))
    for found in by_speech.values():
        (least, short), (most, long) = min(found), max(found)
        if most - least > _LENGTH:
            problems.append(f"{str(long)!r} has {most:.4g} s, and {str(short)!r} {least:.4g} s")
    if not problems:
        return
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    if not allow:
        hint = (
            "raters would know the system by it: render all clips alike, or give motion files; --allow-differences takes them"
        )
        raise InputError(f"clips differ: {problems[0]}{more}", hint)
    warnings.warn(f"clips differ, and raters may know the system by it: {problems[0]}{more}", CospeechWarning, stacklevel=3)


def copy_video(source: Path, target: Path, *, sound: bool) -> None:
    """A video without its title and other words, which could name the system, and without sound if none is wanted.

    Raises:
        InputError: PyAV is not installed, or the video cannot be read.
    """
    av = import_pyav()
    try:
        with av.open(str(source)) as read, av.open(str(target), "w", format=target.suffix[1:]) as written:
            streams = [*read.streams.video[:1], *(read.streams.audio[:1] if sound else ())]
            made = {stream.index: written.add_stream_from_template(stream) for stream in streams}
            for stream in made.values():
                stream.metadata.clear()
            for packet in read.demux(streams):
                if packet.dts is not None:
                    packet.stream = made[packet.stream.index]
                    written.mux(packet)
    except (av.FFmpegError, ValueError, OSError) as error:
        why = str(error).replace(str(target), target.name)
        raise InputError(f"cannot copy the video {str(source)!r}: {why}", _PLAYED) from None


_PLAYED = "is it H.264 in .mp4, or VP9 in .webm?"
