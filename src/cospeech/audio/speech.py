"""Speech: mono samples at one rate, with the words where they are known; whole in memory or streamed.

Files are decoded in a process of their own (`_decode.py`): a codec that crashes, hangs or eats memory ends there and is
reported as an `InputError`. The format is found by content, never by suffix.

What happens to odd files: silence is valid speech (the character idles); a file without a single sample, with samples that are
not numbers or far outside -1 … 1, or damaged in the middle is an error; one that merely ends early (a recorder that was
switched off) gives what it holds, a WAV with a `CospeechWarning`. Channels are averaged; if they cancel, the louder one speaks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import isfinite
from numbers import Rational
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, say_count
from ..files import regular_file
from ..limits import SECONDS_IN_MEMORY, SOUND_RATES, SPEECH_RATES
from .channels import ChannelMerge
from .decoding import SoundDecoder
from .languages import with_language
from .word import Word, check_words

__all__ = ["Speech", "SpeechSource", "Word", "add_words", "count_frames", "example", "open_speech", "shift_times"]

Samples = NDArray[np.float32]
File = str | PathLike[str]
Source = TypeVar("Source", bound="SpeechSource")

RATE = 16_000  # Hz; what the features are computed at (wideband speech)
SPARE = 1  # second by which a speech may be said to be longer than its samples; ours: encoders pad and cut
LOUDEST = 100.0  # ours: +40 dB over full scale; floats beyond were not scaled to -1 … 1
FPS_DENOMINATOR = 1_001_000  # exact for 30000/1001 and for three decimals


def count_frames(duration: Fraction, fps: float | Fraction) -> int:
    """Exactly ceil(duration × fps); fps as a float is read as the simple fraction it stands for (29.97…, 30000/1001).

    >>> count_frames(Fraction(48_000, 16_000), 30), count_frames(Fraction(48_001, 16_000), 30)
    (90, 91)

    Raises:
        InputError: fps is not a positive number.
    """
    try:
        exact = _exact(fps).limit_denominator(FPS_DENOMINATOR)
    except (ValueError, OverflowError, TypeError):
        exact = Fraction(0)
    if exact <= 0:
        raise InputError(f"{fps} frames per second", "a positive number, such as 30")
    return -(-(duration * exact).numerator // (duration * exact).denominator)


def _hint_of(samples: Samples) -> str:
    """Hint for samples of a wrong shape or type."""
    if samples.ndim == 2:
        scale = f" / {1 << 8 * samples.dtype.itemsize - 1}" if samples.dtype.kind == "i" else ""
        return f"samples.mean({int(np.argmin(samples.shape))}){scale} mixes its {min(samples.shape)} channels"
    return "one row of floats in -1 … 1, or of 16-bit integers; np.frombuffer(x, np.int16) reads bytes"


@dataclass(frozen=True, eq=False)
class Speech:
    """A stretch of speech.

    Args:
        samples: (N,) float32, mono, full scale ±1.
        rate: samples per second.
        words: what is said and when, in order of their starts; None if not known.
        seconds: its length; None: N / rate. For a file: its number of frames over its own rate, before resampling.
        name: for reports and messages.
        start: time of the first sample in seconds; the chunks of a stream have theirs.
        duration: ``seconds`` as an exact fraction; None: it is computed.
    """

    samples: Samples = field(repr=False)
    rate: int = RATE
    words: tuple[Word, ...] | None = None
    seconds: float | None = None  # type: ignore[assignment]  # a float once made
    name: str = "speech"
    start: float = 0.0
    duration: Fraction = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        samples = np.asarray(self.samples)
        if samples.ndim != 1 or (samples.dtype.kind != "f" and samples.dtype != np.int16):
            raise InputError(f"samples of shape {samples.shape} and type {samples.dtype}", _hint_of(samples))
        if samples.dtype != np.float32:
            samples = samples.astype(np.float32) / np.float32(1 if samples.dtype.kind == "f" else 32768)
        object.__setattr__(self, "rate", _check_rate(self.rate))
        _check_samples(samples[:, None], self.name, 0, self.rate)
        object.__setattr__(self, "samples", samples)
        whole = Fraction(len(samples), self.rate)
        if self.duration is None:
            object.__setattr__(self, "duration", whole if self.seconds is None else _fraction("seconds", self.seconds))
        if self.duration is not whole and not (isinstance(self.duration, Rational) and 0 <= self.duration <= whole + SPARE):
            problem = f"{len(samples)} samples at {self.rate} Hz as a speech of {str(self.duration)[:40]} s"
            raise InputError(problem, f"{len(samples) / self.rate:g} s, or a little less")
        object.__setattr__(self, "seconds", float(self.duration))
        check_words(self.words)
        if not (isinstance(self.start, float) and isfinite(self.start)):
            _fraction("start", self.start)
            object.__setattr__(self, "start", float(self.start))

    @staticmethod
    def load(path: File, *, transcript: File | None = None, rate: int = RATE, language: str = "") -> Speech:
        """Read a whole file; see `open_speech` for what can be read, and for the language.

        Raises:
            InputError: it cannot be read, or is longer than two hours (stream it with `open_speech`).
        """
        parts, count = [], 0
        with open_speech(path, rate=rate) as source:
            for block in source.blocks():
                parts.append(block)
                count += len(block)
                if count > SECONDS_IN_MEMORY * rate:
                    problem = f"{source.name!r} is longer than {SECONDS_IN_MEMORY / 3600:g} hours"
                    raise InputError(problem, "stream it: cospeech.audio.speech.open_speech")
        assert source.duration is not None
        speech = Speech(np.concatenate(parts), rate, name=source.name, duration=source.duration)
        if transcript is None:
            return speech
        from .transcripts import load_speech_words

        return replace(speech, words=with_language(load_speech_words(transcript, speech=speech), language))

    def __len__(self) -> int:
        return len(self.samples)

    def frames(self, fps: float | Fraction) -> int:
        """How many frames of motion this speech takes: exactly ceil(duration × fps)."""
        return count_frames(self.duration, fps)

    def window(self, start: float, end: float) -> Speech:
        """The part of this speech from ``start`` to ``end`` seconds, as far as there is speech, with the words that overlap it.

        The times of a window, and of its words, count from the beginning of the whole speech. So do ``start`` and ``end`` if
        you take a window of a window, or of a chunk.

        Raises:
            InputError: times that are no numbers, an end that is not after the start, or no sample of this speech in between.
        """
        if not start < end:  # false for NaN, too
            raise InputError(f"a window from {start} to {end} s", "the end comes after the start")
        bounds = np.clip((np.array([start, end], float) - self.start) * self.rate, 0, len(self.samples))
        first, last = (round(float(bound)) for bound in bounds)
        if first == last:
            there = f"{self.start:g} … {self.start + len(self.samples) / self.rate:g} s"
            raise InputError(f"no sample of {self.name!r} from {start:g} to {end:g} s", f"times are kept: here it is {there}")
        at = self.start + first / self.rate
        until = self.start + last / self.rate
        words = None if self.words is None else tuple(w for w in self.words if w.start < until and w.end > at)
        return self._cut(first, last, words)

    def chunks(self, seconds: float = 0.2) -> Iterator[Speech]:
        """The speech in pieces, as a microphone would give it; each word travels with the chunk in which it starts.

        Raises:
            InputError: ``seconds`` is shorter than a sample.
        """
        step = seconds * self.rate
        if not (step >= 1 and isfinite(step)):
            raise InputError(f"chunks of {seconds} s", f"at least one sample, 1/{self.rate} s")
        words, end, first, number = self.words or (), 0, 0, 1
        while first < len(self.samples):
            last = min(round(number * step), len(self.samples))
            until = self.start + last / self.rate if last < len(self.samples) else np.inf
            before = end
            while end < len(words) and words[end].start < until:
                end += 1
            yield self._cut(first, last, None if self.words is None else words[before:end])
            first, number = last, number + 1

    def _cut(self, first: int, last: int, words: tuple[Word, ...] | None) -> Speech:
        rest = last == len(self.samples)
        duration = max(self.duration - Fraction(first, self.rate), Fraction(0)) if rest else Fraction(last - first, self.rate)
        return Speech(self.samples[first:last], self.rate, words, None, self.name, self.start + first / self.rate, duration)


def shift_times(speech: Speech, origin: float) -> Speech:
    """The same speech, its times and those of its words counted from ``origin`` seconds: of a window, from its own start.

    >>> part = Speech(np.zeros(800, np.float32), words=(Word("so", 4.1, 4.3),), start=4.0)
    >>> shift_times(part, 4.0).start, round(shift_times(part, 4.0).words[0].start, 3)
    (0.0, 0.1)
    """
    if not origin:
        return speech
    words = speech.words and tuple(replace(w, start=w.start - origin, end=w.end - origin) for w in speech.words)
    return replace(speech, words=words, start=speech.start - origin)


def open_speech(path: File, *, transcript: File | None = None, rate: int = RATE, language: str = "") -> SpeechSource:
    """Open a sound file for reading in blocks, in constant memory, whatever its length.

    WAV, FLAC, OGG (Vorbis, Opus), MP3 and AIFF; MP4, M4A, WebM and other media where PyAV is installed (the extra ``av``).
    8 … 384 kHz, any number of channels. ``language``: that of the transcript, see `with_language`.

    >>> with open_speech("talk.wav") as source:                                        # doctest: +SKIP
    ...     for block in source.blocks():
    ...         ...                             # float32 at source.rate
    ...     print(source.seconds)               # exact, now that all of it has been heard

    Raises:
        InputError: there is no such file, it is not sound, its rate is out of range, or the language is unknown.
    """
    return add_words(SpeechSource(path, rate), transcript, language)


def add_words(source: Source, transcript: File | None, language: str = "") -> Source:
    """The same source, with the words of a transcript; it is closed where they cannot be read.

    Raises:
        InputError: the transcript cannot be read, or the language is unknown.
    """
    try:
        if transcript is not None:
            from .transcripts import load_speech_words

            words = load_speech_words(transcript, speech=source, speech_seconds=source.expected_seconds)
            source.words = with_language(words, language)
    except BaseException:
        source.close()
        raise
    return source


def example() -> tuple[Path, Path]:
    """The speech that comes with cospeech (19 s, a synthetic voice) and its word times: (.ogg, .TextGrid)."""
    folder = Path(__file__).parents[1] / "assets" / "example"
    return folder / "example.ogg", folder / "example.TextGrid"


class SpeechSource:
    """A sound file being read; made by `open_speech`. A context manager: leaving it ends the decoder.

    Args:
        path: of the file.
        rate: of the blocks that come out.
        channel: the one that is read, from 0 on; all are merged where not given.

    Attributes:
        name: the file's name.
        rate: of the blocks that come out.
        source_rate, channels: of the file.
        expected_seconds: what the file's header says, for progress bars; None where it says nothing believable.
        source_frames, duration, seconds: exact, once `blocks` has come to its end; None before.
        words: from the transcript; None without one.
    """

    def __init__(self, path: str | PathLike[str], rate: int = RATE, channel: int | None = None) -> None:
        self.path, self.rate, self._channel = regular_file(path), _check_rate(rate), channel
        self.name = Path(path).name
        self.words: tuple[Word, ...] | None = None
        self.source_frames: int | None = None
        self._decoder = SoundDecoder(self.path, self.name)
        self._fresh = True
        try:
            self.source_rate, self.channels, claim = self._decoder.header()
            if channel is not None and not 0 <= channel < self.channels:
                raise InputError(f"channel {channel + 1} of {self.name!r}", f"it has {say_count(self.channels, 'channel')}")
        except BaseException:
            self.close()
            raise
        self.expected_seconds = claim / self.source_rate if 0 < claim < (1 << 48) else None

    @property
    def duration(self) -> Fraction | None:
        return None if self.source_frames is None else Fraction(self.source_frames, self.source_rate)

    @property
    def seconds(self) -> float | None:
        return None if self.duration is None else float(self.duration)

    def frames(self, fps: float | Fraction) -> int:
        """Exactly ceil(duration × fps); only once `blocks` has come to its end."""
        if self.duration is None:
            raise InputError(f"the length of {self.name!r} is not known before its end", "read all blocks first")
        return count_frames(self.duration, fps)

    def blocks(self) -> Iterator[Samples]:
        """The speech in float32 blocks of some seconds at ``rate``; called again, it starts again.

        All blocks together are ceil(duration × rate) samples; time 0 of the file is sample 0 of the first block.

        Raises:
            InputError: the file is damaged, has no samples, or samples that are not numbers.
        """
        if not self._fresh:
            self._decoder.close()
            self._decoder = SoundDecoder(self.path, self.name, notes=False)  # it has warned before
            self._decoder.header()
        self._fresh, decoder = False, self._decoder
        try:
            yield from self._resample(self._mono(decoder))
        finally:
            decoder.close()

    def _mono(self, decoder: SoundDecoder) -> Iterator[Samples]:
        """Checked blocks, channels merged. Sets source_frames at the end."""
        frames, merge = 0, ChannelMerge(self.channels, self.source_rate, self._channel)
        for raw in decoder.blocks():
            block = np.frombuffer(raw, np.float32).reshape(-1, self.channels)
            _check_samples(block, self.name, frames, self.source_rate)
            frames += len(block)
            yield from merge.push(block)
        yield from merge.flush()
        if not frames:
            raise InputError(f"there is no sound in {self.name!r}: 0 samples", "was the recording stopped before it began?")
        self.source_frames = frames

    def _resample(self, blocks: Iterator[Samples]) -> Iterator[Samples]:
        """At ``rate``, aligned to the first sample, ceil(duration × rate) samples in all."""
        if self.source_rate == self.rate:
            yield from blocks
            return
        from soxr import ResampleStream

        resampler, count = ResampleStream(self.source_rate, self.rate, 1, "float32", "HQ"), 0
        for block in blocks:
            out = resampler.resample_chunk(block)
            count += len(out)
            if len(out):
                yield out
        tail = resampler.resample_chunk(np.zeros(0, np.float32), last=True)
        assert self.source_frames is not None
        missing = -(-self.source_frames * self.rate // self.source_rate) - count
        if missing > 0:
            yield np.pad(tail, (0, max(missing - len(tail), 0)))[:missing]

    def close(self) -> None:
        """End the decoder; no process and no pipe is left, unless a thread decodes and hangs."""
        self._decoder.close()

    def __enter__(self) -> SpeechSource:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def _check_rate(rate: object) -> int:
    """A whole number of samples per second; 16000, 16000.0 and NumPy's numbers are accepted.

    Raises:
        InputError: it is no whole number, or no rate that speech has.
    """
    is_number = isinstance(rate, int | float | np.integer | np.floating) and not isinstance(rate, bool)
    if is_number and SPEECH_RATES[0] <= rate <= SPEECH_RATES[1] and rate == int(rate):  # type: ignore[operator,call-overload]
        return int(rate)  # type: ignore[call-overload]
    text = repr(rate)[:40] if not isinstance(rate, int) or abs(rate) < 10**30 else "too many"  # digits of an int have a limit
    raise InputError(f"{text} samples per second", f"a whole number, {SPEECH_RATES[0]:,} … {SPEECH_RATES[1]:,}, such as 16000")


def _exact(value: object) -> Fraction:
    """A number as a fraction; NumPy's floats, too, which Python 3.11 does not take."""
    return Fraction(float(value) if isinstance(value, np.floating) else value)  # type: ignore[call-overload]


def _fraction(what: str, value: object) -> Fraction:
    """A time in seconds as the simple fraction that it stands for.

    Raises:
        InputError: it is no number, or not finite.
    """
    try:
        return _exact(value).limit_denominator(SOUND_RATES[1])
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"a speech whose {what} is {str(value)[:40]!r}", "a number of seconds") from None


def _check_samples(block: NDArray[np.float32], name: str, before: int, rate: int) -> None:
    if not block.size or (block.max() <= LOUDEST and block.min() >= -LOUDEST):  # false for NaN
        return
    row, column = np.argwhere(~(np.abs(block) <= LOUDEST))[0]
    value = float(block[row, column])
    hint = "full scale is ±1" if np.isfinite(value) else "what wrote them is at fault, or the file is damaged"
    raise InputError(f"a sample of {name!r} at {(before + row) / rate:.2f} s is {value:g}", hint)
