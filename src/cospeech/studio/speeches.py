"""Speeches of the studio: each is kept as it came, for the models, and as a WAV file, for the page."""

from __future__ import annotations

import shutil
import wave
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..audio.languages import check_language, with_language
from ..audio.speech import SpeechSource, Word, example, open_speech
from ..audio.transcript_formats import SUFFIXES
from ..audio.transcripts import load_words
from ..errors import InputError
from ..rules.plan_model import words_of
from .messages import MessageWords, UploadedSpeech
from .shelf import TakeSource

__all__ = ["MINUTES", "HeldSpeech", "add_words", "hold_example", "hold_speech", "label_of", "rename_error", "set_language"]

MINUTES = 30.0
"""Length of a speech, after decoding [ours: a talk; it takes 86 MB as sound for the page]."""
_RATE = 24_000  # Hz of the sound for the page [ours: speech has little above 12 kHz, and half an hour takes 86 MB]
_PEAKS = 50  # a second
_MOST_PEAKS = 30_000  # ours: all pieces of ten minutes; a message of 0.2 MB
_LONGEST_LABEL = 120


@dataclass
class HeldSpeech(TakeSource):
    """A speech in a folder of its own."""

    folder: Path
    label: str
    """The name of its file, for people. It is never a path."""
    upload: Path
    """The file as it came."""
    seconds: float
    peaks: list[float]
    words: tuple[Word, ...] = ()
    user_language: str = ""
    """Code of the language that the user gave for the words; empty: it is found from the words."""

    @property
    def sound(self) -> Path:
        """WAV of 16 bits at 24 kHz."""
        return self.folder / "sound.wav"

    def describe(self, name: str) -> UploadedSpeech:
        """The answer to the page."""
        text = self.describe_words()
        return UploadedSpeech(
            speech=name, name=self.label, seconds=self.seconds, peaks=self.peaks, words=text.words, language=text.language
        )

    def describe_words(self) -> MessageWords:
        """The words, and their language."""
        return MessageWords(words=list(words_of(self.words)), language=self.words[0].language if self.words else "")


def label_of(name: str, usual: str) -> str:
    """Make a label of a name from outside: without folders and characters that cannot be printed.

    >>> label_of("../../etc/passwd", "talk")
    'passwd'
    """
    last = name.replace("\\", "/").rpartition("/")[2]
    return "".join(mark for mark in last if mark.isprintable()).strip(". ")[:_LONGEST_LABEL] or usual


def rename_error(error: InputError, path: Path, label: str) -> InputError:
    """The same error with the label in place of the file of the server."""
    return InputError(*(text.replace(str(path), label).replace(path.name, label) for text in (error.problem, error.hint)))


def hold_speech(folder: Path, upload: Path, label: str) -> HeldSpeech:
    """Read a file of sound, and write its WAV.

    Args:
        folder: of the speech; ``upload`` lies in it.
        upload: the file.
        label: name of the file, for people.

    Raises:
        InputError: it is no sound, or longer than `MINUTES`. A length that the file states is checked before decoding.
    """
    try:
        with open_speech(upload, rate=_RATE) as source:
            _check_length(source.expected_seconds or 0.0)
            peaks = _write_sound(source, folder / "sound.wav")
            assert source.seconds is not None
            return HeldSpeech(folder, label, upload, source.seconds, peaks)
    except InputError as error:
        raise rename_error(error, upload, label) from None


def hold_example(folder: Path) -> HeldSpeech:
    """Read the example speech of cospeech, with its words."""
    sound, words = example()
    upload = Path(shutil.copyfile(sound, folder / "upload"))
    speech = hold_speech(folder, upload, sound.name)
    speech.words = with_language(load_words(words, speech_seconds=speech.seconds))
    return speech


def add_words(speech: HeldSpeech, transcript: Path, label: str) -> None:
    """Give a speech the words of a transcript, in the language that was set. Plain text is aligned to the sound.

    Args:
        speech: the speech.
        transcript: the file, in the folder of the speech.
        label: name of the file, for people; its suffix, if known, chooses the format.

    Raises:
        InputError: it cannot be read.
    """
    suffix = Path(label).suffix.lower()
    path = transcript.rename(transcript.with_suffix(suffix if suffix in SUFFIXES else ".txt"))
    try:
        with open_speech(speech.upload, transcript=path, language=speech.user_language) as source:
            speech.words = source.words or ()
    except InputError as error:
        raise rename_error(error, path, label) from None
    finally:
        path.unlink(missing_ok=True)


def set_language(speech: HeldSpeech, code: str) -> None:
    """Set the language of the words of a speech, and of those of its later transcripts.

    Args:
        speech: the speech.
        code: of the language, see `cospeech.audio.languages`; empty: it is found from the words.

    Raises:
        InputError: the language is not known, or the speech has no words.
    """
    speech.user_language = check_language(code, has_words=bool(speech.words))
    speech.words = with_language(speech.words, speech.user_language)


def _check_length(seconds: float) -> None:
    if seconds > 60 * MINUTES:
        raise InputError(f"the speech has {seconds / 60:.1f} minutes", f"{MINUTES:g} at most; cut it into pieces")


def _write_sound(source: SpeechSource, path: Path) -> list[float]:
    """Decode a speech into a WAV file; returns the largest sample of each piece, see `UploadedSpeech`."""
    size, rest, pieces, count = _RATE // _PEAKS, np.zeros(0, np.float32), list[np.ndarray](), 0
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(_RATE)
        for block in source.blocks():
            count += len(block)
            _check_length(count / _RATE)
            file.writeframes((np.clip(block, -1, 1) * 32767).astype("<i2").tobytes())
            samples = np.concatenate([rest, np.abs(block)])
            whole = len(samples) - len(samples) % size
            pieces.append(samples[:whole].reshape(-1, size).max(axis=1))
            rest = samples[whole:]
    peaks = np.concatenate([*pieces, [rest.max(initial=0.0)]] if len(rest) else pieces)
    wide = -(-len(peaks) // _MOST_PEAKS)
    coarse_peaks = np.pad(peaks, (0, -len(peaks) % wide)).reshape(-1, wide).max(axis=1)
    return [round(float(peak), 4) for peak in np.clip(coarse_peaks, 0, 1)]
