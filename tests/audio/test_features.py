"""Features against tones of known pitch and level, and streamed against whole."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech import InputError
from cospeech.audio.features import Features, ProsodyStream, analyse, find_pauses, log_mel
from cospeech.audio.features.mel import overlapping
from cospeech.audio.features.prosody import BAND_EDGES, DELAY, ENERGY_BAND
from cospeech.audio.speech import Speech, example

RATE = 16_000


@pytest.fixture(scope="module")
def speech() -> Speech:
    return Speech.load(example()[0])


def tone(frequency: float, seconds: float = 1.0, harmonics: int = 1) -> np.ndarray:
    t = np.arange(round(seconds * RATE)) / RATE
    return sum(np.sin(2 * np.pi * frequency * h * t) / h for h in range(1, harmonics + 1)).astype(np.float32)


@pytest.mark.parametrize(("count", "length", "hop"), [(20, 5, 1), (20, 7, 3), (5, 5, 1), (4, 5, 1), (0, 5, 2), (961, 800, 160)])
def test_overlapping_pieces_are_all_that_fit(count, length, hop):
    samples = np.random.default_rng(0).normal(size=count + 1).astype(np.float32)[1:]
    pieces = [samples[at : at + length] for at in range(0, count - length + 1, hop)]
    np.testing.assert_array_equal(overlapping(samples, length, hop), np.array(pieces).reshape(-1, length))


def test_the_mel_of_the_features_is_log_mel(speech):
    assert np.array_equal(analyse(speech, mel=True).mel, log_mel(speech.samples))


@pytest.mark.parametrize("count", [0, 1, 159, 160, 161, 1600, 16_001])
def test_there_is_a_frame_for_every_hundredth_up_to_the_end(count):
    features = analyse(np.zeros(count, np.float32), mel=True)
    assert len(features) == len(features.mel) == 1 + count // 160
    assert features.times[-1] <= count / RATE


@pytest.mark.parametrize("frequency", [65, 80, 120, 200, 333, 480])
def test_pitch_of_a_voice_like_tone(frequency):
    middle = analyse(0.2 * tone(frequency, harmonics=7))[10:-10]
    assert np.abs(middle.pitch / frequency - 1).max() < 0.005
    assert middle.voicing.min() > 0.95


def test_pitch_follows_a_glide_without_lag():
    frequency = np.linspace(100, 300, 2 * RATE)
    glide = np.sin(2 * np.pi * np.cumsum(frequency) / RATE).astype(np.float32)
    features = analyse(glide)[10:-10]
    assert np.abs(features.pitch - (100 + 100 * features.times)).max() < 3


def test_noise_and_silence_have_no_pitch():
    noise = np.random.default_rng(0).standard_normal(2 * RATE).astype(np.float32) * 0.1
    assert (analyse(noise).pitch > 0).mean() < 0.05
    silence = analyse(np.zeros(RATE, np.float32))
    assert not silence.pitch.any()
    assert not silence.voicing.any()
    assert not silence.onset.any()


def test_levels_are_those_of_the_signal():
    full = analyse(tone(440))[10:-10]
    assert full.energy == pytest.approx(-3.01, abs=0.02)  # a full-scale sine
    assert np.argmax(full.bands, axis=1).tolist() == [1] * len(full)
    quieter = analyse(0.1 * tone(440))[10:-10]
    assert full.energy - quieter.energy == pytest.approx(20, abs=0.01)
    for band, (low, high) in enumerate(pairwise(BAND_EDGES)):
        assert analyse(tone((low + high) / 2)).bands[50, band] == pytest.approx(-3.01, abs=0.1)


def test_energy_leaves_out_what_is_not_speech():
    inside = analyse(tone(1000))[10:-10].energy.min()
    assert analyse(tone(6000))[10:-10].energy.max() < inside - 60
    assert analyse(tone(50))[10:-10].energy.max() < inside - 20  # hum; a window of 25 ms cannot part it more from 100 Hz
    assert ENERGY_BAND == (100, 4000)


def test_an_onset_is_where_sound_begins():
    samples = np.zeros(RATE, np.float32)
    samples[RATE // 2 :] = 0.3 * tone(200, 0.5, harmonics=10)
    onset = analyse(samples).onset
    assert abs(int(onset.argmax()) - 50) <= 1
    assert onset.max() > 20 * onset[60:].mean()


@pytest.mark.slow
@settings(max_examples=25)
@given(st.data())
def test_streamed_equals_whole_to_the_bit(speech, data):
    samples = speech.samples[: 5 * RATE + 77]
    whole = analyse(samples, mel=True)
    stream, parts, at = ProsodyStream(mel=True), [], 0
    while at < len(samples):
        step = data.draw(st.sampled_from([1, 16, 159, 160, 161, 800, 3200, 20_000, 0]))
        step = step if step != 1 or at < 200 else 800
        parts.append(stream.push(samples[at : at + step]))
        at += step
        frames = sum(map(len, parts))
        assert frames <= at // 160 + 1
        assert frames >= (min(at, len(samples)) / RATE - DELAY) * 100 - 1
    joint = Features.concatenate([*parts, stream.flush()])
    assert [part.start for part in parts] == np.cumsum([0, *map(len, parts[:-1])]).tolist()
    for name in ("energy", "pitch", "voicing", "onset", "bands", "mel"):
        assert np.array_equal(getattr(whole, name), getattr(joint, name)), name


def test_a_slice_knows_its_time(speech):
    features = analyse(speech)
    assert features[120:][30:40].times[0] == pytest.approx(1.5)
    with pytest.raises(InputError, match="step 1"):
        features[::2]


def test_pauses_are_between_the_sentences(speech):
    pauses = analyse(speech).pauses(0.3)
    spoken = Speech.load(example()[0], transcript=example()[1]).words
    gaps = [(a.end, b.start) for a, b in pairwise(spoken) if b.start - a.end > 0.3]
    for start, end in gaps:
        assert any(abs(s - start) < 0.1 and abs(e - end) < 0.1 for s, e in pauses), (start, end)


def test_pauses_of_silence_and_of_a_steady_sound():
    assert find_pauses(np.full(100, -100, np.float32)) == [(0.0, 1.0)]
    assert find_pauses(np.full(100, -20, np.float32)) == []
    assert find_pauses(np.zeros(0, np.float32)) == []


def test_another_rate_is_refused(speech):
    with pytest.raises(InputError, match="8000 Hz"):
        analyse(Speech(speech.samples, 8000))
