"""What every reader of a corpus needs: a usable folder, the text of small files, and drops instead of errors."""

from __future__ import annotations

import codecs
import csv
import io
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from os import PathLike
from pathlib import Path

import numpy as np

from ..audio.speech import Speech
from ..errors import CospeechError, InputError
from ..files import describe_os_error, read_regular
from ..limits import CORPUS_TEXT_BYTES
from ..motion.motion import Motion
from .clip import Clip, Dropped

__all__ = [
    "check_lengths",
    "files_of",
    "load_motion",
    "load_sound",
    "number",
    "read_each",
    "read_rows",
    "read_text",
    "usable_folder",
    "words_alone",
]

_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DAMAGE = (ArithmeticError, EOFError, LookupError, ValueError, csv.Error, struct.error, zipfile.BadZipFile, zlib.error)
"""What readers of JSON, CSV, NumPy's and other files raise for a damaged one."""
_APART = 2.0  # ours: motion and speech of one take differ by seconds, never by this factor
_FAR = 100.0  # metres; ours: farther than any studio for motion capture is wide
_MARGIN = 5.0  # seconds; ours: by which short takes may differ anyway


def usable_folder(raw: str | PathLike[str], what: str) -> Path:
    """The path of a folder that can be listed.

    Raises:
        InputError: there is none.
    """
    root = Path(raw)
    try:
        if root.is_dir() and next(root.iterdir(), None) is not None:
            return root
        problem = "it is empty" if root.is_dir() else "it is not a folder" if root.exists() else "there is no such folder"
    except OSError as error:
        problem = describe_os_error(error)
    except ValueError as error:  # a NUL in the name
        problem = str(error)
    raise InputError(f"cannot read {what} from {str(root)!r}: {problem}", "name the folder that the download unpacks to")


def files_of(folder: Path, suffix: str) -> dict[str, Path]:
    """Stem → path of the files of one suffix (any case) in a folder, sorted; empty where there is no such folder.

    macOS' shadow files (``._name``) are left out.

    Raises:
        InputError: the folder cannot be listed.
    """
    if not folder.is_dir():
        return {}
    try:
        paths = (path for path in sorted(folder.iterdir()) if path.suffix.lower() == suffix.lower())
    except OSError as error:
        raise InputError(f"cannot list {str(folder)!r}: {describe_os_error(error)}", "may you read it?") from None
    return {path.stem: path for path in paths if not path.name.startswith("._")}


def read_each(names: Iterable[str], read: Callable[[str], Clip | Dropped]) -> Iterator[Clip | Dropped]:
    """One recording at a time; a damaged one becomes a `Dropped` with the reason, and the reading goes on."""
    for name in names:
        try:
            item = read(name)
        except CospeechError as error:
            item = Dropped(name, str(error))
        except OSError as error:  # taken away meanwhile, or a disk that fails
            item = Dropped(name, f"cannot read {error.filename or name!r}: {describe_os_error(error)}")
        except _DAMAGE as error:
            item = Dropped(name, f"{type(error).__name__}: {error}")
        yield item


def read_text(path: Path) -> str:
    """The text of a small regular file in UTF-8, or in UTF-16 with a byte order mark ("Unicode" on Windows).

    Raises:
        InputError: empty, too large, not text.
    """
    data = read_regular(path, "a file of annotations", CORPUS_TEXT_BYTES)
    encoding, name = ("utf-16", "UTF-16") if data.startswith(_MARKS) else ("utf-8-sig", "UTF-8")
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        byte = f"byte 0x{data[error.start]:02x} at {error.start}"
        raise InputError(f"{path.name!r} is not {name} text: {byte}", "save it as UTF-8") from None
    if "\0" in text:
        raise InputError(f"{path.name!r} holds NUL characters at {text.index(chr(0))}", "is it damaged? Save it as UTF-8 text")
    return text


def read_rows(path: Path) -> list[list[str]]:
    """The cells of a small CSV file, line by line.

    Raises:
        InputError: as of `read_text`, or it is no CSV.
    """
    rows = csv.reader(io.StringIO(read_text(path)))
    try:
        return list(rows)
    except csv.Error as error:
        raise InputError(f"{path.name!r}, line {rows.line_num}: {error}", "is it damaged?") from None


def number(word: str, low: float, high: float, place: str) -> float:
    """A finite number between ``low`` and ``high``, or an `InputError` that names the place."""
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise InputError(f"{place}: {word[:40]!r} where a number of {low:g} … {high:g} belongs", "is it damaged?")
    return value


def load_motion(path: Path, *, kind: str | None = None, fps: float | None = None, **options: object) -> Motion:
    """A motion file of the skeleton and frame rate that the corpus is known to have.

    Raises:
        InputError: it cannot be read, or has another skeleton or rate.
    """
    from ..export import load

    motion = load(path, **options)
    if kind is not None and motion.skeleton.kind != kind:
        raise InputError(f"{path.name!r} has {len(motion.skeleton)} joints that are not {kind}'s", "is it of another corpus?")
    if fps is not None and abs(motion.fps - fps) > 0.01 * fps:
        raise InputError(f"{path.name!r} runs at {motion.fps:g} frames per second where the corpus has {fps:g}")
    far = np.abs(motion.root).max(1) if len(motion) else np.zeros(0)
    if far.max(initial=0) > _FAR:
        frame = int(np.argmax(far > _FAR))
        raise InputError(f"{path.name!r}: in frame {frame} the hips are {far[frame]:.0f} m away", "is it damaged?")
    return motion


def load_sound(sound: Path | None, transcript: Path | None) -> Speech | None:
    """The speech with its words, each where there is a file for it; None without a sound."""
    return None if sound is None else Speech.load(sound, transcript=transcript)


def words_alone(sound: Path | None, transcript: Path | None, motion: Motion) -> dict[str, object]:
    """``{"words": …}`` for `Clip.extra` where there are words but no sound to hold them; else nothing."""
    if sound is not None or transcript is None:
        return {}
    from ..audio.transcripts import load_words

    return {"words": load_words(transcript, speech_seconds=motion.duration)}


def check_lengths(name: str, motion: Motion | None, speech: Speech | None) -> None:
    """Refuse a recording of which a part is missing.

    Raises:
        InputError: motion and speech differ in length by seconds and by more than a factor of two.
    """
    if motion is None or speech is None:
        return
    short, long = sorted((motion.duration, float(speech.duration)))
    if long > _APART * short and long - short > _MARGIN:
        raise InputError(f"{name}: {motion.duration:.1f} s of motion, {speech.seconds:.1f} s of speech", "is one cut short?")
