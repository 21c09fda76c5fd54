"""Two tracks of a conversation: whose sound is where, who speaks when, and when the other one may respond."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import soundfile

from cospeech.audio.backchannel_cues import CueDetector
from cospeech.audio.conversation import VoiceTrack, hear_conversation, hear_recording, merge_speakers
from cospeech.audio.prosodic_events import Phrase
from cospeech.audio.speech import Speech, example
from cospeech.errors import InputError

RATE = 16_000


@pytest.fixture(scope="module")
def voices():
    """Two persons who take turns, each silent while the other one speaks: (2, N) samples, and the turns in seconds."""
    speech = Speech.load(example()[0]).samples
    parts = [speech[:64_000], speech[64_000:128_000], speech[128_000:192_000], speech[192_000:256_000]]
    tracks, at, turns = np.zeros((2, 18 * RATE), np.float32), RATE // 2, []
    for k, part in enumerate(parts):
        faster = part if k % 2 == 0 else np.interp(np.arange(0, len(part), 1.2), np.arange(len(part)), part)
        tracks[k % 2, at : at + len(faster)] = faster
        turns.append((k % 2, at / RATE, (at + len(faster)) / RATE))
        at += len(faster) + RATE // 3
    return tracks, turns


def write(path, samples, rate=RATE):
    soundfile.write(path, samples, rate)
    return path


def measure_phrases(speaker, low, high):
    return sum(max(min(phrase.end, high) - max(phrase.start, low), 0) for phrase in speaker.phrases)


@pytest.mark.parametrize("leak", [0.0, 0.1, 0.2])
def test_the_other_person_in_a_microphone_is_no_speech_of_ones_own(voices, tmp_path, leak):
    tracks, turns = voices
    noise = np.random.default_rng(1).normal(0, 2e-4, tracks.shape).astype(np.float32)
    path = write(tmp_path / "call.wav", (tracks + leak * np.roll(tracks[::-1], 60, 1) + noise).T)
    speakers = hear_conversation(VoiceTrack(path, 0), VoiceTrack(path, 1))
    for who, low, high in turns:
        assert measure_phrases(speakers[who], low, high) > 0.6 * (high - low)
        assert measure_phrases(speakers[1 - who], low + 0.1, high - 0.1) < 0.1 * (high - low)
    with speakers[0].open() as source:
        own = np.concatenate(list(source.blocks()))
    foreign = slice(round((turns[1][1] + 0.3) * RATE), round((turns[1][2] - 0.3) * RATE))
    assert len(own) == tracks.shape[1]
    assert np.abs(own[foreign]).mean() <= 0.25 * leak * np.abs(tracks[1, foreign]).mean() + 3e-4


@pytest.mark.parametrize(
    ("words", "leak", "noise"), [(0.6, 0.12, 2e-4), (0.6, 0.06, 6e-3), (0.0, 0.12, 1e-4), (0.0, 0.12, 3e-3)]
)
def test_who_says_a_few_words_or_nothing_has_none_of_the_others_speech(tmp_path, words, leak, noise):
    """A minute in which one person speaks, and the other one for 0.6 s, or never."""
    speech = Speech.load(example()[0]).samples
    tracks = np.zeros((2, 62 * RATE), np.float32)
    for k in range(3):
        tracks[0, k * 20 * RATE : k * 20 * RATE + len(speech)] = speech
    length = round(words * RATE)
    tracks[1, 60 * RATE : 60 * RATE + length] = speech[4 * RATE : 4 * RATE + length]
    hiss = np.random.default_rng(1).normal(0, noise, tracks.shape).astype(np.float32)
    path = write(tmp_path / "call.wav", (tracks + leak * np.roll(tracks[::-1], 60, 1) + hiss).T)
    host, guest = hear_conversation(VoiceTrack(path, 0), VoiceTrack(path, 1))
    assert measure_phrases(host, 0, 59) > 30
    assert measure_phrases(guest, 0, 59.9) < 1.5
    assert (measure_phrases(guest, 60, 61) > 0.3) == (words > 0)


def test_a_soft_recording_of_one_person_changes_nothing(voices, tmp_path):
    tracks, turns = voices
    path = write(tmp_path / "call.wav", ((tracks + 0.1 * tracks[::-1]) * np.array([[1.0], [0.06]])).T)
    speakers = hear_conversation(VoiceTrack(path, 0), VoiceTrack(path, 1))
    for who, low, high in turns:
        assert measure_phrases(speakers[who], low, high) > 0.6 * (high - low)
        assert measure_phrases(speakers[1 - who], low + 0.1, high - 0.1) < 0.1 * (high - low)


def test_silent_tracks_and_tracks_of_few_words_are_not_the_same_sound(tmp_path):
    speech = Speech.load(example()[0]).samples
    tracks = np.zeros((4, 120 * RATE), np.float32)
    tracks[0, RATE : 2 * RATE], tracks[1, 90 * RATE : 91 * RATE] = speech[RATE : 2 * RATE], speech[3 * RATE : 4 * RATE]
    path = write(tmp_path / "four.wav", tracks.T)
    speakers = hear_conversation(*(VoiceTrack(path, channel) for channel in range(4)))
    assert [bool(each.phrases) for each in speakers] == [True, True, False, False]


def test_both_at_once_are_both_heard(tmp_path):
    speech = Speech.load(example()[0]).samples[: 6 * RATE]
    first, second = write(tmp_path / "a.wav", speech), write(tmp_path / "b.wav", 0.5 * speech[::-1])
    one, other = hear_conversation(VoiceTrack(first), VoiceTrack(second))
    loud = [
        np.abs(each[: len(speech) // 160 * 160].reshape(-1, 160)).max(1) > 0.1 * np.abs(each).max()
        for each in (speech, speech[::-1])
    ]
    both = loud[0] & loud[1]
    assert both.mean() > 0.2
    for share in (one.share, other.share):
        assert share[: len(both)][both].mean() > 0.8


def test_a_shorter_track_goes_on_in_silence_and_no_sample_is_lost(tmp_path, voices):
    tracks, _ = voices
    first, second = write(tmp_path / "a.wav", tracks[0], 44_100), write(tmp_path / "b.wav", tracks[1, : 9 * RATE], 22_050)
    one, other = hear_conversation(VoiceTrack(first), VoiceTrack(second))
    assert one.length == other.length == max(Fraction(len(tracks[0]), 44_100), Fraction(9 * RATE, 22_050))
    for speaker in (one, other):
        with speaker.open() as source:
            count = sum(map(len, source.blocks()))
            assert source.duration == one.length
        assert count == -(-one.length.numerator * RATE // one.length.denominator)


def test_two_tracks_of_one_sound_are_no_conversation(tmp_path, voices):
    mono = voices[0].sum(0)
    path = write(tmp_path / "mono_as_stereo.wav", np.stack([mono, 0.95 * mono], 1))
    with pytest.raises(InputError, match=r"same sound.*track of their own"):
        hear_conversation(VoiceTrack(path, 0), VoiceTrack(path, 1))


def test_a_channel_that_is_not_there_is_told(tmp_path, voices):
    path = write(tmp_path / "mono.wav", voices[0][0])
    with pytest.raises(InputError, match=r"channel 2 of 'mono.wav'.*1 channel"):
        hear_conversation(VoiceTrack(path, 0), VoiceTrack(path, 1))


def test_silence_gives_no_cue(tmp_path, voices):
    first, second = write(tmp_path / "a.wav", voices[0][0]), write(tmp_path / "b.wav", np.zeros(5 * RATE, np.float32))
    one, other = hear_conversation(VoiceTrack(first), VoiceTrack(second))
    assert one.phrases
    assert one.cues
    assert one.share[100:200].mean() > 0.7, "a silent track takes nothing away"
    assert not other.phrases
    assert not other.cues


def test_cues_do_not_depend_on_the_size_of_the_pieces():
    speech = Speech.load(example()[0]).samples
    results = []
    for size in (160, 1_777, 16_000, len(speech)):
        detector, cues = CueDetector(), []
        for at in range(0, len(speech), size):
            cues += detector.push(speech[at : at + size])
        results.append(sorted(cues + detector.finish()))
        assert detector.phrases
    assert results[0] == results[1] == results[2] == results[3]
    assert {cue.kind for cue in results[0]} == {"pause", "low"}


def test_a_minute_that_is_heard_at_once_gives_the_cues_of_small_pieces():
    speech = np.tile(Speech.load(example()[0]).samples, 4)
    results = []
    for size in (1_600, len(speech)):
        detector, cues = CueDetector(), []
        for at in range(0, len(speech), size):
            cues += detector.push(speech[at : at + size])
        results.append((cues + detector.finish(), detector.phrases))
    assert len(results[0][0]) > 10
    assert results[0] == results[1]


def test_a_pause_cue_is_the_end_of_a_phrase_that_was_long_enough():
    speech = Speech.load(example()[0]).samples
    detector = CueDetector()
    cues = detector.push(speech) + detector.finish()
    ends = {phrase.end for phrase in detector.phrases if phrase.end - phrase.start >= 0.7}
    assert {cue.time for cue in cues if cue.kind == "pause"} == ends


def test_a_low_voice_is_a_cue_and_a_level_one_is_not():
    """A voice of harmonics whose pitch falls in the last quarter of each breath, and one whose pitch does not."""
    times = np.arange(12 * RATE) / RATE
    beat = np.clip(1.2 - np.abs((times * 5) % 1 - 0.5) * 2, 0, 1)  # syllables
    counts = []
    for fall in (0.0, 0.3):
        pitch = 140 * np.where(times % 3 > 2.0, 1 - fall, 1 + 0.05 * np.sin(2 * np.pi * 1.3 * times))
        phase = 2 * np.pi * np.cumsum(pitch) / RATE
        voice = sum(np.sin(k * phase) / k for k in range(1, 12)) * beat * 0.1
        detector = CueDetector()
        cues = detector.push(voice.astype(np.float32)) + detector.finish()
        counts.append([cue.time % 3 for cue in cues if cue.kind == "low"])
    assert len(counts[1]) >= 2
    assert all(at > 2.0 for at in counts[1])
    assert len([at for at in counts[0] if at > 2.0]) < len(counts[1])


def test_three_persons_with_a_track_each(tmp_path, voices):
    tracks, turns = voices
    third = np.zeros_like(tracks[0])
    low, high = (round(time * RATE) for time in turns[2][1:])
    third[low:high], rest = tracks[0, low:high], tracks[0].copy()
    rest[low:high] = 0
    paths = [write(tmp_path / f"{k}.wav", each) for k, each in enumerate((rest, tracks[1], third))]
    speakers = hear_conversation(*map(VoiceTrack, paths))
    for who, begin, end in ((0, *turns[0][1:]), (1, *turns[1][1:]), (2, *turns[2][1:]), (1, *turns[3][1:])):
        for k, each in enumerate(speakers):
            share = measure_phrases(each, begin + 0.1, end - 0.1) / (end - begin)
            assert share > 0.5 if k == who else share < 0.1, (k, who)
    others = merge_speakers([speakers[1], speakers[2]])
    assert [phrase.start for phrase in others.phrases] == sorted(
        phrase.start for each in speakers[1:] for phrase in each.phrases
    )
    assert len(others.cues) == len(speakers[1].cues) + len(speakers[2].cues)


def test_one_recording_of_all_is_parted_by_who_speaks_when(tmp_path, voices):
    tracks, turns = voices
    path = write(tmp_path / "mixed.wav", tracks.sum(0))
    stretches = {f"p{k}": [Phrase(low, high) for who, low, high in turns if who == k] for k in range(2)}
    speakers = hear_recording(VoiceTrack(path), stretches)
    assert list(speakers) == ["p0", "p1"]
    for who, low, high in turns:
        assert measure_phrases(speakers[f"p{who}"], low, high) > 0.6 * (high - low)
        assert measure_phrases(speakers[f"p{1 - who}"], low + 0.2, high - 0.2) == 0
    with speakers["p1"].open() as source:
        own = np.concatenate(list(source.blocks()))
    low, high = (round(time * RATE) for time in turns[1][1:])
    assert np.allclose(own[low:high], tracks[1, low:high], atol=1e-4)


def test_a_crowd_is_no_conversation(tmp_path, voices):
    """Each person is analysed separately: a file of a few bytes could name so many that it takes a day."""
    path = write(tmp_path / "all.wav", voices[0][0, :RATE])
    with pytest.raises(InputError, match=r"a conversation of 65 persons \(64 at most"):
        hear_recording(VoiceTrack(path), {f"s{k}": (Phrase(0.01 * k, 0.01 * k + 0.01),) for k in range(65)})
    with pytest.raises(InputError, match="a conversation of 65 persons"):
        hear_conversation(*(VoiceTrack(path, k) for k in range(65)))
