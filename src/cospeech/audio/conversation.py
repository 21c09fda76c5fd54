"""Two people in conversation: whose voice is in which file or channel, who speaks when, and when the other one may nod.

Each microphone also hears the other person. Where a track is much softer than its own speech usually is, while the other
track is loud, the sound is that of the other person, and counts as silence. So does the noise of a room.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .backchannel_cues import BackchannelCue, CueDetector
from .prosodic_events import RATE, Phrase
from .speech import Samples, SpeechSource

__all__ = ["Conversation", "HeardSpeaker", "VoiceTrack", "TrackSource", "hear_conversation"]

_SILENT = -90.0  # dBFS of digital silence [ours: 16-bit sound has nothing softer]
_STEADY = 21  # rows over which levels are smoothed for the decision [ours: 0.2 s, a syllable]
_LOUD = 0.99  # quantile of smoothed levels that counts as this speaker's own loud speech [ours: 1 % is enough for a few words]
_SPEECH = 38.0  # dB below loud speech down to which somebody is heard [ours: `EventDetector` believes 22 to 38]
_FOREIGN, _SHARE = (
    (7.0, 12.0),
    0.6,
)  # dB by which a track is further below its own loud speech than the other one, where it hears
# the other: this share of what is usual where the other is loud, between these bounds [ours: microphones half a metre from each
# mouth and two metres apart differ by 12 dB, headsets and separate rooms by far more; two who speak at once, by less than 7]
_LOUDER = 15.0  # dB below loud speech down to which somebody is loud [ours: stressed syllables]
_NOTHING = 40.0  # dB below own loud speech from which nothing of it is left [ours: a soft end of a phrase is 30 below]
_FADE = 5  # rows over which the sound comes and goes [ours: 50 ms]
_ALIKE = 1.0  # dB; two tracks that differ by less on the mean are the same sound [ours]


@dataclass(frozen=True)
class VoiceTrack:
    """Where the voice of one person is.

    Args:
        path: sound file.
        channel: the one of that file, from 0 on; all are merged where not given.
    """

    path: str | PathLike[str]
    channel: int | None = None

    def __str__(self) -> str:
        name = Path(self.path).name
        return name if self.channel is None else f"{name}, channel {self.channel + 1}"


@dataclass(frozen=True, eq=False)
class HeardSpeaker:
    """One of the two.

    Args:
        track: the voice.
        share: (T,) at 100 Hz: 1 where the sound of the track is this person's, 0 where it is the other one's.
        length: seconds of the conversation, exact.
        phrases: what this person says.
        cues: moments at which the other one may respond.
    """

    track: VoiceTrack
    share: Array
    length: Fraction
    phrases: tuple[Phrase, ...] = ()
    cues: tuple[BackchannelCue, ...] = ()

    def open(self) -> TrackSource:
        """The voice of this person alone, for reading in blocks."""
        return TrackSource(self)


@dataclass(frozen=True, eq=False)
class Conversation:
    """What was heard of two people.

    Args:
        speakers: both.
    """

    speakers: tuple[HeardSpeaker, HeardSpeaker]


class TrackSource(SpeechSource):
    """A track in which only its own person is heard, as long as the conversation."""

    def __init__(self, speaker: HeardSpeaker) -> None:
        super().__init__(speaker.track.path, channel=speaker.track.channel)
        self._share, self._length = speaker.share, speaker.length

    def blocks(self) -> Iterator[Samples]:
        """As of `SpeechSource`, with silence where the other person is heard, and at the end."""
        count = 0
        for block in super().blocks():
            yield block * self._shares(count, len(block))
            count += len(block)
        whole = -(-self._length.numerator * self.rate // self._length.denominator)
        while count < whole:
            yield np.zeros(min(self.rate, whole - count), np.float32)
            count += min(self.rate, whole - count)

    def _shares(self, first: int, count: int) -> Samples:
        """(count,) of the samples from ``first`` on."""
        at = np.clip((first + np.arange(count)) * (RATE / self.rate) - 0.5, 0, len(self._share) - 1)
        low = int(at[0])
        near = self._share[low : int(at[-1]) + 2]
        return np.interp(at - low, np.arange(len(near)), near).astype(np.float32)

    @property
    def duration(self) -> Fraction | None:
        return None if super().duration is None else self._length


def hear_conversation(first: VoiceTrack, second: VoiceTrack) -> Conversation:
    """Hear two people.

    Args:
        first, second: their tracks, which begin at the same moment. Where one is shorter, silence follows.

    Raises:
        InputError: a file cannot be read, or both tracks are the same sound.
    """
    tracks = (first, second)
    measured = [_measure(track) for track in tracks]
    length = max(seconds for _, seconds in measured)
    count = max(len(levels) for levels, _ in measured)
    levels = [np.pad(each, (0, count - len(each)), constant_values=_SILENT) for each, _ in measured]
    if float(np.abs(levels[0] - levels[1]).mean()) < _ALIKE:
        hint = "each person needs a track of their own: two files, or a stereo file with one person on each channel"
        raise InputError(f"{first} and {second} are the same sound", hint)
    shares = _find_shares(levels)
    speakers = [HeardSpeaker(track, share, length) for track, share in zip(tracks, shares, strict=True)]
    one, other = (_hear(speaker) for speaker in speakers)
    return Conversation((one, other))


def _measure(track: VoiceTrack) -> tuple[Array, Fraction]:
    """(T,) dBFS at 100 Hz, and seconds."""
    with SpeechSource(track.path, channel=track.channel) as source:
        hop, rest, levels = source.rate // round(RATE), np.zeros(0, np.float32), list[Array]()
        for block in source.blocks():
            joined = np.concatenate([rest, block])
            whole = len(joined) // hop * hop
            power = np.square(joined[:whole].reshape(-1, hop), dtype=np.float64).mean(1)
            levels.append(np.maximum(10 * np.log10(power + 1e-12), _SILENT))
            rest = joined[whole:]
        assert source.duration is not None
        return np.concatenate([*levels, [_SILENT]]), source.duration


def _find_shares(levels: Sequence[Array]) -> tuple[Array, Array]:
    """(T,) of each track: 1 where it hears its own person."""
    smooth = [_average(each, _STEADY) for each in levels]
    below = [np.quantile(each, _LOUD) - each for each in smooth]  # dB below this person's own loud speech
    made = []
    for own, other in ((below[0], below[1]), (below[1], below[0])):
        apart = own - other
        usual = float(np.median(apart[other < _LOUDER]))  # there are some: loud speech is what the level is measured from
        foreign = (own > _NOTHING) | ((apart > np.clip(_SHARE * usual, *_FOREIGN)) & (other < _SPEECH))
        made.append(_average(np.where(foreign, 0.0, 1.0), _FADE))
    return made[0], made[1]


def _average(values: Array, rows: int) -> Array:
    """(T,) means over so many rows about each; the ends are held."""
    padded = np.pad(values, rows // 2, mode="edge")
    sums = np.concatenate([[0.0], np.cumsum(padded)])
    return (sums[rows:] - sums[:-rows]) / rows


def _hear(speaker: HeardSpeaker) -> HeardSpeaker:
    """The same person, with phrases and cues."""
    detector, cues = CueDetector(), list[BackchannelCue]()
    with speaker.open() as source:
        for block in source.blocks():
            cues += detector.push(block)
    cues += detector.finish()
    return replace(speaker, phrases=tuple(detector.phrases), cues=tuple(cues))
