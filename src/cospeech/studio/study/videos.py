"""Videos of users for a study: they are checked, compared, and copied without text that could name the system."""

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
"""Codecs that the common browsers play."""
_LENGTH = 0.5  # seconds by which clips of one speech may differ [ours: less than a rater sees in the player's clock]


class VideoFacts(NamedTuple):
    """Facts of a video by which raters could recognise its system.

    Args:
        kind: suffix of the file.
        size: pixels.
        rate: pictures per second.
        sound: whether there is any.
        seconds: its length.
    """

    kind: str
    size: str
    rate: str
    sound: str
    seconds: float


def look_at_video(path: Path, *, muted: bool = False) -> VideoFacts:
    """Read the facts of a video.

    Args:
        path: of the video.
        muted: whether its sound is left out in the study.

    Raises:
        InputError: PyAV is not installed, it cannot be read, or browsers do not play it.
    """
    av = import_pyav()
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise InputError(f"{str(path)!r} shows nothing", "a video is needed")
            video = container.streams.video[0]
            codec, rate = video.codec_context.name, float(video.average_rate or 0)
            seconds = float(container.duration or 0) / av.time_base
            size, sound = f"{video.width} × {video.height} pixels", bool(container.streams.audio) and not muted
    except (av.FFmpegError, ValueError, OSError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot copy the video {str(path)!r}: {error}", _PLAYED) from None
    if not any(codec.startswith(name) or name in codec for name in CODECS):
        raise InputError(f"browsers do not play {str(path)!r}: its pictures are {codec}", _PLAYED)
    suffix = path.suffix.lower()
    return VideoFacts(suffix, size, f"{rate:.4g} pictures per second", "sound" if sound else "no sound", seconds)


def check_alike(clips: Mapping[Path, tuple[str, VideoFacts]], *, allow: bool = False) -> None:
    """Check that clips differ in motion alone.

    Args:
        clips: file → its speech, and its facts.
        allow: whether a difference is only a warning.

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
    for group in by_speech.values():
        (least, short), (most, long) = min(group), max(group)
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
    """Copy a video without its title and other text, which could name the system, and without sound if ``sound`` is False.

    Raises:
        InputError: PyAV is not installed, or the video cannot be read.
    """
    av = import_pyav()
    try:
        with av.open(str(source)) as reader, av.open(str(target), "w", format=target.suffix[1:]) as writer:
            streams = [*reader.streams.video[:1], *(reader.streams.audio[:1] if sound else ())]
            out_streams = {stream.index: writer.add_stream_from_template(stream) for stream in streams}
            for stream in out_streams.values():
                stream.metadata.clear()
            for packet in reader.demux(streams):
                if packet.dts is not None:
                    packet.stream = out_streams[packet.stream.index]
                    writer.mux(packet)
    except (av.FFmpegError, ValueError, OSError) as error:
        why = str(error).replace(str(target), target.name)
        raise InputError(f"cannot copy the video {str(source)!r}: {why}", _PLAYED) from None


_PLAYED = "is it H.264 in .mp4, or VP9 in .webm?"
