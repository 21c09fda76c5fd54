"""Motion files: one module per format, each with a ``Writer`` and, where the format can be read, a ``load``.

The suffix picks the module; `cospeech.export.registry` has the table. A `Writer` takes motion in pieces, so that hours of it
never have to be in memory at once; ``save`` cuts what it writes, too, as a writer needs several times the memory of a piece.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from inspect import isabstract
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..files import atomic
from .keyword_options import check_options
from .registry import FORMATS, Format, check_parts, format_of, reads_body, suffixes

if TYPE_CHECKING:  # the table of formats is read where nothing heavy is imported
    from ..motion.motion import Motion
    from ..motion.skeleton import Skeleton

__all__ = ["FORMATS", "Format", "Writer", "check_parts", "format_of", "load", "open_writer", "read", "save"]

_PIECE = 4096  # frames that `save` gives to a writer at once [ours: two minutes, 10 MB]


class Writer(AbstractContextManager["Writer"], ABC):
    """Writes one file from pieces of motion; as a context manager it commits on success and leaves nothing on failure.

    A file without a frame is no success.

    Subclasses implement ``_begin(temporary_path)``, ``_write(motion)`` and ``_finish()``; ``_discard()`` may close handles.

    Args:
        path: the file to be.
        skeleton: of the pieces to come.
        fps: of the pieces to come.
        audio: path of the speech, for formats that carry or draw it.
        options: further keywords of a format (documented at its Writer).
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
        """Close what is open; called after an error, and after ``_finish``, too."""

    def __enter__(self) -> Writer:
        self._temporary = self._atomic.__enter__()
        try:
            self._begin(self._temporary)
        except BaseException as error:
            self._discard()
            self._atomic.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def write(self, motion: Motion) -> None:
        """Append a piece of motion of the announced skeleton and fps.

        Raises:
            InputError: it has another skeleton, or another rate.
        """
        if motion.fps != self.fps or motion.skeleton != self.skeleton:
            problem = f"a writer of {self.fps:g} frames per second and {self.skeleton!r} got other motion"
            raise InputError(f"{problem}: {motion!r} of {motion.skeleton!r}", "use motion.resample or motion.retarget first")
        if len(motion):
            self._write(motion)
        self.frames += len(motion)

    def __exit__(self, kind, error, trace) -> None:  # type: ignore[no-untyped-def]
        failure: BaseException | None = error
        if failure is None:
            try:
                if not self.frames:
                    raise InputError(f"no motion to write to {str(self.path)!r}", "it has no frames")
                self._finish()
            except BaseException as raised:
                failure = raised
        self._discard()
        if failure is None and self._temporary.is_file() and not self._temporary.stat().st_size:
            failure = InputError(f"nothing was written to {str(self.path)!r}", "_begin is given the path to write to")
        # a raised error passes through; contextmanager's __exit__ re-raises it itself, hence the comparison
        try:
            self._atomic.__exit__(None if failure is None else type(failure), failure, getattr(failure, "__traceback__", None))
        except BaseException as raised:
            if raised is not failure:
                raise
        if failure is not error and failure is not None:
            raise failure


def open_writer(path: str | PathLike[str], *, skeleton: Skeleton, fps: float, **options: object) -> Writer:
    """A writer for ``path``, chosen by its suffix; use it in a ``with`` block.

    Raises:
        InputError: the format is unknown, has no such option, or its module has no `Writer`.
    """
    code = _find_writer(path)
    check_options(code, options, Path(path).suffix, "written")
    writer: Writer = code(path, skeleton=skeleton, fps=fps, **options)
    return writer


def save(motion: Motion, path: str | PathLike[str], **options: object) -> None:
    """Write a whole motion to ``path``.

    Args:
        motion: what is written.
        path: its suffix picks the format.
        options: keywords of the format's ``Writer``. An ``audio`` may be a `cospeech.Speech`, too.

    Raises:
        InputError: the format is unknown, or has no such option.
    """
    from .sound_file import as_sound_file

    audio: Any = options.get("audio")
    with as_sound_file(audio) as sound:
        options |= {"audio": sound} if "audio" in options else {}
        with open_writer(path, skeleton=motion.skeleton, fps=motion.fps, **options) as writer:
            for first in range(0, len(motion), _PIECE):
                writer.write(motion[first : first + _PIECE])


def load(path: str | PathLike[str], **options: object) -> Motion:
    """Read a motion file of any readable format.

    Args:
        path: its suffix picks the format.
        options: keywords of the format's ``load``. A ``bone_map`` may be a file (`cospeech.motion.bone_mapping.load_map`).

    Raises:
        InputError: the format is unknown or cannot be read, or has no such option; the file is damaged; or a bone map names
            joints that the file lacks.
    """
    bones: Any = options.get("bone_map")
    if isinstance(bones, (str, PathLike)):
        from ..motion.bone_mapping import load_map

        options["bone_map"] = bones = load_map(bones)
    motion = read(path, **options)
    if bones:
        from .checks import check_map

        check_map(bones, {str(path): motion.skeleton}, None)
    return motion


def read(path: str | PathLike[str], **options: object) -> Motion:
    """As `load`; a map of other joints changes nothing."""
    readable = suffixes(lambda entry: entry.readable)
    if str(path) == "-":
        raise InputError("motion does not come by standard input", f"name a file: {' '.join(readable)}")
    if Path(path).suffix.lower() not in FORMATS:
        if Path(path).is_dir():
            raise InputError(f"cannot read {str(path)!r}: it is a folder", "name a motion file")
        raise InputError(f"cannot tell the format of {str(path)!r}", f"motion is read from {' '.join(readable)}")
    entry = format_of(path)
    if not entry.readable:
        *most, last = suffixes(reads_body)
        raise InputError(f"{Path(path).suffix} files can be written but not read", f"load a {', '.join(most)} or {last}")
    code = _find_code(path, "load")
    check_options(code, options, Path(path).suffix, "read")
    from ..motion.motion import Motion

    motion = code(path, **options)
    if not isinstance(motion, Motion):
        raise InputError(f"{code.__module__}.load gives {type(motion).__name__}", "it gives a cospeech.Motion")
    return motion


def _find_writer(path: str | PathLike[str]) -> Any:
    """The class that writes a path's format."""
    code = _find_code(path, "Writer")
    if not (isinstance(code, type) and issubclass(code, Writer)) or isabstract(code):
        hint = "a subclass of cospeech.export.Writer with _begin, _write and _finish"
        raise InputError(f"the Writer of {format_of(path).module} cannot write {Path(path).suffix} files", hint)
    return code


def _find_code(path: str | PathLike[str], attribute: str) -> Any:
    """Get an attribute of the module of a path's format."""
    return FORMATS.find_code(Path(path).suffix.lower(), format_of(path).module, attribute)
