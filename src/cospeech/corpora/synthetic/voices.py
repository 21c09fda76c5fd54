"""The speech of a synthetic corpus: the user's recordings, and sentences spoken by espeak-ng or flite in many voices."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from ...audio.forced_alignment import align, tokenise
from ...audio.speech import Speech, Word
from ...errors import InputError, InternalError
from ...files import scratch, workplace
from .. import folder
from ..clip import Clip
from .texts import SENTENCES

__all__ = ["ENGINES", "Voice", "find_voices", "pieces_of", "reader_of", "recordings", "repeat", "say", "vary_voice"]

_RATE = 16_000  # Hz
_PAUSE = 0.6  # seconds between two recordings or sentences; ours
_SHORTEST = 1.0  # seconds; ours: a shorter piece is no speech to gesture to
_PATIENCE = 60.0  # seconds for some sentences; an engine takes well under one
_FLITE = ("slt", "rms", "awb", "kal16")
_ACCENTS = ("en-us", "en-gb", "en-gb-x-rp", "en-gb-scotland", "en-029")
_TIMBRES = ("m1", "f2", "m3", "f4", "m7", "f1", "m4", "f5", "f3", "m2")
_SPEEDS, _PITCHES = (0.88, 1.14), (-12, 13)  # [ours] of a speech against its voice: factor, and steps of espeak-ng
ENGINES = ("espeak-ng", "flite")
"""Programs that are looked for."""


@dataclass(frozen=True)
class Voice:
    """How an engine is to sound.

    Args:
        engine: a name of `ENGINES`.
        name: of its voice.
        speed: 1 is the voice's own, flite and espeak-ng alike.
        pitch: 0 … 99, 50 is the voice's own; espeak-ng only.
    """

    engine: str
    name: str
    speed: float
    pitch: int = 50

    def command(self, text: str, path: Path) -> list[str]:
        """The command line that speaks ``text`` into ``path``, a WAV file."""
        if self.engine == "flite":
            stretch = f"duration_stretch={1 / self.speed:.3f}"
            return ["flite", "-voice", self.name, "--setf", stretch, "-t", text, "-o", str(path)]
        return ["espeak-ng", "-v", self.name, "-s", str(round(165 * self.speed)), "-p", str(self.pitch), "-w", str(path), text]


def vary_voice(voice: Voice, seed: int) -> Voice:
    """The voice somewhat faster or slower, higher or lower, by as much as it can be changed and still sounds natural."""
    rng = np.random.default_rng([seed, 15])
    speed, pitch = rng.uniform(*_SPEEDS), int(rng.integers(*_PITCHES))
    return replace(voice, speed=voice.speed * float(speed), pitch=min(max(voice.pitch + pitch, 0), 99))


def find_voices(seed: int) -> list[Voice]:
    """Some twenty voices of the engines that are installed, in an order of the seed's; none where there is no engine."""
    rng = np.random.default_rng([seed, 9])
    voices = []
    if shutil.which("flite"):
        voices += [Voice("flite", name, float(rng.uniform(0.9, 1.15))) for name in _FLITE]
    if shutil.which("espeak-ng"):
        for k, timbre in enumerate(_TIMBRES * 2):
            name = f"{_ACCENTS[(k + k // len(_TIMBRES)) % len(_ACCENTS)]}+{timbre}"
            voices.append(Voice("espeak-ng", name, float(rng.uniform(0.85, 1.2)), int(rng.integers(35, 65))))
    return [voices[k] for k in rng.permutation(len(voices))]


def say(voice: Voice, seconds: float, seed: int, sentences: Sequence[str] = SENTENCES) -> Speech:
    """Some of the ``sentences``, some ``seconds`` long, with the times of their words.

    Raises:
        InternalError: the engine failed.
    """
    rng = np.random.default_rng([seed, 10])
    parts: list[Speech] = []
    length = 0.0
    order = [int(k) for k in rng.permutation(len(sentences))]
    with workplace(scratch()) as place:
        while length < seconds:
            text = sentences[order[len(parts) % len(order)]]
            speech = _speak(voice, text, place / f"{len(parts)}.wav")
            parts.append(replace(speech, words=align(tokenise(text), speech)))
            length += float(speech.duration) + _PAUSE
    return _join(parts, f"{voice.engine} {voice.name}")


