"""Audio features at the rate of the motion: a stream gives the rows of the whole, in time; rows are of their own frame."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech import InputError, Speech
from cospeech.audio.features import (
    AUDIO_NAMES,
    REDUCTIONS,
    FrameFeatures,
    analyse,
    audio_features,
    audio_width,
    frame_delay,
    log_mel,
    reduce_audio,
)
from cospeech.audio.features.reduce import audio_columns, audio_names
from cospeech.audio.speech import example


def voice(seconds: float, rate: int = 16_000, seed: int = 0) -> Speech:
    """Voiced bursts over noise, with a pitch that wanders."""
    random = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    phase = 2 * np.pi * np.cumsum(130 + 30 * np.sin(2 * t)) / rate
    loud = np.clip(np.sin(2 * np.pi * 1.7 * t), 0, 1)
    tone = sum(np.sin(k * phase) / k for k in range(1, 9))
    return Speech((0.2 * loud * tone + 0.003 * random.normal(size=len(t))).astype(np.float32), rate)


def cut(speech: Speech, at: list[int]) -> list[Speech]:
    edges = [0, *sorted(at), len(speech)]
    return [Speech(speech.samples[a:b], speech.rate) for a, b in pairwise(edges)]


@pytest.mark.slow
@settings(max_examples=30)
@given(st.data())
def test_pieces_of_any_size_give_the_bits_of_the_whole(data):
    rate = data.draw(st.sampled_from([8000, 16_000, 22_050, 44_100, 48_000]), "rate")
    fps = data.draw(st.sampled_from([15.0, 20.0, 25, 29.97, 30.0, 7.3, 120.0, 250.0]), "fps")
    speech = voice(data.draw(st.floats(0.001, 1.5), "seconds"), rate, data.draw(st.integers(0, 5), "seed"))
    at = data.draw(st.lists(st.integers(0, len(speech)), max_size=12), "at")
    stream = FrameFeatures(fps)
    parts = [stream.push(chunk) for chunk in cut(speech, at)]
    rows = np.concatenate([*parts, stream.finish()])
    assert rows.dtype == np.float32
    assert np.isfinite(rows).all()
    np.testing.assert_array_equal(rows, audio_features(speech, speech.frames(fps), fps))
    assert len(rows) == speech.frames(fps)


def direct(speech: Speech, frames: int, fps: float) -> np.ndarray:
    """Frame by frame, from the definition."""
    features = analyse(speech, mel=True)
    rows = []
    for frame in range(frames):
        low, high = (int(np.round(max(frame + side, 0) * 100 / fps)) for side in (-0.5, 0.5))
        low = min(low, len(features) - 1)
        part = features[low : max(high, low + 1)]
        voiced = part.pitch[part.pitch > 0].astype(float)
        means = [x.astype(float).mean() for x in (part.energy, part.voicing, part.onset)]
        pitch = voiced.mean() if len(voiced) else 0.0
        rows.append([*part.mel.astype(float).mean(0), means[0], pitch, *means[1:]])
    return np.array(rows)


@pytest.mark.parametrize("fps", [15.0, 20.0, 30.0, 120.0])
def test_a_row_is_the_mean_over_its_frames_own_time(fps):
    speech = voice(1.3)
    frames = speech.frames(fps) + 3  # some beyond the end
    np.testing.assert_allclose(audio_features(speech, frames, fps), direct(speech, frames, fps), rtol=1e-5, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("fps", [7.3, 15.0, 20.0, 30.0, 60.0])
def test_rows_come_within_the_promised_delay(fps):
    speech, stream, given = voice(3.0), FrameFeatures(fps), 0
    for k, chunk in enumerate(cut(speech, list(range(160, len(speech), 160)))):
        given += len(stream.push(chunk))
        seconds = (k + 1) * 0.01
        assert given >= np.floor((seconds - frame_delay(fps)) * fps + 1e-9) + 1  # the frames whose time is that long ago
    assert speech.frames(fps) - given <= np.ceil(frame_delay(fps) * fps)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_speech():
    stream = FrameFeatures(20)
    for chunk in voice(20.0).chunks(0.1):
        stream.push(chunk)
        assert len(stream._data) < 30


def test_end_and_rates_are_kept():
    stream = FrameFeatures(20)
    stream.push(voice(0.5))
    with pytest.raises(InputError, match="16000 Hz"):
        stream.push(voice(0.5, 8000))
    assert len(stream.finish()) + stream._next >= 10
    with pytest.raises(InputError, match="over"):
        stream.push(voice(0.5))
    with pytest.raises(InputError, match="frames per second"):
        FrameFeatures(float("nan"))
    assert FrameFeatures(20).finish().shape == (0, 84)
    assert FrameFeatures(20).finish(3).shape == (3, 84)


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    speech = Speech.load(example()[0])
    return audio_features(speech, speech.frames(20), 20)


@pytest.mark.parametrize("name", REDUCTIONS)
def test_each_row_is_reduced_alone(rows, name):
    if name in (
        "log-mel-400",
        "waveform",
    ):  # made of other rows (test_features_log_mel.py, test_waveform.py); any of their width
        rows = np.resize(rows, (len(rows), len(audio_columns(name))))
    whole = reduce_audio(rows, name)
    assert whole.shape == (len(rows), audio_width(name)) == (len(rows), len(set(audio_names(name))))
    assert whole.dtype == np.float32
    assert np.isfinite(whole).all()
    parts = [reduce_audio(rows[k : k + n], name) for k, n in ((0, 1), (1, 1), (2, 7), (9, 100), (109, len(rows)))]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert reduce_audio(rows[:0], name).shape == (0, audio_width(name))
    assert whole.std(0).min() > 0


def test_widths_are_those_of_the_papers():
    widths = {name: audio_width(name) for name in REDUCTIONS}
    assert widths == {
        "mel64": 64,
        "mel29-linear": 29,
        "mel29": 29,
        "mel27": 27,
        "mel40": 40,
        "mel20-prosody": 24,
        "prosody": 4,
        "log-mel-400": 64,
        "mfcc14": 14,
        "waveform": 1080,
    }


@pytest.mark.slow
def test_pooled_bands_are_like_a_filter_bank_of_so_many():
    """Against 29 triangles on the spectrum itself: the power is the same, only the shape of the bands differs."""
    speech = Speech.load(example()[0])
    features = analyse(speech, mel=True)
    columns = np.zeros((len(features), len(AUDIO_NAMES)), np.float32)
    columns[:, :80] = features.mel
    ours, theirs = reduce_audio(columns, "mel29"), log_mel(speech.samples, n_mels=29)
    loud = features.energy > -40
    assert np.abs(ours[loud] - theirs[loud]).mean() < 0.5  # nats; 2 dB
    np.testing.assert_allclose(np.log(reduce_audio(columns, "mel29-linear")), ours, atol=1e-4)
    for name, count in (("mel64", 64), ("mel29", 29), ("mel27", 27)):
        pairs = zip(reduce_audio(columns, name).T, log_mel(speech.samples, n_mels=count).T, strict=True)
        assert min(np.corrcoef(a, b)[0, 1] for a, b in pairs) > 0.9


def test_a_flat_spectrum_stays_flat():
    columns = np.full((2, 84), np.log(0.25), np.float32)
    np.testing.assert_allclose(reduce_audio(columns, "mel29-linear"), 0.25, rtol=1e-5)
    np.testing.assert_allclose(reduce_audio(columns, "mel20-prosody")[:, :20], np.log(0.25), rtol=1e-5)


def test_pitch_is_told_in_octaves():
    columns = np.zeros((3, 84), np.float32)
    columns[:, AUDIO_NAMES.index("pitch")] = (0, 120, 480)
    columns[:, AUDIO_NAMES.index("energy")] = -30
    out = reduce_audio(columns, "prosody")
    assert out.tolist() == [[-30, 0, 0, 0], [-30, 0, 0, 0], [-30, 2, 0, 0]]
    np.testing.assert_array_equal(reduce_audio(columns, "mel20-prosody")[:, 20:], out)


def test_bad_columns_are_told(rows):
    with pytest.raises(InputError, match="did you mean 'mel29-linear'"):
        reduce_audio(rows, "mel29linear")
    with pytest.raises(InputError, match="84"):
        reduce_audio(rows[:, :80], "mel29")
    with pytest.raises(InputError, match="finite"):
        reduce_audio(np.full((1, 84), np.nan), "mel29")
    with pytest.raises(InputError, match="no reduction"):
        audio_width("")
    assert np.isfinite(reduce_audio(np.full((1, 84), 1e4, np.float32), "mel29-linear")).all()
