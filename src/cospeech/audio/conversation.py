"""People in conversation: whose voice is in which file or channel, who speaks when, and when the others may nod.

Each microphone also hears the others. Where a track is much softer than its own speech usually is, while another track is
loud, the sound is that of the other person, and counts as silence. So does the noise of a room.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..limits import SPEAKERS
from ..motion.rotations import Array
from .backchannel_cues import BackchannelCue, CueDetector
from .prosodic_events import RATE, Phrase
from .speech import Samples, SpeechSource
from .word import Word

__all__ = ["HeardSpeaker", "TrackSource", "VoiceTrack", "hear_conversation", "hear_recording", "merge_speakers"]

_SILENT = -90.0  # dBFS of digital silence [ours: 16-bit sound has nothing softer]
_STEADY = 21  # rows over which levels are smoothed for the decision [ours: 0.2 s, a syllable]
_LOUD = 0.99  # quantile of smoothed levels that counts as this speaker's own loud speech [ours]
_OWN_LOUD = 0.95  # the same, over the moments at which only this speaker is heard [ours: stressed syllables]
_FEW = 30  # rows of the shortest speech that is told apart from another voice [ours: 0.3 s, "mhm"]
_FLOOR, _OVER = 0.05, 10.0  # quantile that is the noise of a track, and dB above it from which something sounds [ours]
_SOFTER = 6.0  # dB by which a track without speech is softer than the one that it picks up [ours: half a metre and one]
_SPEECH = 38.0  # dB below loud speech down to which somebody is heard [ours: `EventDetector` believes 22 to 38]
# Levels are taken below a track's own loud speech. A track picks up the other person where its level is lower than that of the
# other track by so many dB: a share of the usual difference while the other person is loud, between two bounds [ours:
# microphones half a metre from each mouth and two metres apart differ by 12 dB, headsets and separate rooms by far more; two
# who speak at once, by less than 7]
_SHARE, _FOREIGN = 0.6, (7.0, 12.0)
_LOUDER = 15.0  # dB below loud speech down to which somebody is loud [ours: stressed syllables]
_NOTHING = 40.0  # dB below own loud speech from which nothing of it is left [ours: a soft end of a phrase is 30 below]
_FADE = 5  # rows over which the sound comes and goes [ours: 50 ms]
_SHORTEST = 0.12  # s; shorter sound is no speech: it is left of another person where the sound comes and goes [ours]
_AUDIBLE = -60.0  # dBFS of the loudest second, below which nobody is heard at all [ours: the noise floor of most microphones]
_AROUND = 0.1  # s about a stretch of a diarisation in which the speaker is heard, too [ours: their borders are rounded]
_ALIKE = 1.0  # dB; two tracks that differ by less on the mean are the same sound [ours]


@dataclass(frozen=True)
class VoiceTrack:
    """The file and the channel with the voice of one person.

    Args:
        path: sound file.
        channel: of that file, from 0 on; all are merged where not given.
    """

    path: str | PathLike[str]
    channel: int | None = None

    def __str__(self) -> str:
        name = Path(self.path).name
        return name if self.channel is None else f"{name}, channel {self.channel + 1}"


@dataclass(frozen=True, eq=False)
class HeardSpeaker:
    """One person of a conversation.

    Args:
        track: the voice.
        share: (T,) at 100 Hz: 1 where the sound of the track is this person's, 0 where it is another one's.
        length: seconds of the conversation, exact.
        phrases: what this person says.
        cues: moments at which others may respond.
    """

    track: VoiceTrack
    share: Array
    length: Fraction
    phrases: tuple[Phrase, ...] = ()
    cues: tuple[BackchannelCue, ...] = ()

    def open(self) -> TrackSource:
        """The voice of this person alone, for reading in blocks."""
        return TrackSource(self)

    def owns(self, word: Word) -> bool:
        """Whether a word of the recording is this person's."""
        middle = round((word.start + word.end) / 2 * RATE)
        return 0 <= middle < len(self.share) and bool(self.share[middle] > 0.5)