def _speak(voice: Voice, text: str, path: Path) -> Speech:
    command = voice.command(text, path)
    try:
        process = subprocess.run(command, capture_output=True, timeout=_PATIENCE, check=False, stdin=subprocess.DEVNULL)
        if process.returncode == 0 and path.is_file():
            return Speech.load(path)
        words = process.stderr.decode("utf-8", "replace").strip()[:120] or f"exit code {process.returncode}"
    except (OSError, subprocess.TimeoutExpired, InputError) as error:
        words = str(error)[:120]
    raise InternalError(f"{voice.engine} did not speak with the voice {voice.name!r}: {words}", "--no-tts leaves it out")


def recordings(place: str | PathLike[str]) -> Iterator[Speech]:
    """All sound files of a folder that can be read, with their words where a transcript lies beside them.

    Names are paths below the folder.

    Transcripts are those of `cospeech.corpora.folder`; of LJ Speech also its ``metadata.csv``.

    Raises:
        InputError: no such folder, no sound in it, or none that can be read.
    """
    texts: dict[Path, dict[str, str]] = {}
    last, count = "", 0
    for item in folder.read(place):
        if not isinstance(item, Clip) or item.speech is None:
            last = str(getattr(item, "reason", "no sound"))
            continue
        speech, path = item.speech, Path(place, item.name)
        if speech.words is None:
            if path.parent not in texts:
                texts[path.parent] = _metadata(path.parent / "metadata.csv")
            text = texts[path.parent].get(path.name)
            if text is not None:
                speech = replace(speech, words=align(tokenise(text), speech))
        count += 1
        yield replace(speech, name=Path(item.name).with_name(speech.name).as_posix())
    if not count:
        raise InputError(f"no sound file in {str(place)!r} can be read", last)


def reader_of(speech: Speech) -> str:
    """Who reads a recording: those of one folder are taken to have one reader."""
    return Path(speech.name).parent.as_posix()


def _metadata(path: Path) -> dict[str, str]:
    """File name → text of LJ Speech's table: ``id|as written|as spoken``; empty where there is none."""
    if not path.is_file():
        return {}
    try:
        rows = [line.split("|") for line in path.read_text("utf-8").splitlines()]
    except (OSError, ValueError):
        return {}
    return {row[0].strip(): row[-1] for row in rows if len(row) > 1}


def pieces_of(speeches: Iterable[Speech], seconds: float) -> Iterator[Speech]:
    """The speeches as pieces of at most some ``seconds``: long ones cut, short ones of a reader joined, if both have
    words or none has."""
    waiting: list[Speech] = []
    for speech in speeches:
        for part in _cut(speech, seconds):
            length = sum(float(s.duration) + _PAUSE for s in waiting)
            alike = not waiting or _kind(waiting[0]) == _kind(part)
            if waiting and (not alike or length + float(part.duration) > seconds):
                yield _join(waiting, waiting[0].name)
                waiting = []
            waiting.append(part)
    if waiting:
        yield _join(waiting, waiting[0].name)


def repeat(speech: Speech, seconds: float) -> Speech:
    """The same speech as often as it takes to last so many seconds, with pauses."""
    count = max(1, int(np.ceil(seconds / float(speech.duration))))
    return speech if count == 1 else _join([speech] * count, speech.name)


def _kind(speech: Speech) -> tuple[bool, str]:
    return speech.words is None, reader_of(speech)


def _cut(speech: Speech, seconds: float) -> Iterator[Speech]:
    total = float(speech.duration)
    if total <= seconds:
        yield speech
        return
    count = int(np.ceil(total / seconds))
    for k in range(count):
        first, last = (round(total * n / count * speech.rate) for n in (k, k + 1))
        samples = speech.samples[first:last]
        if len(samples) < _SHORTEST * speech.rate:
            continue
        start, end = first / speech.rate, last / speech.rate
        words = speech.words
        if words is not None:
            inside = (w for w in words if w.start >= start and w.end <= end)
            words = tuple(replace(w, start=w.start - start, end=w.end - start) for w in inside)
        yield Speech(samples, speech.rate, words, name=speech.name)


def _join(parts: list[Speech], name: str) -> Speech:
    """One after the other, a pause between them, at 16 kHz, with even loudness."""
    samples: list[np.ndarray] = []
    words: list[Word] = []
    at = 0
    for part in parts:
        own = part.samples
        samples += [own, np.zeros(round(_PAUSE * _RATE), np.float32)]
        words += [replace(w, start=w.start + at / _RATE, end=w.end + at / _RATE) for w in part.words or ()]
        at += len(own) + len(samples[-1])
    whole = np.concatenate(samples[:-1])
    has_words = parts[0].words is not None
    return Speech(whole, _RATE, tuple(words) if has_words else None, name=name)
