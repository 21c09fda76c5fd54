"""Who talks in a conversation: from files, channels, or a file that says who speaks when."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, nearest, say_count
from .several import check_name

if TYPE_CHECKING:
    from ..audio.conversation import HeardSpeaker

__all__ = ["Person", "choose_persons", "describe_persons", "hear_persons"]

_SIDES = ("left", "right")
_LETTERS = 40  # of a speaker's name in names of files [ours: systems take 255 bytes, and a letter has up to four]
_FORBIDDEN = re.compile(r'[\s<>:"/\\|?*\x00-\x1f]+')  # in names of files, of any system
_JOINERS = "\u200c\u200d"  # of letters, in Persian and Indic names: the only signs that cannot be seen and stay


@dataclass(frozen=True)
class Person:
    """Somebody who talks.

    Args:
        name: for files.
        label: what the recording calls this person: a channel, or a name in ``--speakers``; empty where it has a file.
        heard: the voice.
    """

    name: str
    label: str
    heard: HeardSpeaker


def hear_persons(speech: Sequence[Path], speakers: Path | None) -> list[Person]:
    """All who talk, in order.

    Args:
        speech: a file for each person; or one file with a channel for each; or one file of all.
        speakers: says who speaks when in one file of all.

    Raises:
        InputError: there are not two persons, or a file cannot be read.
    """
    if speakers is not None:
        return _hear_all(speech, speakers)
    from ..audio.conversation import VoiceTrack, hear_conversation

    if len(speech) == 1:
        labels = _label_channels(speech[0])
        tracks = [VoiceTrack(speech[0], channel) for channel in range(len(labels))]
        names = [f"{check_name(speech[0]).stem}.{label}" for label in labels]
    else:
        labels, tracks, names = [""] * len(speech), [VoiceTrack(path) for path in speech], _name_files(speech)
    heard = hear_conversation(*tracks)
    return [Person(*each) for each in zip(names, labels, heard, strict=True)]


def _label_channels(path: Path) -> list[str]:
    """What the channels of a file are called.

    Raises:
        InputError: there is only one.
    """
    from ..audio.speech import SpeechSource

    with SpeechSource(path) as source:
        count = source.channels
    if count == 1:
        hint = (
            "a file for each person, a stereo file with one person on each channel, or --speakers, which says who speaks when"
        )
        raise InputError(f"{str(path)!r} has one channel", hint)
    return list(_SIDES) if count == 2 else [str(k + 1) for k in range(count)]


def _name_files(speech: Sequence[Path]) -> list[str]:
    """Names of files; with that of the folder, where they are called alike.

    Raises:
        InputError: two are called alike then, too.
    """
    names = [check_name(path).stem for path in speech]
    if len(set(names)) < len(names):
        names = [f"{path.absolute().parent.name}.{path.stem}" for path in speech]
    twice = next((path for path, name in zip(speech, names, strict=True) if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two sound files are called {twice.name!r}", "files of different names")
    return names


def _hear_all(speech: Sequence[Path], speakers: Path) -> list[Person]:
    from ..audio.conversation import VoiceTrack, hear_recording
    from ..audio.diarisation import read_speakers
    from ..audio.speech import open_speech

    if len(speech) > 1:
        raise InputError(f"--speakers for {len(speech)} sound files", "it says who speaks when in one recording of all")
    with open_speech(speech[0]) as source:
        seconds = source.expected_seconds
    stretches = read_speakers(speakers, seconds)
    if len(stretches) < 2:
        raise InputError(f"{speakers.name!r} names only {next(iter(stretches))!r}", "a conversation has two persons or more")
    heard = hear_recording(VoiceTrack(speech[0]), stretches)
    files = [f"{check_name(speech[0]).stem}.{_name_file(label)}" for label in heard]
    alike = [unicodedata.normalize("NFC", name).lower() for name in files]  # as macOS and Windows compare names
    count = Counter(alike)
    twice = next((name for name, key in zip(files, alike, strict=True) if count[key] > 1), None)
    if twice is not None:
        raise InputError(f"{speakers.name!r} names two speakers whose files would be called {twice!r}", "rename one of them")
    return [Person(name, *each) for name, each in zip(files, heard.items(), strict=True)]


def _name_file(label: str) -> str:
    """What a speaker is called in names of files.

    A file may call a speaker anything. So what no system takes is left out, and what changes how a terminal or a folder shows a
    name: control characters, and signs that turn the direction of letters.
    """
    seen = "".join(letter if letter.isprintable() or letter in _JOINERS else "_" for letter in _FORBIDDEN.sub("_", label))
    return seen[:_LETTERS]


def choose_persons(persons: Sequence[Person], wanted: Sequence[str]) -> list[int]:
    """Whom to generate: places in ``persons``; all where nobody is named.

    Raises:
        InputError: nobody is called so.
    """
    chosen = []
    for name in wanted:
        found = [k for k, person in enumerate(persons) if name and name in (person.name, person.label)]
        if not found:
            known = [person.label or person.name for person in persons]
            raise InputError(f"nobody is called {name!r}", nearest(name, known))
        chosen += found
    return sorted(set(chosen)) or list(range(len(persons)))


def describe_persons(persons: Sequence[Person]) -> str:
    """How long each one speaks, for people to read."""
    spoken = [(person, sum(phrase.end - phrase.start for phrase in person.heard.phrases)) for person in persons]
    return f"{say_count(len(persons), 'person')}: " + ", ".join(f"{person.name} {seconds:.0f} s" for person, seconds in spoken)
