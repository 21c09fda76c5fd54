"""What is said and when, from the files people have: TextGrid, tables, SRT, WebVTT, JSON, plain text.

Every reader makes (text, start, end) in seconds; one function, `settle`, then makes of them what the rest may rely on: sorted,
not overlapping, inside the speech, without silences. Entries of several words are spread over their words by length.
"""

from __future__ import annotations

import csv
import html
import math
import os
import re
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import replace
from io import StringIO
from itertools import chain, islice, pairwise
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import CospeechWarning, InputError
from ..files import read_regular
from ..limits import PLAUSIBLE_SECONDS, TRANSCRIPT_BYTES, WORDS
from .forced_alignment import align, bare, spread, tokenise
from .speaker_labels import drop_labels
from .speech import Word
from .word_entries import Entry, read_time
from .word_json import read_json

if TYPE_CHECKING:
    from .speech import Speech, SpeechSource

__all__ = ["align", "cut_overlaps", "load_speech_words", "load_words", "settle"]

SHORTEST = 0.01  # seconds; ours: what a word without a length gets
SILENCES = frozenset({"sil", "sp", "spn", "pau", "eps", "silence", "#", "_", "-"})  # of HTK, MFA, Festival, MAUS
# Whole entries, or parts of a cue, that say what is heard but not spoken: <sil>, [laughter], (sighs), {SL}, ♪
NOT_SPOKEN = re.compile(r"<[^<>]*>|\[[^\[\]]*\]|\{[^{}]*\}|\([^()]*\)|[♪♫]")
# First bytes of sound, documents and archives that people name by mistake: WAV, AIFF, FLAC, Ogg, MP3, WebM, PDF, Word
_NO_TEXT = (b"RIFF", b"FORM", b"fLaC", b"OggS", b"ID3", b"\xff\xfb", b"\xff\xf3", b"\x1a\x45\xdf\xa3", b"%PDF-", b"PK\x03\x04")
CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")  # words are printed: no escape codes for terminals
VARIANT = re.compile(r"(?<=\w)\(\d+\)$")  # CMU dictionaries number pronunciations: "and(2)"
WORD_TIER = re.compile(r"word|wort|\bmots?\b|palabra|parola|ord\b|token|单词|単語|단어|слов", re.IGNORECASE)
NOT_WORD_TIER = re.compile(r"phon|seg|syl|tone|tobi|break|pitch|point|gest|state", re.IGNORECASE)


def load_words(
    path: str | PathLike[str], *, speech: Speech | SpeechSource | None = None, speech_seconds: float | None = None
) -> tuple[Word, ...]:
    """Read a transcript. The suffix picks the reader; where it says nothing, the content does.

    Args:
        path: .TextGrid (long or short, any encoding Praat writes), .tsv or .csv (start, end, word; Audacity's and
            Whisper's too), .srt, .vtt, .json (a list of words with times, or what Whisper, Gentle, Vosk or PocketSphinx write,
            or a text-to-speech service says, see `cospeech.audio.tts_words`; also as JSON lines), or plain text.
        speech: what the words belong to: plain text is aligned to it, times past its end are cut off.
        speech_seconds: its length, where the speech is not at hand, or does not know it yet; plain text alone is spread evenly.

    Raises:
        InputError: it cannot be read, makes no sense, or lies wholly past the end of the speech.
    """
    data, name = read_regular(path, "a transcript", TRANSCRIPT_BYTES), Path(os.fsdecode(path)).name
    text = _decode(data, name)
    if speech_seconds is None and speech is not None:
        speech_seconds = speech.seconds
    if text.startswith("[Script Info]"):
        raise InputError(f"{name!r} holds subtitles of SubStation Alpha", "make .srt of them: ffmpeg -i talk.ass talk.srt")
    reader = _READERS.get(Path(name).suffix.lower()) or _sniff(text)
    if reader is None:
        tokens = tokenise("\n".join(drop_labels(text.split("\n"))))
        if not tokens:
            raise _wordless(name)
        if speech is not None:
            return settle(((w.text, w.start, w.end) for w in align(tokens, speech)), speech_seconds, name)
        if speech_seconds is None:
            raise InputError(f"{name!r} is plain text, without times", "give the speech too, or a transcript with times")
        return tuple(spread(tokens, 0.0, speech_seconds))
    try:
        return settle(reader(text), speech_seconds, name, warn=speech is not None)
    except InputError as error:
        problem = error.problem if name in error.problem else f"{name!r}: {error.problem}"
        raise InputError(problem, error.hint) from None