class TrackSource(SpeechSource):
    """Reads a track in which only its own person is heard; it is as long as the conversation."""

    def __init__(self, speaker: HeardSpeaker) -> None:
        super().__init__(speaker.track.path, channel=speaker.track.channel)
        self._share, self._length = speaker.share, speaker.length

    def blocks(self) -> Iterator[Samples]:
        """Blocks as of `SpeechSource`, with silence where another person is heard, and at the end."""
        count = 0
        for block in super().blocks():
            yield block * self._shares(count, len(block))
            count += len(block)
        whole = -(-self._length.numerator * self.rate // self._length.denominator)
        while count < whole:
            yield np.zeros(min(self.rate, whole - count), np.float32)
            count += min(self.rate, whole - count)

    def _shares(self, first: int, count: int) -> Samples:
        """(count,) shares of the samples from ``first`` on."""
        at = np.clip((first + np.arange(count)) * (RATE / self.rate) - 0.5, 0, len(self._share) - 1)
        low = int(at[0])
        near = self._share[low : int(at[-1]) + 2]
        return np.interp(at - low, np.arange(len(near)), near).astype(np.float32)

    @property
    def duration(self) -> Fraction | None:
        return None if super().duration is None else self._length


def hear_conversation(*tracks: VoiceTrack) -> tuple[HeardSpeaker, ...]:
    """Analyse a conversation of people who have a track each.

    Args:
        tracks: two or more, which begin at the same moment. Where one is shorter, silence follows.

    Raises:
        InputError: a file cannot be read, two tracks are the same sound, or there are more than `SPEAKERS`.
    """
    _check_count(len(tracks))
    measurements = [_measure(track) for track in tracks]
    length = max(seconds for _, seconds in measurements)
    count = max(len(levels) for levels, _ in measurements)
    levels = [np.pad(each, (0, count - len(each)), constant_values=_SILENT) for each, _ in measurements]
    for one, other in combinations(range(len(tracks)), 2):
        audible = np.maximum(levels[one], levels[other]) > _AUDIBLE
        if audible.any() and float(np.abs(levels[one] - levels[other])[audible].mean()) < _ALIKE:
            hint = "each person needs a track of their own: a file each, or a stereo file with one person on each channel"
            raise InputError(f"{tracks[one]} and {tracks[other]} are the same sound", hint)
    shares = _find_shares(levels)
    return tuple(_hear(HeardSpeaker(track, share, length)) for track, share in zip(tracks, shares, strict=True))


def hear_recording(track: VoiceTrack, stretches: Mapping[str, Sequence[Phrase]]) -> dict[str, HeardSpeaker]:
    """Analyse a conversation of people who are mixed in one recording.

    Args:
        track: the recording.
        stretches: name → when this person speaks, see `cospeech.audio.diarisation.read_speakers`.

    Raises:
        InputError: the file cannot be read, or more than `SPEAKERS` persons speak.
    """
    _check_count(len(stretches))
    levels, length = _measure(track)
    times, speakers = np.arange(len(levels)) / RATE, dict[str, HeardSpeaker]()
    for name, phrases in stretches.items():
        own = np.zeros(len(levels))
        for phrase in phrases:
            own[slice(*np.searchsorted(times, (phrase.start - _AROUND, phrase.end + _AROUND)))] = 1.0
        speakers[name] = _hear(HeardSpeaker(track, _average(own, _FADE), length))
    return speakers


def _check_count(persons: int) -> None:
    """Raise an InputError where there are too many persons to analyse in a sensible time."""
    if persons > SPEAKERS:
        raise InputError(f"a conversation of {persons:,} persons", f"{SPEAKERS} at most; are its speakers told apart well?")


def merge_speakers(speakers: Sequence[HeardSpeaker]) -> HeardSpeaker:
    """Join several persons into one, for somebody who listens to all: the phrases of any of them, and the cues of all."""
    phrases = list[Phrase]()
    for phrase in sorted(phrase for each in speakers for phrase in each.phrases):
        if phrases and phrase.start <= phrases[-1].end:
            phrases[-1] = Phrase(phrases[-1].start, max(phrases[-1].end, phrase.end))
        else:
            phrases.append(phrase)
    cues = sorted(cue for each in speakers for cue in each.cues)
    return replace(speakers[0], phrases=tuple(phrases), cues=tuple(cues))


def _measure(track: VoiceTrack) -> tuple[Array, Fraction]:
    """Levels of a track, (T,) dBFS at 100 Hz, and its length in seconds."""
    with SpeechSource(track.path, channel=track.channel) as source:
        hop, rest, levels = source.rate // round(RATE), np.zeros(0, np.float32), list[Array]()
        for block in source.blocks():
            samples = np.concatenate([rest, block])
            whole = len(samples) // hop * hop
            power = np.square(samples[:whole].reshape(-1, hop), dtype=np.float64).mean(1)
            levels.append(np.maximum(10 * np.log10(power + 1e-12), _SILENT))
            rest = samples[whole:]
        assert source.duration is not None
        return np.concatenate([*levels, [_SILENT]]), source.duration


def _find_shares(levels: Sequence[Array]) -> list[Array]:
    """(T,) of each track: 1 where it hears its own person."""
    smooth = [_average(each, _STEADY) for each in levels]
    loud = _find_loud(smooth)
    below = [top - each if top > _AUDIBLE else np.full(len(each), -_SILENT) for top, each in zip(loud, smooth, strict=True)]
    shares = []
    for k, own in enumerate(below):
        noise = np.quantile(smooth[k], _FLOOR) + _OVER
        foreign = (own > _NOTHING) | ((smooth[k] < noise) & (own > _LOUDER))
        for other in (*below[:k], *below[k + 1 :]):
            apart = own - other
            usual = np.median(apart[other < _LOUDER]) if (other < _LOUDER).any() else 0.0
            foreign |= (apart > np.clip(_SHARE * usual, *_FOREIGN)) & (other < _SPEECH)
        shares.append(_average(np.where(foreign, 0.0, 1.0), _FADE))
    return shares


def _find_loud(levels: Sequence[Array]) -> list[float]:
    """Level of each person's loud speech in their own track, dBFS; `_SILENT` of a person who says nothing.

    The difference between the levels of two tracks has one value while one person speaks, and another value while the other
    one does, whatever the gains are. So a few words are found among much sound of the other person. Where there is one value
    only, one person speaks: the one of the louder track.
    """
    sounds = [each > np.quantile(each, _FLOOR) + _OVER for each in levels]
    loud = []
    for k, own in enumerate(levels):
        rows, silent = sounds[k].copy(), sounds[k].sum() < _FEW
        for other, sounding in zip([*levels[:k], *levels[k + 1 :]], [*sounds[:k], *sounds[k + 1 :]], strict=True):
            mine, theirs = (np.sort((own - other)[where]) for where in (sounds[k], sounding))
            if min(len(mine), len(theirs)) < _FEW:
                continue
            low, high = float(theirs[_FEW - 1]), float(mine[-_FEW])
            if high - low > 2 * _FOREIGN[0]:
                rows &= own - other > (low + high) / 2
            else:
                silent |= float(np.median(mine)) < -_SOFTER
        level = float(np.quantile(own[rows], _OWN_LOUD)) if rows.sum() >= _FEW else float(np.quantile(own, _LOUD))
        loud.append(_SILENT if silent else level)
    return loud


def _average(values: Array, rows: int) -> Array:
    """(T,) means over so many rows about each row; the end values are repeated."""
    signal = np.pad(values, rows // 2, mode="edge")
    sums = np.concatenate([[0.0], np.cumsum(signal)])
    return (sums[rows:] - sums[:-rows]) / rows


def _hear(speaker: HeardSpeaker) -> HeardSpeaker:
    """The same person, with phrases and cues."""
    detector, cues = CueDetector(), list[BackchannelCue]()
    with speaker.open() as source:
        for block in source.blocks():
            cues += detector.push(block)
    cues += detector.finish()
    phrases = [phrase for phrase in detector.phrases if phrase.end - phrase.start >= _SHORTEST]
    return replace(speaker, phrases=tuple(phrases), cues=tuple(cues))
