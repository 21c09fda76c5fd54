"""The level of a recording, and the notes about one that is quiet and one that is clipped."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import soundfile

from cospeech import Speech
from cospeech.audio.level import CLIPPED, QUIET, count_clipped_samples, loudest_level, note_level
from cospeech.cli.demo import EXAMPLE
from cospeech.errors import CospeechWarning
from cospeech.generate import generate_files


def tone(level: float, seconds: float = 2.0, rate: int = 16_000) -> Speech:
    """A sine of this level, dB of full scale."""
    at = np.arange(round(seconds * rate)) / rate
    return Speech((np.sqrt(2) * 10 ** (level / 20) * np.sin(2 * np.pi * 200 * at)).astype(np.float32), rate)


@pytest.mark.parametrize("level", [-3.1, -20.0, -60.0])
@pytest.mark.parametrize("rate", [8_000, 48_000])
def test_the_level_is_that_of_the_loudest_moment(level, rate):
    assert loudest_level(tone(level, rate=rate)) == pytest.approx(level, abs=0.05)
    whole = np.concatenate([tone(level - 30, rate=rate).samples, tone(level, rate=rate).samples])
    assert loudest_level(Speech(whole, rate)) == pytest.approx(level, abs=0.05)


def test_silence_has_no_level():
    assert loudest_level(Speech(np.zeros(1600, np.float32), 16_000)) == -np.inf
    assert loudest_level(Speech(np.zeros(0, np.float32), 16_000)) == -np.inf


def test_pieces_pass_and_only_what_is_quiet_throughout_is_told():
    pieces = [tone(QUIET - 10), tone(QUIET - 6), tone(QUIET - 20)]
    with pytest.warns(CospeechWarning, match=rf"talk\.wav is quiet: {QUIET - 6:.0f} dB at its loudest"):
        assert [*note_level(pieces, "talk.wav")] == pieces
    with pytest.warns(CospeechWarning, match=r"^talk\.wav is silent; mouth and hands rest throughout$"):
        list(note_level([Speech(np.zeros(1600, np.float32), 16_000)], "talk.wav"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len([*note_level([*pieces, tone(QUIET + 1), *pieces], "talk.wav")]) == 7


def test_files_tell_of_a_quiet_recording_once(tmp_path):
    loud = Speech.load(EXAMPLE)
    for name, gain in (("loud", 1.0), ("quiet", 0.01)):
        soundfile.write(tmp_path / f"{name}.wav", loud.samples[: 2 * loud.rate] * gain, loud.rate)
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        generate_files(tmp_path / "loud.wav", [tmp_path / "loud.npz"])
        assert not notes
        generate_files(tmp_path / "quiet.wav", [tmp_path / "quiet.npz"], takes=2)
    assert [str(note.message) for note in notes if "quiet.wav is quiet" in str(note.message)] == [str(notes[0].message)]


def amplify(speech: Speech, db: float) -> Speech:
    """The speech at full scale, and louder by so many dB; what is above full scale is cut off."""
    samples = speech.samples / np.abs(speech.samples).max() * 10 ** (db / 20)
    return Speech(np.clip(samples, -1, 1).astype(np.float32), speech.rate)


def test_clipped_samples_are_those_of_flat_tops():
    top = np.float32([0, 0.5, 1, 1, 1, 0.5, 0, -1, -1, 0, -0.96, -1, -1, -1])
    assert count_clipped_samples(Speech(top, 16_000)) == 7  # two in a row are a peak
    assert count_clipped_samples(Speech(np.float32([1, 1, -1, -1]), 16_000)) == 0
    assert count_clipped_samples(Speech(np.zeros(0, np.float32), 16_000)) == 0
    assert count_clipped_samples(Speech(np.ones(5, np.float32), 16_000)) == 5


@pytest.mark.parametrize("rate", [16_000, 44_100])
def test_a_voice_is_clipped_from_a_few_db_above_full_scale(tmp_path, rate):
    for db, is_clipped in ((0.0, False), (1.5, False), (6.0, True), (20.0, True)):
        speech = amplify(Speech.load(EXAMPLE, rate=rate), db)
        soundfile.write(tmp_path / "talk.wav", speech.samples, rate)
        recording = Speech.load(tmp_path / "talk.wav")
        assert (count_clipped_samples(recording) > CLIPPED * len(recording)) == is_clipped


def test_people_who_speak_as_loud_as_can_be_are_not_clipped(shared_folder):
    for path in sorted((shared_folder / "data" / "speech").glob("*/*.flac"))[:40]:
        speech = Speech.load(path)
        if np.abs(speech.samples).max() < 0.9:  # as it was recorded, it has no top
            assert count_clipped_samples(amplify(speech, 0.0)) < CLIPPED * len(speech) / 5


def test_a_clipped_recording_is_told_once():
    loud, calm = amplify(Speech.load(EXAMPLE), 12.0), amplify(Speech.load(EXAMPLE), -6.0)
    with pytest.warns(CospeechWarning, match=r"talk\.wav is clipped: \d\d% of its samples are cut off at full scale") as notes:
        assert [*note_level([calm, loud], "talk.wav")] == [calm, loud]
    assert len(notes) == 1
