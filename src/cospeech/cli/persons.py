"""The persons of a conversation: one for each file or channel, or as a file of speakers names them."""

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
    """A person of a conversation.

    Args:
        name: for the names of files.
        label: name of the channel, or the name in ``--speakers``; empty if the person has a sound file alone.
        voice: the voice of this person, and when it speaks.
    """

    name: str
    label: str
    voice: HeardSpeaker


def hear_persons(speech: Sequence[Path], speakers: Path | None) -> list[Person]:
    """The persons of a conversation, in order.

    Args:
        speech: a file for each person; or one file with a channel for each; or one recording of all.
        speakers: file that tells who speaks when in one recording of all.

    Raises:
        InputError: there are fewer than two persons, or a file cannot be read.
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
    voices = hear_conversation(*tracks)
    return [Person(*each) for each in zip(names, labels, voices, strict=True)]


def _label_channels(path: Path) -> list[str]:
    """Names of the channels of a file: left and right, or numbers.

    Raises:
        InputError: the file has only one channel.
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
    """A name for each file, without its suffix; if two are equal, all begin with their folders.

    Raises:
        InputError: two names are equal even then.
    """
    names = [check_name(path).stem for path in speech]
    if len(set(names)) < len(names):
        names = [f"{path.absolute().parent.name}.{path.stem}" for path in speech]
    duplicate = next((path for path, name in zip(speech, names, strict=True) if names.count(name) > 1), None)
    if duplicate is not None:
        raise InputError(f"two sound files are called {duplicate.name!r}", "files of different names")
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
    voices = hear_recording(VoiceTrack(speech[0]), stretches)
    files = [f"{check_name(speech[0]).stem}.{_name_file(label)}" for label in voices]
    keys = [unicodedata.normalize("NFC", name).lower() for name in files]  # as macOS and Windows compare names
    count = Counter(keys)
    duplicate = next((name for name, key in zip(files, keys, strict=True) if count[key] > 1), None)
    if duplicate is not None:
        raise InputError(
            f"{speakers.name!r} names two speakers whose files would be called {duplicate!r}", "rename one of them"
        )
    return [Person(name, *each) for name, each in zip(files, voices.items(), strict=True)]


def _name_file(label: str) -> str:
    """The name of a speaker for names of files.

    A label may hold any character. ``_`` replaces characters that some system forbids in names, control characters, and
    characters that turn the direction of letters.
    """
    name = "".join(letter if letter.isprintable() or letter in _JOINERS else "_" for letter in _FORBIDDEN.sub("_", label))
    return name[:_LETTERS]


def choose_persons(persons: Sequence[Person], names: Sequence[str]) -> list[int]:
    """The persons to generate, as indices into ``persons``; all if ``names`` is empty.

    Raises:
        InputError: no person has one of the names.
    """
    places = []
    for name in names:
        matches = [k for k, person in enumerate(persons) if name and name in (person.name, person.label)]
        if not matches:
            labels = [person.label or person.name for person in persons]
            raise InputError(f"nobody is called {name!r}", nearest(name, labels))
        places += matches
    return sorted(set(places)) or list(range(len(persons)))


def describe_persons(persons: Sequence[Person]) -> str:
    """How long each one speaks, for people to read."""
    lengths = [(person, sum(phrase.end - phrase.start for phrase in person.voice.phrases)) for person in persons]
    return f"{say_count(len(persons), 'person')}: " + ", ".join(f"{person.name} {seconds:.0f} s" for person, seconds in lengths)