def load_speech_words(
    path: str | PathLike[str], *, speech: Speech | SpeechSource | None = None, speech_seconds: float | None = None
) -> tuple[Word, ...]:
    """The words of a speech: as `load_words`, and there is one at least.

    Raises:
        InputError: as of `load_words`, or there is none.
    """
    words = load_words(path, speech=speech, speech_seconds=speech_seconds)
    if not words:
        is_plan = b'"cospeech_plan"' in read_regular(path, "a transcript", TRANSCRIPT_BYTES)
        raise _wordless(Path(os.fsdecode(path)).name, "it is a plan of gestures: --plan plays it" if is_plan else _LEAVE_OUT)
    return words


_LEAVE_OUT = "leave the transcript out if nobody speaks"


def _wordless(name: str, hint: str = _LEAVE_OUT) -> InputError:
    return InputError(f"no words in {name!r}", hint)


def settle(
    entries: Iterable[Entry], seconds: float | None = None, name: str = "transcript", *, warn: bool = False
) -> tuple[Word, ...]:
    """Words from entries in any order: silences dropped, several words spread, sorted, overlaps cut, ends cut at ``seconds``.

    Words that begin later are left out, with a `CospeechWarning` if ``warn``.

    Raises:
        InputError: a time is not a number, an entry ends before it starts, or all lie past the end.
    """
    words: list[Word] = []
    for count, (text, start, end) in enumerate(entries):
        if not (
            math.isfinite(start) and math.isfinite(end) and abs(start) < PLAUSIBLE_SECONDS and abs(end) < PLAUSIBLE_SECONDS
        ):
            raise InputError(f"{text[:40]!r} is at {start:g} … {end:g} s", "times are in seconds")
        if end < start:
            raise InputError(f"{text[:40]!r} ends before it starts: {start:g} … {end:g} s", "are its columns swapped?")
        tokens = _tokens(text)
        words += spread(tokens, start, end) if len(tokens) != 1 else [Word(bare(tokens[0]), start, end)]
        if len(words) > WORDS or count > 2 * WORDS:  # between two words there may be a silence
            raise InputError(f"a transcript of more than {WORDS:,} words", "cut it into pieces")
    words = cut_overlaps(sorted((w for w in words if w.end > 0), key=lambda w: (w.start, w.end)))
    if seconds is None:
        return tuple(words)
    inside = tuple(Word(w.text, w.start, min(w.end, seconds)) for w in words if w.start < seconds)
    if words and not inside:
        raise InputError(
            f"{name!r} begins at {words[0].start:g} s, but the speech is {seconds:.2f} s long",
            "does it belong to another recording, or are its times in milliseconds?",
        )
    if warn and len(inside) < len(words):
        late = words[len(inside)]
        problem = (
            f"{name!r}: {len(words) - len(inside)} of {len(words)} words begin after the end of the speech ({seconds:.2f} s)"
        )
        warnings.warn(
            f"{problem} and are left out, the first is {late.text[:40]!r} at {late.start:g} s", CospeechWarning, stacklevel=3
        )
    return inside


def _tokens(text: str) -> list[str]:
    if not text:
        return []
    spoken = NOT_SPOKEN.sub(" ", VARIANT.sub("", CONTROL.sub(" ", text).strip()))
    return [] if spoken.strip().lower() in SILENCES else tokenise(spoken)


def cut_overlaps(words: list[Word]) -> list[Word]:
    """Words in order of their starts; where two overlap, the earlier ends where the later begins. Each keeps `SHORTEST`."""
    starts, free = [], 0.0
    for word in words:
        starts.append(max(word.start, free))
        free = starts[-1] + SHORTEST
    ends = [max(word.end, start + SHORTEST) for word, start in zip(words, starts, strict=True)]
    ends[:-1] = [min(end, after) for end, after in zip(ends[:-1], starts[1:], strict=True)]
    return [replace(word, start=start, end=end) for word, start, end in zip(words, starts, ends, strict=True)]


