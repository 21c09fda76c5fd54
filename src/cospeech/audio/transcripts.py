"""Read what is said and when from subtitles, TextGrid, ELAN, tables, JSON, lyrics or plain text.

Every reader (`transcript_formats`) gives (text, start, end) in seconds. Then `settle` turns them into words that the rest may
rely on: sorted, not overlapping, inside the speech, without silences. Entries of several words are laid on the sound where it
is at hand; else their time is divided among their words by length.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import CospeechWarning, InputError
from ..files import read_regular
from ..limits import PLAUSIBLE_SECONDS, TRANSCRIPT_BYTES, WORDS
from .forced_alignment import SoundAligner, align, bare, note_haste, spread
from .speaker_labels import drop_labels
from .speech import Word
from .spoken_text import list_tokens
from .transcript_file import TranscriptFile
from .transcript_formats import TranscriptFormat, find_format
from .transcript_formats.text_files import check_prose, decode, refuse_others
from .transcript_formats.tiers import find_tier
from .word import LAUGHTER
from .word_entries import Entry, Note

if TYPE_CHECKING:
    from .speech import Speech, SpeechSource

__all__ = ["TranscriptFile", "align", "cut_overlaps", "load_speech_words", "load_words", "settle"]

SHORTEST = 0.01  # seconds; ours: what a word without a length gets
_LAUGH = 0.9  # seconds of a laugh between words, at most [ours: about as long as a laugh of three or four bursts]
_CUE = 1.0  # seconds from which on an entry of several words is laid on the sound [ours: below, a spread is off by little]
_OVERLAP = 0.1  # seconds by which subtitles may overlap without a warning [ours: some programs round so]
_HOUR = 3600
_STILL_SHOWN = 1 / 2  # of the subtitles that begin while the one before is shown, from which on lines roll [ours]
_STILL_SHOWN_LEAST = 4  # such subtitles, below which two people may speak at the same time [ours]
_LEAVE_OUT = "leave the transcript out if nobody speaks"

_TimedTokens = tuple[list[str], float, float]
"""Tokens of an entry, start, end."""
_Lay = Callable[[Sequence[str], float, float], Iterable[Word]]
"""Tokens, start, end → words in between."""


def load_words(
    path: str | PathLike[str], *, speech: Speech | SpeechSource | None = None, speech_seconds: float | None = None
) -> tuple[Word, ...]:
    """Read a transcript. The suffix picks the reader; where it says nothing, the content does.

    Args:
        path: .TextGrid (long or short, any encoding Praat writes), .eaf, .tsv or .csv (start, end, word; Audacity's and
            Whisper's too), .srt, .vtt, .sbv, .ttml, .lrc, .json (a list of words with times, or what recognisers and aligners
            write, or a text-to-speech service says, see `word_json`; also as JSON lines), or plain text. A `TranscriptFile`
            also says how far its times are off, and which tier of a .TextGrid or .eaf counts.
        speech: what the words belong to: plain text and subtitles are laid on it, times past its end are cut off.
        speech_seconds: its length, where the speech is not at hand, or does not know it yet; plain text alone is spread evenly.

    Raises:
        InputError: it cannot be read, makes no sense, or lies wholly outside of the speech; or it lacks the times or the tier
            that a `TranscriptFile` is about.
    """
    offset, tier = (path.offset, path.tier) if isinstance(path, TranscriptFile) else (0.0, "")
    data, name = read_regular(path, "a transcript", TRANSCRIPT_BYTES), Path(os.fsdecode(path)).name
    text = decode(data, name)
    if speech_seconds is None and speech is not None:
        speech_seconds = speech.seconds
    refuse_others(text, name)
    reader = find_format(Path(name).suffix.lower(), text)
    if reader is None:
        check_prose(text, name)
        if tier:
            raise _tierless(name)
        if offset:
            raise InputError(f"an offset for {name!r}, which has no times", "leave it out: the words are laid on the sound")
        return _read_prose(text, name, speech, speech_seconds)

    def note(message: str) -> None:
        warnings.warn(f"{name!r}: {message}", CospeechWarning, stacklevel=2)

    try:
        entries = _read(reader, text, tier, name, note)
        if offset:  # else numbers stay shared between entries, which saves memory
            entries = ((words, start + offset, end + offset) for words, start, end in entries)
        return settle(entries, speech_seconds, name, speech=speech)
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


def _wordless(name: str, hint: str = _LEAVE_OUT) -> InputError:
    return InputError(f"no words in {name!r}", hint)


def _tierless(name: str) -> InputError:
    return InputError(f"a tier of {name!r}, which has none", "tiers are in .TextGrid and .eaf; leave --transcript-tier out")


def _read(reader: TranscriptFormat, text: str, tier: str, name: str, note: Note) -> Iterable[Entry]:
    """The entries of a text; if ``tier`` is not empty, of the tier that is called so."""
    if not tier:
        return reader.read(text, note)
    if reader.read_tiers is None:
        raise _tierless(name)
    return find_tier(reader.read_tiers(text), tier)


def _read_prose(text: str, name: str, speech: Speech | SpeechSource | None, seconds: float | None) -> tuple[Word, ...]:
    """The words of a text without times, laid on the sound."""
    tokens = list_tokens("\n".join(drop_labels(text.split("\n"))), prose=True)
    if all(token == LAUGHTER for token in tokens):
        raise _wordless(name)
    if speech is not None:
        aligner = SoundAligner(speech)
        words = _lay_all(tokens, 0.0, aligner.seconds, lambda part, start, end: aligner.align(part), alone=True)
        return _keep_inside(cut_overlaps(words), seconds, name, is_told=False)
    if seconds is None:
        raise InputError(f"{name!r} is plain text, without times", "give the speech too, or a transcript with times")
    return tuple(cut_overlaps(_lay_all(tokens, 0.0, seconds, spread)))


def settle(
    entries: Iterable[Entry],
    seconds: float | None = None,
    name: str = "transcript",
    *,
    speech: Speech | SpeechSource | None = None,
) -> tuple[Word, ...]:
    """Words from entries in any order: silences dropped, several words laid out, sorted, overlaps cut, ends cut at ``seconds``.

    Where ``speech`` is given, entries of several words are laid on it, and a `CospeechWarning` tells of words outside of it, of
    subtitles at the same time, and of more words than somebody says in their time.

    Raises:
        InputError: a time is not a number, an entry ends before it starts, or all lie outside of the speech.
    """
    timed_tokens = _end_at_the_next(_check_entries(entries))
    if speech is not None:
        _note_overlaps(timed_tokens, name)
    words = list[Word]()
    aligner: SoundAligner | None = None
    for tokens, start, end in timed_tokens:
        lay: _Lay = spread
        if speech is not None and len(tokens) > 1 and end - start >= _CUE:
            aligner = aligner or SoundAligner(speech)  # the sound is read only where it is needed
            lay = aligner.align_within
        words += _lay_all(tokens, start, end, lay)
    early = [word for word in words if word.start < 0 and word.end <= 0]
    words = cut_overlaps(sorted((w for w in words if w.start >= 0 or w.end > 0), key=lambda w: (w.start, w.end)))
    if early and not words:
        raise InputError(
            f"{name!r} ends at {early[-1].end:g} s, before the speech begins", "does it belong to another recording?"
        )
    if speech is not None:
        _note_left_out(early, len(words) + len(early), "end before the beginning of the speech", name)
        if words:
            note_haste([word.text for word in words], words[-1].end - words[0].start, "")
    return _keep_inside(words, seconds, name, is_told=speech is not None)


def _check_entries(entries: Iterable[Entry]) -> list[_TimedTokens]:
    """Tokens and times of the entries that say something."""
    timed_tokens, words = list[_TimedTokens](), 0
    for count, (text, start, end) in enumerate(entries):
        if not (
            math.isfinite(start) and math.isfinite(end) and abs(start) < PLAUSIBLE_SECONDS and abs(end) < PLAUSIBLE_SECONDS
        ):
            raise InputError(f"{text[:40]!r} is at {start:g} … {end:g} s", "times are in seconds")
        if end < start:
            raise InputError(f"{text[:40]!r} ends before it starts: {start:g} … {end:g} s", "are its columns swapped?")
        tokens = list_tokens(text)
        words += len(tokens)
        if words > WORDS or count > 2 * WORDS:  # between two words there may be a silence
            raise InputError(f"a transcript of more than {WORDS:,} words", "cut it into pieces")
        if tokens:
            timed_tokens.append((tokens, start, end))
    return timed_tokens


def _span(timed_tokens: _TimedTokens) -> tuple[float, float]:
    return timed_tokens[1:]


def _end_at_the_next(timed_tokens: list[_TimedTokens]) -> list[_TimedTokens]:
    """Entries that end where the next one begins, if most are still shown while the next is said, as those of YouTube are."""
    several = sorted((each for each in timed_tokens if len(each[0]) > 1), key=_span)
    over = sum(before[1] < after[1] < before[2] - _OVERLAP for before, after in pairwise(several))
    if over < max(_STILL_SHOWN_LEAST, _STILL_SHOWN * len(several)):
        return timed_tokens
    order = sorted(timed_tokens, key=_span)
    result, later = list[_TimedTokens](), math.inf
    for k in range(len(order) - 1, -1, -1):
        tokens, start, end = order[k]
        if k + 1 < len(order) and order[k + 1][1] > start:
            later = order[k + 1][1]
        result.append((tokens, start, min(end, later)))
    return result[::-1]


def _lay_all(tokens: Sequence[str], start: float, end: float, lay: _Lay, *, alone: bool = False) -> list[Word]:
    """Words of tokens between two times; laughs stand in the pauses between those that are said.

    A single spoken word takes all of the time, unless ``alone`` is set: then it is laid, too. Words that are not laid on the
    sound leave room for a laugh before or behind them.
    """
    plain = [token for token in tokens if token != LAUGHTER]
    if not plain:
        return [Word(LAUGHTER, start, end)] if tokens else []
    first, last = start, end
    if lay is spread or (len(plain) == 1 and not alone):
        room = min(_LAUGH, (end - start) / 3)
        first, last = start + room * (tokens[0] == LAUGHTER), end - room * (tokens[-1] == LAUGHTER)
    words = list(lay(plain, first, last)) if len(plain) > 1 or alone else [Word(bare(plain[0]), first, last)]
    if len(plain) == len(tokens):
        return words
    result, free, count = list[Word](), start, 0
    for token in tokens:
        if token != LAUGHTER:
            result.append(words[count])
            free, count = words[count].end, count + 1
            continue
        until = words[count].start if count < len(words) else end
        begin = free if count else max(free, until - _LAUGH)
        result.append(Word(LAUGHTER, begin, max(begin, min(until, begin + _LAUGH))))
    return result


def _note_overlaps(timed_tokens: Sequence[_TimedTokens], name: str) -> None:
    """Warn of entries of several words at the same time, whose words would be mixed."""
    several = sorted(
        ((start, end, tokens) for tokens, start, end in timed_tokens if len(tokens) > 1), key=lambda each: each[:2]
    )
    over = [after for before, after in pairwise(several) if after[0] < before[1] - _OVERLAP]
    if over:
        start, _, tokens = over[0]
        problem = f"{name!r}: {len(over)} of {len(several)} entries begin before the one before ends, the first is"
        warnings.warn(
            f"{problem} {' '.join(tokens)[:40]!r} at {start:g} s; their words are mixed: leave out who is not to be seen",
            CospeechWarning,
            stacklevel=3,
        )


def _note_left_out(words: Sequence[Word], count: int, why: str, name: str) -> None:
    if words:
        problem = f"{name!r}: {len(words)} of {count} words {why} and are left out"
        first = f"the first is {words[0].text[:40]!r} at {words[0].start:g} s"
        warnings.warn(f"{problem}, {first}", CospeechWarning, stacklevel=4)


def _keep_inside(words: Sequence[Word], seconds: float | None, name: str, *, is_told: bool) -> tuple[Word, ...]:
    """Words that begin inside the speech, cut at its end.

    Raises:
        InputError: there are words, and none does.
    """
    if seconds is None:
        return tuple(words)
    inside = tuple(Word(w.text, w.start, min(w.end, seconds)) for w in words if w.start < seconds)
    if words and not inside:
        start = words[0].start
        hours = int(start // _HOUR)
        hint = "does it belong to another recording, or are its times in milliseconds?"
        if hours and start - hours * _HOUR < seconds:
            clock = f"its clock begins at {hours:02d}:00:00, as broadcasters' do"
            hint = f"{clock}: --transcript-offset -{hours * _HOUR} takes that off its times"
        raise InputError(f"{name!r} begins at {start:g} s, but the speech is {seconds:.2f} s long", hint)
    if is_told:
        late = f"begin after the end of the speech ({seconds:.2f} s)"
        _note_left_out(words[len(inside) :], len(words), late, name)
    return inside


def cut_overlaps(words: list[Word]) -> list[Word]:
    """Words in order of their starts; where two overlap, the earlier ends where the later begins. Each keeps `SHORTEST`."""
    starts, free = [], 0.0
    for word in words:
        starts.append(max(word.start, free))
        free = starts[-1] + SHORTEST
    ends = [max(word.end, start + SHORTEST) for word, start in zip(words, starts, strict=True)]
    ends[:-1] = [min(end, after) for end, after in zip(ends[:-1], starts[1:], strict=True)]
    return [replace(word, start=start, end=end) for word, start, end in zip(words, starts, ends, strict=True)]
