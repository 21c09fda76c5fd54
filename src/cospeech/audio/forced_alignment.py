"""When each word of a plain text is spoken, from the sound alone: no model, any language, most words within 0.1 s.

Pauses are cut out of the speech; what is left is divided among the words by dynamic programming: a word should take about as
long as its letters suggest, hold about as many loudness peaks as it has syllables, and begin where the voice dips; pauses
belong between words, best after punctuation. Median error of the word starts against forced alignments: 0.05 s on reading,
0.06 s on commands (an even division: 0.15 and 0.37 s). Better times come from a recogniser (`align_with_recogniser`).
"""

from __future__ import annotations

import re
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import CospeechWarning, InputError, describe_extra
from ..limits import WORDS
from .features.prosody import Features, ProsodyStream, analyse, find_pauses
from .speech import RATE, Speech, SpeechSource, Word, open_speech

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["SoundAligner", "align", "align_with_recogniser", "bare", "count_syllables", "note_haste", "spread", "tokenise"]

Floats = NDArray[np.float64]

STEP = 2  # feature frames per step of the search: 20 ms
_HASTE = 10.0  # syllables per second of voice [ours: readers have 4 to 6, quick speakers 8; half as much text again is noticed]
_SEVERAL = 8  # words below which the rate says little [ours]
PAUSE = 0.08  # seconds; ours: shorter silences are the closures of p, t, k
BAND = (1.5, 6.0)  # seconds around the even division within which a boundary is searched: at least, at most
BAND_SHARE = 0.15  # of the speech, between those two
LONG = 90.0  # seconds of voice from which on sentences are laid before words; ours: below, the band is wide enough
_MOST_WORDS = 40  # of a sentence; texts without punctuation are laid in pieces of so many
_BREAK = 0.15  # seconds of a pause at which a sentence may end; it may at each whole second of voice, too [ours]
_FARTHEST = 120.0  # seconds that sentences may be from the even division, at most [ours]
_PAUSES, _EVENNESS = 10, 0.3
"""Factors on `PAUSE_GAIN` and on `LENGTH` of each word, for sentences [ours: fitted on 45 minutes of sentences read by several
speakers, where the first words are .3 s off (median), instead of 2]."""
_IMPOSSIBLE = 1e12  # a cost
SLOWEST = 5  # times its expected length, the longest that a word is tried at …
MANY_STEPS = 50  # … but at least a second; ours
# Weights of the costs. Ours: fitted on 5 utterances read aloud (LibriVox) and 100 commands (GRID, s1) with known word times
LENGTH = 1.7  # squared logarithm of length over expected length
PEAKS = 0.17  # squared difference of peaks and syllables
DIP = 0.3  # loudness at the boundary, 0 dip … 1 peak
PAUSE_GAIN = 0.5  # for a boundary in a pause of 0.3 s or more
INNER_PAUSE = 0.5  # for a pause inside a word
COMMA = 1.0  # for punctuation without a pause; those recordings came without punctuation, so this one is a guess

DIGRAPHS = re.compile(r"([a-z])\1|th|sh|ch|ph|wh|ck|ng|gh|qu|ea|ou|ow|ai|ay|ie|ei|oa|au|aw|ue|ew")
# Scripts without blanks between words: Thai, Lao, kana, Han
UNSPACED = r"\u0e00-\u0eff\u3040-\u30ff\u3400-\u9fff\uf900-\ufaff\U00020000-\U0003ffff"
PIECES = re.compile(rf"[{UNSPACED}]|[^{UNSPACED}\s]+|\s+")
VOWELS = frozenset("aeiouyœøæıаеёиоуыэюяіїєαεηιουωאאוי")
ENDS = frozenset(".,;:!?…–—。、，！？；：؟،۔।")


def tokenise(text: str) -> list[str]:
    """Words with their punctuation; scripts without blanks (Chinese, Japanese, Thai) give one token per character.

    >>> tokenise("Hello, world - 你好。")
    ['Hello,', 'world-', '你', '好。']
    """
    return [token for token in _tokens(text) if bare(token)]


