"""The level of a recording, and the note about one that is quiet."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import soundfile

from cospeech import Speech
from cospeech.audio.level import QUIET, loudest_level, note_quiet
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
        assert [*note_quiet(pieces, "talk.wav")] == pieces
    with pytest.warns(CospeechWarning, match=r"talk\.wav is silent"):
        list(note_quiet([Speech(np.zeros(1600, np.float32), 16_000)], "talk.wav"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len([*note_quiet([*pieces, tone(QUIET + 1), *pieces], "talk.wav")]) == 7


def test_files_tell_of_a_quiet_recording_once(tmp_path):
    loud = Speech.load(EXAMPLE)
    for name, gain in (("loud", 1.0), ("quiet", 0.01)):
        soundfile.write(tmp_path / f"{name}.wav", loud.samples[: 2 * loud.rate] * gain, loud.rate)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        generate_files(tmp_path / "loud.wav", [tmp_path / "loud.npz"])
        assert not told
        generate_files(tmp_path / "quiet.wav", [tmp_path / "quiet.npz"], takes=2)
    assert [str(note.message) for note in told if "quiet.wav is quiet" in str(note.message)] == [str(told[0].message)]
