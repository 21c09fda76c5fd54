"""The speech that belongs to a motion, as a file: that is what writers of pictures and pages take."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from ..audio.speech import Speech
from ..errors import InputError

__all__ = ["as_sound_file"]


@contextmanager
def as_sound_file(audio: Speech | str | PathLike[str] | None) -> Iterator[str | PathLike[str] | None]:
    """The path of a sound file; a `Speech` is written to one, which is there until the end.

    Raises:
        InputError: something else.
    """
    if audio is None or isinstance(audio, (str, PathLike)):
        yield audio
        return
    if not isinstance(audio, Speech):
        raise InputError(f"audio is of type {type(audio).__name__}", "name a sound file, or give a cospeech.Speech")
    import soundfile

    with TemporaryDirectory() as folder:
        path = Path(folder) / "speech.wav"
        soundfile.write(path, audio.samples, audio.rate, subtype="FLOAT")
        yield path