def _tokens(text: str) -> Iterator[str]:
    """Pieces of a text, each with the signs that follow it, from the first to the last.

    Raises:
        InputError: there are too many.
    """
    count, parts = 0, list[str]()
    for match in PIECES.finditer(text):
        part = match[0]
        if part.isspace():
            continue
        if parts and any(c.isalnum() for c in part):
            yield "".join(parts)
            count, parts = count + 1, []
        parts.append(part)
        if count >= WORDS:
            raise InputError(f"a transcript of more than {WORDS:,} words", "cut it into pieces")
    if parts:
        yield "".join(parts)


def bare(token: str) -> str:
    """A token without the punctuation around it."""
    if token.isalnum():  # most words: nothing is to be taken away
        return token
    first = next((i for i, c in enumerate(token) if _is_letter(c)), len(token))
    last = next((i for i, c in enumerate(reversed(token)) if _is_letter(c)), 0)
    return token[first : len(token) - last]


def _is_letter(character: str) -> bool:
    return unicodedata.category(character)[0] in "LNM"


def count_syllables(word: str) -> int:
    """Syllables of a word: English rules where it is written in Latin letters, groups of vowels or single signs elsewhere.

    >>> [count_syllables(w) for w in ("time", "little", "everything", "played", "you", "42", "BBC", "你", "молоко")]
    [1, 2, 4, 1, 1, 3, 3, 1, 3]
    """
    plain = bare(word)
    digits = sum(c.isdigit() for c in plain)
    letters = [c for c in unicodedata.normalize("NFD", plain.lower()) if c.isalpha()]
    if not letters:
        return max(1, round(1.4 * digits))  # ours: "twenty-three" has 3 for 2 digits, "seven" 2 for 1
    signs = sum(unicodedata.category(c) == "Lo" for c in letters)
    if (
        signs > len(letters) / 2
    ):  # a sign is a syllable (Han, kana, Hangul before NFD), or a consonant (Arabic, Thai, Devanagari)
        whole = sum(unicodedata.name(c, "").startswith(("CJK", "HANGUL", "HIRAGANA", "KATAKANA")) for c in plain)
        return max(1, whole or round(signs / 2))
    if plain.isupper() and 1 < len(plain) <= 4 and not set(letters) & VOWELS:
        return len(letters)
    text = "".join(letters)
    if text.isascii():
        text = re.sub(r"(?:[^laeiouyscgxzh]es|(?<![td])ed|(?<![^aeiouy]l)e)$", "", text) if len(text) > 3 else text
    groups = 0
    before = False
    for letter in text:
        vowel = letter in VOWELS
        groups += vowel and not before
        before = vowel
    return max(1, groups) + round(1.4 * digits)


def _sounds(word: str) -> float:
    """About how many sounds a word has, and so how long it takes: its letters, where two that make one sound count once."""
    plain = bare(word).lower()
    digits = sum(c.isdigit() for c in plain)
    if not plain.isascii():
        signs = sum(unicodedata.name(c, "").startswith(("CJK", "HANGUL", "HIRAGANA", "KATAKANA")) for c in plain)
        others = sum(unicodedata.category(c)[0] == "L" for c in plain) - signs
        return max(1.0, 2.5 * signs + others + 4.0 * digits)
    text = DIGRAPHS.sub("-", "".join(c for c in plain if c.isalpha()))
    silent_e = len(text) > 2 and text.endswith("e")
    letters = 2.0 if len(text) == 1 else len(text) - silent_e  # a single letter is mostly spelt out: "b" is /biː/
    return max(1.0, letters + 4.0 * digits)


def spread(tokens: Sequence[str], start: float, end: float) -> list[Word]:
    """Words from ``start`` to ``end`` seconds, side by side, in proportion to how many sounds they have."""
    if not tokens:
        return []
    shares = np.cumsum([0.0, *(_sounds(token) for token in tokens)])
    times = (start + (end - start) * shares / shares[-1]).tolist()
    return [Word(bare(token), times[i], times[i + 1]) for i, token in enumerate(tokens)]


