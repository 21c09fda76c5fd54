"""SubRip (.srt), WebVTT (.vtt) and SubViewer as YouTube writes it (.sbv): a line of times, and below it what is said then.

WebVTT: https://www.w3.org/TR/webvtt1/. Recognised captions of YouTube time each word inside a cue (``<00:00:00.400>``), and
show each line again in the next cue, so that lines roll upwards; a line that was shown is not said again.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Sequence
from itertools import chain, islice, pairwise

from ...errors import InputError, say_count
from ...limits import WORDS
from ..speaker_labels import drop_labels, split_labels
from ..word_entries import Entry, Note, read_clock
from .cues import INLINE_TIME, Cue, plain_text, unroll

__all__ = ["fits", "fits_sbv", "name_speakers", "read", "read_sbv", "say_cues"]

# Possessive ("++"): what was taken is not given back, so that each character is looked at once
_TIMES = re.compile(r"^[ \t]*+([\d:;.,]++)[ \t]*+(?:--?>|[→⟶])[ \t]*+([\d:;.,]++)(?![^ \t\n]).*$", re.MULTILINE)
_SBV_TIMES = re.compile(r"^[ \t]*+([\d:]++\.\d++)[ \t]*+,[ \t]*+([\d:]++\.\d++)[ \t]*+$", re.MULTILINE)
_NEXT_NUMBER = re.compile(r"\n[ \t]*\d{1,9}[ \t]*\n\Z")  # that of the next cue, right above its times
_VOICE = re.compile(r"<v(?:\.[^\s<>]*)?[ \t]+([^<>\n]{1,80})>")  # of WebVTT: who says the cue
_HINT = "'00:00:01,000 --> 00:00:02,000' belongs above each"
_FRAMES = re.compile(r"\d+:\d+:\d+[:;]\d+")


def fits(text: str) -> bool:
    """Whether a line of times as of SubRip or WebVTT is in a text."""
    return any(read_clock(match[1]) is not None and read_clock(match[2]) is not None for match in _TIMES.finditer(text))


def fits_sbv(text: str) -> bool:
    """Whether a line of times as of SubViewer is in a text."""
    return _SBV_TIMES.search(text) is not None


def read(text: str, note: Note) -> Iterator[Entry]:
    """The texts of the cues of SubRip or WebVTT; words with times of their own inside a cue are entries of their own.

    Raises:
        InputError: no cue has times.
    """
    return say_cues(_time_words(unroll(_read_cues(text, _TIMES, note))))


def read_sbv(text: str, note: Note) -> Iterator[Entry]:
    """The texts of the cues of SubViewer.

    Raises:
        InputError: no cue has times.
    """
    return say_cues(unroll(_read_cues(text, _SBV_TIMES, note)))


def say_cues(cues: Sequence[Cue]) -> Iterator[Entry]:
    """Entries of cues: their lines without tags, references to characters, and names of speakers."""
    lines = iter(drop_labels([plain_text(line) for cue in cues for line in cue.lines]))
    for cue in cues:
        yield " ".join(islice(lines, len(cue.lines))), cue.start, cue.end


def name_speakers(text: str, note: Note) -> Iterator[tuple[str, float, float]]:
    """Who speaks in SubRip or WebVTT, and when: by the voice of a cue or the label before its lines; else, the speaker before.

    Raises:
        InputError: no cue has times.
    """
    cues = _read_cues(text, _TIMES, note)
    labels = iter(split_labels([plain_text(line) for cue in cues for line in cue.lines]))
    name = ""
    for cue in cues:
        voice = _VOICE.search("\n".join(cue.lines))
        names = [label for label, _ in islice(labels, len(cue.lines)) if label]
        name = html.unescape(voice[1]).strip() if voice else names[0] if names else name
        if name:
            yield name, cue.start, cue.end


def _read_cues(text: str, times: re.Pattern[str], note: Note) -> list[Cue]:
    """Cues between their lines of times; a note tells of those whose times cannot be read."""
    cues, faults = list[Cue](), list[str]()
    for match, following in pairwise(chain(times.finditer(text), [None])):
        assert match is not None
        start, end = read_clock(match[1]), read_clock(match[2])
        if start is None or end is None:
            faults.append(match[0].strip()[:60])
            continue
        below = text[match.end() :] if following is None else _NEXT_NUMBER.sub("\n", text[match.end() : following.start()])
        body = re.split(r"\n[ \t]*(?:\n|$)", below.removeprefix("\n"), maxsplit=1)[0]
        cues.append(Cue(body.split("\n"), start, end))
        if len(cues) > WORDS:
            raise InputError(f"a transcript of more than {WORDS:,} words", "cut it into pieces")
    if not cues and faults and _FRAMES.search(faults[0]):
        raise InputError(f"{faults[0]!r} counts frames", "write times as 00:00:01,500, with fractions of a second")
    if not cues:
        raise InputError(f"no subtitle has a time{f', the first line is {faults[0]!r}' if faults else ''}", _HINT)
    if faults:
        lines = say_count(len(faults), "subtitle")
        note(f"{lines} of {len(cues) + len(faults)} left out, the times cannot be read: {faults[0]!r}")
    return cues


def _time_words(cues: Sequence[Cue]) -> list[Cue]:
    """Split cues that have times between their words: into a cue for each part."""
    pieces: list[Cue] = []
    for cue in cues:
        parts = INLINE_TIME.split("\n".join(cue.lines))
        times = [cue.start, *(read_clock(time) or 0.0 for time in parts[1::2]), cue.end]
        if len(parts) == 1 or any(after < before for before, after in pairwise(times)):
            pieces.append(cue)
        else:
            pieces += [Cue(part.split("\n"), *span) for part, span in zip(parts[::2], pairwise(times), strict=True)]
    return pieces
