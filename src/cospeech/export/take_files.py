"""Write takes of a motion to their files, all at the same time, as the motion comes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..audio.word import Word
from ..motion.motion import Motion
from ..motion.skeleton import Skeleton
from . import FORMATS, Writer, format_of, open_writer

if TYPE_CHECKING:
    from .avatar import Avatar

__all__ = ["write_takes", "writer_keywords"]

File = str | PathLike[str]


def write_takes(
    moving: Iterator[list[Motion]],
    takes: list[list[Path]],
    target: Skeleton | None,
    fps: float,
    keywords: Mapping[str, Mapping[str, object]],
) -> set[int]:
    """Write a stream of takes, each to its files, all at once. Give their numbers of frames: one number, if all is well."""
    counts, writers = [0] * len(takes), list[Writer]()
    paths = [path for files in takes for path in files]
    any_skeleton = {path: format_of(path).any_skeleton for path in paths}
    with ExitStack() as stack:
        for pieces in moving:
            others = pieces if target is None else [piece.retarget(target) for piece in pieces]
            motions = [
                other if any_skeleton[path] else piece
                for piece, other, files in zip(pieces, others, takes, strict=True)
                for path in files
            ]
            if not writers:
                for path, motion in zip(paths, motions, strict=True):
                    more = keywords.get(path.suffix.lower(), {})
                    writer = open_writer(path, skeleton=motion.skeleton, fps=fps, **more)
                    writers.append(stack.enter_context(writer))
            for writer, motion in zip(writers, motions, strict=True):
                writer.write(motion)
            counts = [count + len(piece) for count, piece in zip(counts, pieces, strict=True)]
    return set(counts)


def writer_keywords(
    files: Sequence[Path],
    audio: File,
    avatar: Avatar | File | None,
    special: Mapping[str, Mapping[str, object]],
    words: tuple[Word, ...] | None,
) -> dict[str, dict[str, object]]:
    """Suffix → keywords for the writer of that format, beside skeleton and fps."""
    keywords: dict[str, dict[str, object]] = {}
    for suffix in {path.suffix.lower() for path in files}:
        own, entry = keywords.setdefault(suffix, {}), FORMATS[suffix]
        if entry.sound:
            own["audio"] = audio
        if entry.words and words:
            own["words"] = list(words)
        if entry.wears_avatar and avatar is not None:
            own["avatar"] = avatar
        own |= special.get(suffix, {})
    return keywords