def _decode(data: bytes, name: str) -> str:
    """The text of a file in UTF-8 or UTF-16, with or without a byte order mark."""
    if data.startswith(_NO_TEXT) or data[4:8] == b"ftyp":
        raise _no_transcript(name)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif b"\0" in data[:200:2] + data[1:200:2] and len(data) % 2 == 0:
        encoding = "utf-16-le" if data[1:200:2].count(0) > data[:200:2].count(0) else "utf-16-be"
    else:
        encoding = "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-16" and b"\0" in data:  # no mark of its encoding, and no text in UTF-8
            raise _no_transcript(name) from None
        byte = f"byte 0x{data[error.start]:02x} at {error.start}"
        raise InputError(f"{name!r} is not {encoding.removesuffix('-sig').upper()} text: {byte}", "save it as UTF-8") from None
    if "\0" in text:
        raise InputError(f"{name!r} holds NUL characters", "is it a transcript? Save it as UTF-8 text")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _no_transcript(name: str) -> InputError:
    return InputError(f"{name!r} is no transcript: it is not text", "TextGrid, .tsv, .srt, .vtt, .json, or plain text in UTF-8")


# ---- TextGrid: https://www.fon.hum.uva.nl/praat/manual/TextGrid_file_formats.html ----

# "++", "*+": what was taken is not given back, so that each character is looked at once
PRAAT_TOKEN = re.compile(r'"([^"]*+(?:""[^"]*+)*+)"|(<[a-z]++>)|![^\n]*+|[^\s"]++')
PRAAT_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?$")


def read_textgrid(text: str) -> Iterator[Entry]:
    """Long and short forms alike: only free-standing numbers, quoted strings and <flags> count, as in Praat itself."""
    values: Iterator[str | float] = _praat_values(text)

    def take(kind: type) -> str | float:
        value = next(values, None)
        if value is None or not isinstance(value, kind):
            found = "its end" if value is None else repr(value)[:40]
            raise InputError(f"a TextGrid with {found} where a {'text' if kind is str else 'number'} belongs", "is it cut off?")
        return value

    if (take(str), take(str)) != ("ooTextFile", "TextGrid"):
        raise InputError("not a TextGrid: no 'ooTextFile', 'TextGrid' at its head", "save it as text from Praat")
    take(float), take(float)
    if take(str) != "<exists>":
        raise InputError("a TextGrid without tiers", "add a word tier")
    tiers: list[tuple[str, list[Entry]]] = []
    read = 0
    for _ in range(_count(take(float))):
        kind, name = str(take(str)), str(take(str))
        take(float), take(float)
        entries: list[Entry] = []
        for _ in range(_count(take(float))):
            read += 1
            if read > 4 * WORDS:  # a word and the sounds that it is made of
                raise InputError(f"a TextGrid of more than {4 * WORDS:,} entries", "cut it into pieces")
            start = float(take(float))
            end = float(take(float)) if kind == "IntervalTier" else start
            entries.append((str(take(str)), start, end))
        if kind == "IntervalTier":
            tiers.append((name, entries))
    yield from _word_tier(tiers)


def _praat_values(text: str) -> Iterator[str | float]:
    for match in PRAAT_TOKEN.finditer(text):
        if match[1] is not None:
            yield match[1].replace('""', '"')
        elif match[2]:
            yield match[2]
        elif PRAAT_NUMBER.match(match[0]):
            yield float(match[0])


def _count(number: str | float) -> int:
    if not (isinstance(number, float) and 0 <= number < 1e8 and number == int(number)):
        raise InputError(f"a TextGrid that announces {number} entries", "is it damaged?")
    return int(number)


def _word_tier(tiers: list[tuple[str, list[Entry]]]) -> list[Entry]:
    """The tier called words (Wörter, mots, …); else the one with most labels that is not named after smaller things."""
    if not tiers:
        raise InputError("a TextGrid without an interval tier", "words have a start and an end")
    named = [tier for tier in tiers if WORD_TIER.search(tier[0])]
    others = [tier for tier in tiers if not NOT_WORD_TIER.search(tier[0])]
    return max(named or others or tiers, key=lambda tier: sum(bool(_tokens(text)) for text, _, _ in tier[1]))[1]


# ---- tables and subtitles ----

TIME = r"(?:(\d{1,4}):)?(\d{1,2}):(\d{1,2})[,.](\d{1,3})"
NO_CHARACTER = re.compile(r"&#\d{8,};?")  # beyond all of Unicode
NEXT_NUMBER = re.compile(r"\n[ \t]*\d{1,9}[ \t]*\n\Z")  # that of the next cue, right above its times
CUE = re.compile(rf"^[ \t]*{TIME}[ \t]*-->[ \t]*{TIME}.*$", re.MULTILINE)


