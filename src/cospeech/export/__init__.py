"""Motion files: one module per format, each with a ``Writer`` and, where the format can be read, a ``load``.

The suffix picks the module. A `Writer` takes motion in pieces, so that hours of it never have to be in memory at once;
``save`` is a writer that gets one piece.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from contextlib import AbstractContextManager
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError
from ..files import atomic
from ..motion.motion import Motion
from ..motion.skeleton import Skeleton

__all__ = ["FORMATS", "Format", "Writer", "check_parts", "load", "open_writer", "save"]


class Format(NamedTuple):
    """A row of the table of formats."""

    module: str
    what: str
    readable: bool
    holds: tuple[str, ...] = ("face", "body", "hands")
    """Parts of a character."""


FORMATS: dict[str, Format] = {
    ".bvh": Format("cospeech.export.bvh", "skeleton animation, centimetres, T-pose rest", True, ("body", "hands")),
    ".glb": Format("cospeech.export.glb", "skinned character with 52 morph targets, animated", True),
    ".vrma": Format("cospeech.export.vrma", "VRM animation 1.0, for any VRM avatar", True),
    ".csv": Format("cospeech.export.live_link_csv", "Live Link Face recording, 61 channels", True, ("face",)),
    ".json": Format("cospeech.export.arkit_json", "ARKit-52 weights in BEAT's face layout", True, ("face",)),
    ".npz": Format("cospeech.export.npz", "SMPL-X poses in BEAT2's layout", True),
    ".mp4": Format("cospeech.export.mp4", "preview video with the speech", False),
    ".gif": Format("cospeech.export.gif", "moving preview picture", False),
    ".png": Format("cospeech.export.png", "strip of frames with the waveform", False),
}
"""Suffix → module; `cospeech list formats` and the tests iterate over it."""


class Writer(AbstractContextManager["Writer"], ABC):
    """Writes one file from pieces of motion; as a context manager it commits on success and leaves nothing on failure.

    A file without a frame is no success.

    Subclasses implement ``_begin(temporary_path)``, ``_write(motion)`` and ``_finish()``; ``_discard()`` may close handles.

    Args:
        path: the file to be.
        skeleton: of the pieces to come.
        fps: of the pieces to come.
        audio: path of the speech, for formats that carry or draw it.
        options: what a format offers beyond this (documented at its Writer).
    """

    def __init__(
        self, path: str | PathLike[str], *, skeleton: Skeleton, fps: float, audio: str | PathLike[str] | None = None
    ) -> None:
        self.path, self.skeleton, self.fps, self.audio = Path(path), skeleton, float(fps), audio
        self.frames = 0
        self._atomic = atomic(self.path)

    @abstractmethod
    def _begin(self, temporary: Path) -> None: ...

    @abstractmethod
    def _write(self, motion: Motion) -> None: ...

    @abstractmethod
    def _finish(self) -> None: ...

    def _discard(self) -> None:
        """Close what is open; called when something failed, and after ``_finish`` too."""

    def __enter__(self) -> Writer:
        temporary = self._atomic.__enter__()
        try:
            self._begin(temporary)
        except BaseException as error:
            self._discard()
            self._atomic.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def write(self, motion: Motion) -> None:
        """Append a piece of motion of the announced skeleton and fps."""
        if motion.fps != self.fps or len(motion.skeleton) != len(self.skeleton):
            raise InputError(f"writer of {self.fps} fps and {len(self.skeleton)} joints got other motion")
        if len(motion):
            self._write(motion)
        self.frames += len(motion)

    def __exit__(self, kind, error, trace) -> None:  # type: ignore[no-untyped-def]
        if kind is None:
            try:
                if not self.frames:
                    raise InputError(f"no motion to write to {str(self.path)!r}", "it has no frames")
                self._finish()
            except BaseException as failure:
                self._discard()
                self._atomic.__exit__(type(failure), failure, failure.__traceback__)
                raise
        self._discard()
        # a raised error passes through; contextmanager's __exit__ re-raises it itself, hence the comparison
        try:
            self._atomic.__exit__(kind, error, trace)
        except BaseException as failure:
            if failure is not error:
                raise


def format_of(path: str | PathLike[str]) -> Format:
    """Look up the format of ``path`` by its suffix.

    Raises:
        InputError: unknown suffix; the message lists those that are known.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"cannot tell the format of {str(path)!r}", f"known suffixes: {' '.join(FORMATS)}")
    return FORMATS[suffix]


def check_parts(path: str | PathLike[str], parts: Collection[str], whose: str) -> None:
    """Whether a file can show anything of some parts of a character.

    Args:
        path: of the file to be.
        parts: of face, body and hands, what there is to show.
        whose: the beginning of the message: ``"--parts face makes"``, say.

    Raises:
        InputError: its format holds none of them; the message names those that do.
    """
    holds = format_of(path).holds
    if not {*parts} & {*holds}:
        fit = " ".join(suffix for suffix, entry in FORMATS.items() if {*parts} & {*entry.holds})
        problem = (
            f"{str(path)!r} would not move: {whose} {_listed(parts)} only, {Path(path).suffix} files hold {_listed(holds)}"
        )
        raise InputError(problem, f"for {_listed(parts)}: {fit}")


def _listed(parts: Collection[str]) -> str:
    return " and ".join(parts)


def open_writer(path: str | PathLike[str], *, skeleton: Skeleton, fps: float, **options: object) -> Writer:
    """A writer for ``path``, chosen by its suffix; use it in a ``with`` block."""
    return import_module(format_of(path).module).Writer(path, skeleton=skeleton, fps=fps, **options)


def save(motion: Motion, path: str | PathLike[str], **options: object) -> None:
    """Write a whole motion to ``path``."""
    with open_writer(path, skeleton=motion.skeleton, fps=motion.fps, **options) as writer:
        writer.write(motion)


def load(path: str | PathLike[str], **options: object) -> Motion:
    """Read a motion file of any readable format.

    Raises:
        InputError: the format is unknown or cannot be read, or the file is damaged.
    """
    if str(path) == "-":
        raise InputError("motion does not come by standard input", f"name a file: {' '.join(FORMATS)}")
    if Path(path).suffix.lower() not in FORMATS and Path(path).is_dir():
        raise InputError(f"cannot read {str(path)!r}: it is a folder", "name a motion file")
    entry = format_of(path)
    if not entry.readable:
        raise InputError(f"{Path(path).suffix} files can be written but not read", "load a .bvh, .glb, .vrma or .npz")
    return import_module(entry.module).load(path, **options)