def align(tokens: Sequence[str] | str, speech: Speech | SpeechSource | Features) -> tuple[Word, ...]:
    """When each token is spoken, in order; times in seconds.

    Raises:
        InputError: no tokens, or more than could be spoken in that time (25 a second).
    """
    return SoundAligner(speech).align(tokenise(tokens) if isinstance(tokens, str) else tokens)


class SoundAligner:
    """Lays tokens on a sound, or on parts of it. The sound is analysed once.

    Args:
        speech: the sound, or its features; a source on disk is read once from its beginning to its end.
    """

    def __init__(self, speech: Speech | SpeechSource | Features) -> None:
        energy, self._fps = _energy(speech)
        self.seconds = float(speech.duration) if isinstance(speech, Speech) else max(1, len(energy) - 1) / self._fps
        self._voiced = np.ones(len(energy), bool)
        for start, end in find_pauses(energy, self._fps, shortest=PAUSE):
            self._voiced[round(start * self._fps) : round(end * self._fps)] = False
        self._voiced[int(np.ceil(self.seconds * self._fps - 1e-6)) :] = False  # the last frame may lie on the very end
        self._loudness, self._peaks = _cues(energy)
        self._room = 2 * len(energy)  # frames in which parts are searched [ours: overlaps cost no more than twice the sound]

    def align(self, tokens: Sequence[str]) -> tuple[Word, ...]:
        """As `align`."""
        tokens = [token for token in tokens if bare(token)]
        if not tokens:
            raise InputError("there is no word in the transcript", "leave the transcript out if nobody speaks")
        if len(tokens) > 25 * self.seconds + 5:
            problem = f"{len(tokens)} words in {self.seconds:.1f} s of speech"
            raise InputError(problem, "does the transcript belong to this recording?")
        note_haste(tokens, float(self._voiced.sum()) / self._fps, " of voice")
        return tuple(self._lay(tokens, 0.0, self.seconds))

    def align_within(self, tokens: Sequence[str], start: float, end: float) -> list[Word]:
        """When each token is spoken between two times in seconds. They are spread evenly if hardly any voice is there."""
        first, last = max(0.0, start), min(end, self.seconds)
        frames = int((last - first) * self._fps)
        if frames <= 0 or frames > self._room:
            return spread(tokens, start, end)
        self._room -= frames
        return list(self._lay(tokens, first, last))

    def _lay(self, tokens: Sequence[str], start: float, end: float) -> Iterable[Word]:
        first = int(np.ceil(start * self._fps - 1e-6))
        until = int(np.ceil(end * self._fps - 1e-6))
        frames = (np.flatnonzero(self._voiced[first:until]) + first)[::STEP]
        if len(frames) < 2 * len(tokens):  # silence, or hardly any speech: spread them over all of it
            return spread(tokens, start, end)
        gaps = np.diff(frames, prepend=frames[0] - STEP) - STEP
        pauses = np.where(gaps > STEP, gaps, 0) / self._fps
        bounds = _search(tokens, self._loudness[frames], self._peaks[frames], pauses, STEP / self._fps)
        return _words(tokens, bounds, frames / self._fps, STEP / self._fps, end)


def note_haste(words: Sequence[str], seconds: float, what: str) -> None:
    """Warn of more words than somebody says in so many seconds; ``what`` says which seconds they are."""
    syllables = sum(map(count_syllables, words))
    if len(words) >= _SEVERAL and syllables > _HASTE * seconds:
        problem = f"the transcript has {syllables} syllables for {seconds:.1f} s{what}, faster than people speak"
        warnings.warn(f"{problem}: does it belong to this recording?", CospeechWarning, stacklevel=4)


def _energy(speech: Speech | SpeechSource | Features) -> tuple[Floats, float]:
    """Energy in dB per frame; a source on disk is read once from a decoder of its own, in constant memory."""
    if isinstance(speech, Features):
        return speech.energy.astype(float), speech.fps
    if isinstance(speech, Speech):
        features = analyse(speech)
        return features.energy.astype(float), features.fps
    stream = ProsodyStream()
    with open_speech(speech.path, rate=RATE) as again:
        parts = [stream.push(block).energy for block in again.blocks()]
    last = stream.flush()
    return np.concatenate([*parts, last.energy]).astype(float), last.fps