def read_table(text: str) -> Iterator[Entry]:
    """start, end, word, between tabs, semicolons, commas or blanks; a first line of names is skipped. Whisper's is in ms."""
    scale, first = 1.0, True
    for number, line in _lines(text):
        cells, head, first = _cells(line), first, False
        if head and not any(_is_number(cell) for cell in cells[:2]):
            if [c.lower() for c in cells] == ["start", "end", "text"]:
                others = islice(_lines(text), 1, None)
                scale = 0.001 if all(cell.isdigit() for _, other in others for cell in _cells(other)[:2]) else 1.0
            continue
        if len(cells) < 2 or not (_is_number(cells[0]) and _is_number(cells[1])):
            raise InputError(f"line {number} is {line[:60]!r}", "start, end and word belong there, separated by tabs or commas")
        yield cells[2] if len(cells) > 2 else "", read_time(cells[0]) * scale, read_time(cells[1]) * scale


# start and end in front of a line without tabs: separated by blanks; or by a comma or a semicolon, too
_SPACED = re.compile(r"\s*+[-+]?\d[\d.]*+ ++[-+]?\d[\d.]*+(?: |$)")
_ROW = re.compile(r"\s*+[-+]?\d[\d.]*+(?: ++|[,;] *+)[-+]?\d[\d.]*+(?:[ ,;]|$)")


def _cells(line: str) -> list[str]:
    """Up to three cells of a line of a table; in quotes, a comma or a semicolon is part of a cell."""
    mark = "\t" if "\t" in line else None if _SPACED.match(line) else ";" if ";" in line else ","
    try:
        cells = line.split(mark, maxsplit=2) if mark in (None, "\t") else next(csv.reader([line], delimiter=mark))
    except csv.Error as error:
        raise InputError(f"{line[:60]!r}: {error}", "start, end and word belong there") from None
    return [cell.strip() for cell in cells]


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Numbered lines that are not blank, one at a time."""
    return ((number, line) for number, line in enumerate(map(str.rstrip, StringIO(text)), 1) if line)


def _is_number(cell: str) -> bool:
    try:
        read_time(cell)
    except InputError:
        return False
    return True


def read_srt(text: str) -> Iterator[Entry]:
    """SubRip and WebVTT: what stands between one line of times and the next blank line."""
    if CUE.search(text) is None:
        raise InputError("no subtitle has a time", "'00:00:01,000 --> 00:00:02,000' belongs above each")
    cues = list[tuple[str, float, float]]()
    for cue, following in pairwise(chain(CUE.finditer(text), [None])):
        assert cue is not None
        below = text[cue.end() :] if following is None else NEXT_NUMBER.sub("\n", text[cue.end() : following.start()])
        spoken = re.split(r"\n[ \t]*(?:\n|$)", below.removeprefix("\n"), maxsplit=1)[0]
        parts = cue.groups()
        said = html.unescape(NO_CHARACTER.sub("\ufffd", re.sub(r"<[^<>\n]*>", "", spoken)))
        cues.append((said, _clock(parts[:4]), _clock(parts[4:])))
    lines = iter(drop_labels([line for said, _, _ in cues for line in said.split("\n")]))
    for said, start, end in cues:
        yield " ".join(islice(lines, said.count("\n") + 1)), start, end


def _clock(parts: tuple[str | None, ...]) -> float:
    hours, minutes, seconds, fraction = parts
    return int(hours or 0) * 3600 + int(minutes or 0) * 60 + int(seconds or 0) + float(f"0.{fraction}")


_READERS = {
    ".textgrid": read_textgrid, ".tsv": read_table, ".csv": read_table, ".srt": read_srt, ".vtt": read_srt, ".json": read_json
}  # fmt: skip


def _sniff(text: str):  # type: ignore[no-untyped-def]  # one of the readers above
    """The reader for a text whose suffix says nothing; None for plain text."""
    head = text.lstrip()[:400]
    if "ooTextFile" in head:
        return read_textgrid
    if head[:1] in "[{" and head[1:].lstrip()[:1] in ('"', "{", "[", "]", "}") and head:
        return read_json
    if CUE.search(text):
        return read_srt
    lines = [line for line in text.split("\n") if line.strip()][:20]
    if lines and all(re.match(r"\s*[-+\d.,eE]+\t\s*[-+\d.,eE]+(\t|$)", line) for line in lines[1:] or lines):
        return read_table
    rows = [row for row in map(_ROW.match, lines[1:] or lines) if row]
    return read_table if len(rows) == max(len(lines) - 1, 1) and any("." in row[0] for row in rows) else None
