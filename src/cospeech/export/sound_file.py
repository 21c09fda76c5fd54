"""The speech of a motion, or of a part of it, as a file: writers of pictures and pages take a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from ..audio.speech import Speech, SpeechSource
from ..errors import InputError
from ..files import scratch, workplace

__all__ = ["as_sound_file", "cut_sound_file"]

_FILM_RATE = 48_000  # Hz; as in a film: a part sounds as it does in the film of the whole


@contextmanager
def as_sound_file(audio: Speech | str | PathLike[str] | None) -> Iterator[str | PathLike[str] | None]:
    """Yield the path of a sound file; a `Speech` is written to a file, which exists during the block.

    Raises:
        InputError: it is something else.
    """
    if audio is None or isinstance(audio, (str, PathLike)):
        yield audio
        return
    if not isinstance(audio, Speech):
        raise InputError(f"audio is of type {type(audio).__name__}", "name a sound file, or give a cospeech.Speech")
    import soundfile

    with workplace(scratch()) as folder:
        path = folder / "speech.wav"
        soundfile.write(path, audio.samples, audio.rate, subtype="FLOAT")
        yield path


@contextmanager
def cut_sound_file(audio: str | PathLike[str], start: float, end: float | None = None) -> Iterator[Path | None]:
    """Yield the path of a file with a part of a sound; it exists during the block. Takes constant memory for sounds of any
    length.

    Args:
        audio: a sound file.
        start, end: seconds; to the end of the sound where no end is given.

    Yields:
        The path; None where the sound is over before ``start``.

    Raises:
        InputError: the sound cannot be read.
    """
    import soundfile

    first, last = round(start * _FILM_RATE), None if end is None else round(end * _FILM_RATE)
    read_count = written_count = 0
    with workplace(scratch()) as folder:
        path = folder / "speech.wav"
        with SpeechSource(audio, _FILM_RATE) as source, soundfile.SoundFile(path, "w", _FILM_RATE, 1, "FLOAT") as file:
            for block in source.blocks():
                part = block[max(first - read_count, 0) : None if last is None else max(last - read_count, 0)]
                read_count, written_count = read_count + len(block), written_count + len(part)
                file.write(part)
                if last is not None and read_count >= last:
                    break
        yield path if written_count else None