def _cues(energy: Floats) -> tuple[Floats, Floats]:
    """Per frame: loudness 0 … 1 within its surroundings, and peaks so far."""
    smooth = np.convolve(np.pad(energy, 3, mode="edge"), np.hanning(9)[1:-1] / np.hanning(9).sum(), mode="valid")
    around = np.lib.stride_tricks.sliding_window_view(np.pad(smooth, 15, mode="edge"), 31)
    low, high = around.min(axis=1), around.max(axis=1)
    loudness = (smooth - low) / np.maximum(high - low, 6.0)  # ours: less than 6 dB is no dip
    peaks = np.zeros(len(energy))
    peaks[1:-1] = (smooth[1:-1] >= smooth[:-2]) & (smooth[1:-1] > smooth[2:]) & (loudness[1:-1] > 0.6)
    return loudness, np.cumsum(peaks)


def _search(tokens: Sequence[str], loudness: Floats, peaks: Floats, pauses: Floats, step: float) -> NDArray[np.intp]:
    """Boundaries 0 = b₀ < b₁ < … < bₙ = T in steps, at the least total cost."""
    lengths = np.array([_sounds(token) for token in tokens])
    syllables = [count_syllables(token) for token in tokens]
    total = len(loudness)
    spans = lengths * (total / lengths.sum())
    if total * step > LONG:
        is_punctuated = sum(token[-1] in ENDS for token in tokens) * _MOST_WORDS > len(tokens)
        centres, band = _lay_sentences(tokens, lengths, syllables, peaks, pauses, step), BAND[0 if is_punctuated else 1]
    else:
        centres, band = np.cumsum(spans), np.clip(BAND_SHARE * total * step, *BAND)
    half = int(band / step)
    at_edge = DIP * np.append(loudness, 0) - PAUSE_GAIN * np.append(np.minimum(pauses / 0.3, 1), 1)
    at_edge[0] = 0
    no_pause = np.append(pauses <= 0, False)
    breaks = np.append(np.cumsum(pauses > 0), (pauses > 0).sum())  # pauses at or before a step
    counts = np.append(peaks, peaks[-1])
    low, cost = 0, np.zeros(1)
    history: list[tuple[int, NDArray[np.intp]]] = []
    for i, token in enumerate(tokens):
        last = i == len(tokens) - 1
        first = total if last else max(int(centres[i]) - half, i + 1)
        until = total if last else max(min(int(centres[i]) + half, total - (len(tokens) - 1 - i)), first)
        ends = np.arange(first, until + 1)
        # Up to SLOWEST times its length, and far enough that every end has a start that can be reached.
        longest = max(int(SLOWEST * spans[i]), until - low - len(cost) + 2, first - low, MANY_STEPS)
        nearest = max(1, first - low - len(cost) + 1)  # what is shorter begins behind all places where a word may begin
        sizes = np.arange(nearest, min(longest, until - low) + 1)
        starts = ends[:, None] - sizes
        possible = (starts >= low) & (starts < low + len(cost))
        starts = np.clip(starts, low, low + len(cost) - 1)
        price = PEAKS * (counts[ends][:, None] - counts[starts] - syllables[i]) ** 2 + LENGTH * np.log(sizes / spans[i]) ** 2
        price += INNER_PAUSE * np.maximum(breaks[ends - 1][:, None] - breaks[starts], 0) + cost[starts - low]
        price[~possible] = np.inf
        best = price.argmin(axis=1)
        edge = at_edge[ends] + (COMMA * no_pause[ends] if token[-1] in ENDS else 0)
        low, cost = first, price[np.arange(len(ends)), best] + edge
        history.append((first, ends - sizes[best]))
    bounds = [total]
    for first, best in reversed(history):
        bounds.append(int(best[bounds[-1] - first]))
    return np.array(bounds[::-1])


def _lay_sentences(
    tokens: Sequence[str], lengths: Floats, syllables: Sequence[int], peaks: Floats, pauses: Floats, step: float
) -> Floats:
    """(n,) steps at which each token ends, roughly: sentences are laid between pauses at the least total cost.

    Over minutes, a speaker is seconds away from the even division.
    """
    total = len(peaks)
    cuts = [0]
    for i, token in enumerate(tokens[:-1], 1):
        if token[-1] in ENDS or i - cuts[-1] == _MOST_WORDS:
            cuts.append(i)
    cuts.append(len(tokens))
    marks = np.cumsum([0.0, *lengths]) * (total / lengths.sum())
    at = np.unique([0, *np.flatnonzero(pauses >= _BREAK), *range(0, total, round(1 / step)), total])
    gains = PAUSE_GAIN * np.append(np.minimum(pauses / 0.3, 1), 1)[at]
    gains[0], counts, sums = 0.0, np.append(peaks, peaks[-1])[at], np.cumsum([0, *syllables])
    half = min(BAND_SHARE * total, _FARTHEST / step)
    before, cost, history = np.zeros(1, int), np.zeros(1), list[tuple[NDArray[np.intp], NDArray[np.intp]]]()
    for k, (a, b) in enumerate(pairwise(cuts)):
        near = np.flatnonzero(abs(at - marks[b]) <= half) if k < len(cuts) - 2 else np.array([len(at) - 1])
        sizes = at[near][:, None] - at[before]
        price = cost + _EVENNESS * LENGTH * (b - a) * np.log(np.maximum(sizes, 1) / (marks[b] - marks[a])) ** 2
        price += PEAKS / (b - a) * (counts[near][:, None] - counts[before] - (sums[b] - sums[a])) ** 2
        price[sizes <= 0] = _IMPOSSIBLE
        best = price.argmin(axis=1)
        pull = _PAUSES if tokens[b - 1][-1] in ENDS else 1
        before, cost = near, price[np.arange(len(near)), best] - pull * gains[near]
        history.append((near, best))
    k, bounds = 0, list[int]()
    for near, best in reversed(history):
        bounds.append(int(at[near[k]]))
        k = int(best[k])
    return np.interp(marks[1:], marks[cuts], np.maximum.accumulate([0, *bounds[::-1]]))


def _words(tokens: Sequence[str], bounds: NDArray[np.intp], times: Floats, step: float, seconds: float) -> Iterable[Word]:
    """A word starts with its first voiced step and ends with its last, inside the speech."""
    starts = np.minimum(times[bounds[:-1]], seconds).tolist()
    ends = np.minimum(times[bounds[1:] - 1] + step, seconds).tolist()
    ends[:-1] = [min(end, after) for end, after in zip(ends[:-1], starts[1:], strict=True)]
    for token, start, end in zip(tokens, starts, ends, strict=True):
        yield Word(bare(token), start, end)


def align_with_recogniser(
    path: str | PathLike[str], recognise: Callable[[str], Iterable[Word]] | None = None
) -> tuple[Word, ...]:
    """Words and times as a recogniser hears them: ``recognise(path)``, faster-whisper's smallest model where not given.

    Raises:
        InputError: faster-whisper is not installed.
    """
    return tuple((recognise or _faster_whisper)(str(path)))


def _faster_whisper(path: str) -> Iterable[Word]:
    try:
        from faster_whisper import WhisperModel
    except ImportError:
        raise InputError("word times from a recogniser need faster-whisper", describe_extra("asr")) from None
    try:
        segments, _ = WhisperModel("tiny", device="cpu", compute_type="int8").transcribe(path, word_timestamps=True)
        for segment in segments:
            for word in segment.words or ():
                yield Word(bare(word.word), float(word.start), float(word.end))
    except (OSError, ValueError, RuntimeError) as error:  # its weights are fetched from a hub on first use
        reason = str(error).partition("\n")[0][:120]
        raise InputError(
            f"faster-whisper gave up: {reason}", "is there a network, or are its weights on this machine?"
        ) from None
