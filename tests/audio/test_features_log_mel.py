"""PATS' audio features of any speech: a stream gives the rows of the whole, of a store of PATS and of the authors' script."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech import InputError, Speech
from cospeech.audio.features import LOG_MEL_NAMES, LogMelFeatures, log_mel_400, open_features
from cospeech.audio.features.frames import FrameFeatures
from cospeech.audio.features.log_mel import log_mel_at, log_mel_count
from cospeech.audio.features.mel import mel_triangles, spectra
from cospeech.audio.features.reduce import reduce_audio


def voice(seconds: float, rate: int = 16_000, seed: int = 0) -> Speech:
    """A tone that comes and goes over noise, with a stretch of zeros in the middle."""
    t = np.arange(round(seconds * rate)) / rate
    tone = 0.2 * np.clip(np.sin(11 * t), 0, 1) * np.sin(2 * np.pi * (150 * t + 3 * np.sin(2 * t)))
    samples = tone + np.random.default_rng(seed).normal(0, 0.01, len(t))
    samples[len(t) // 3 : len(t) // 2] = 0
    return Speech(samples.astype(np.float32), rate)


def push_pieces(speech: Speech, fps: float, at: list[int] | None = None) -> np.ndarray:
    stream = LogMelFeatures(fps)
    edges = [0, *sorted(at or []), len(speech)]
    parts = [stream.push(Speech(speech.samples[a:b], speech.rate)) for a, b in pairwise(edges)]
    return np.concatenate([*parts, stream.finish()])


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.data())
def test_pieces_of_any_size_give_the_bits_of_the_whole(data):
    rate = data.draw(st.sampled_from([8000, 16_000, 22_050, 44_100, 48_000]), "rate")
    fps = data.draw(st.sampled_from([15.0, 12, 29.97, 30.0, 7.3, 120.0]), "fps")
    speech = voice(data.draw(st.floats(0.001, 1.5), "seconds"), rate, data.draw(st.integers(0, 5), "seed"))
    at = data.draw(st.lists(st.integers(0, len(speech)), max_size=12), "at")
    rows = push_pieces(speech, fps, at)
    np.testing.assert_array_equal(rows, push_pieces(speech, fps))
    assert rows.shape == (speech.frames(fps), 64)
    assert rows.dtype == np.float32


def test_against_the_definition():
    """Each spectrum by a matrix product in float64, as the authors' script says: all but the last digits are alike."""
    speech = voice(2.0)
    samples = speech.samples.astype(float)
    window = np.pad(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(400) / 400), 56)
    rows = []
    for start in range(0, len(samples) - 511, 160):
        bands = mel_triangles(16_000, 512, 64, 125.0, 7500.0, False) @ np.abs(
            np.fft.fft(samples[start : start + 512] * window)[:257]
        )
        rows.append(np.log(np.where(bands == 0, 1e-6, bands)))
    whole = log_mel_400(speech.samples)
    assert whole.shape == (len(rows), 64) == (log_mel_count(2.0), len(LOG_MEL_NAMES))
    np.testing.assert_allclose(whole, rows, atol=1e-9)
    assert (whole == np.log(1e-6)).all(1).sum() > 20, "of nothing at all"
    last = np.minimum(np.floor(np.arange(30) * 100 / 15).astype(int), len(whole) - 1)
    np.testing.assert_array_equal(push_pieces(speech, 15.0), whole[last].astype(np.float32))


def test_triangles_and_spectra_of_short_sounds():
    assert log_mel_400(np.zeros(0, np.float32)).shape == log_mel_400(np.ones(3, np.float32)).shape == (1, 64)
    assert spectra(np.ones(100), 512, 160, 400, centred=False).shape == (1, 257)
    tall = mel_triangles(16_000, 512, 64, 125.0, 7500.0, False)
    bins = np.arange(257) * 31.25
    assert tall.max() <= 1
    assert not tall[:, (bins <= 125) | (bins >= 7500)].any()
    assert np.allclose(mel_triangles(16_000, 400, 20, 0.0, 8000.0, True).sum(1) * 40, 1, atol=0.15), "areas of 1"


def test_rows_come_on_time():
    """A row comes as soon as the sound up to 32 ms after its frame's time has come, and not before its spectrum is whole."""
    speech, stream, given_ = voice(2.0), LogMelFeatures(15.0), 0
    for end in range(160, len(speech) + 1, 160):
        given_ += len(stream.push(Speech(speech.samples[end - 160 : end])))
        seconds = end / 16_000
        assert given_ >= np.floor((seconds - stream.delay) * 15 + 1e-9) + 1
        assert given_ == 0 or log_mel_at(np.array(given_ - 1), 15.0) * 160 + 512 <= end
    assert stream.delay == 0.032


def test_little_is_kept_of_long_speech():
    stream, piece = LogMelFeatures(15.0), voice(10.0)
    for _ in range(12):
        stream.push(piece)
        assert len(stream._data) <= 2 * 1067 + 512


def test_bad_use():
    stream = LogMelFeatures(15.0)
    stream.push(voice(0.5))
    with pytest.raises(InputError, match="16000 Hz"):
        stream.push(voice(0.5, 8000))
    assert len(stream.finish()) + stream._next >= 8
    assert len(stream.finish()) == 0
    with pytest.raises(InputError, match="over"):
        stream.push(voice(0.5))
    with pytest.raises(InputError, match="frames per second"):
        LogMelFeatures(0.0)
    assert LogMelFeatures(15).finish().shape == (0, 64)
    assert LogMelFeatures(15).finish(3).tolist() == np.full((3, 64), np.float32(np.log(1e-6))).tolist()


def test_names_of_audio_choose_the_front_end():
    assert isinstance(open_features("log-mel-400", 15.0), LogMelFeatures)
    assert isinstance(open_features("mel64", 15.0), FrameFeatures)
    rows = push_pieces(voice(0.5), 15.0)
    np.testing.assert_array_equal(reduce_audio(rows, "log-mel-400"), rows)
    with pytest.raises(InputError, match=r"'log-mel-400' is made of \(frames, 64\)"):
        reduce_audio(np.zeros((2, 84), np.float32), "log-mel-400")
    with pytest.raises(InputError, match=r"'mel64' is made of \(frames, 84\)"):
        reduce_audio(rows, "mel64")
    with pytest.raises(InputError, match="no reduction"):
        open_features("log-mel", 15.0)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [16_000, 44_100])
@pytest.mark.parametrize("seconds", [4.0, 11.4])
def test_a_store_of_pats_has_what_the_front_end_hears(tmp_path: Path, rate: int, seconds: float):
    """A store that is prepared from PATS' files has the rows that the front-end gives of the same waveform.

    At 16 kHz the bits are the same. At other rates the resampler works in pieces here and in one there: rows differ by a
    few 1e-4 where there is sound, and by its rounding where there is none.
    """
    pytest.importorskip("h5py", reason="PATS' reader needs cospeech[corpora]")
    from cospeech.corpora import Clip
    from cospeech.corpora.pats import read as pats
    from cospeech.corpora.prepare import prepare
    from cospeech.corpora.store import Store
    from cospeech.motion.points import Points

    rng, frames = np.random.default_rng(0), round(seconds * 15)
    values = np.cumsum(rng.normal(0, 2, (frames, 52, 2)), 0) + rng.normal(0, 150, (52, 2))
    values[:, 1] = values[:, 0] + [-166, 1]
    speech = voice(seconds, rate)
    pats.write([Clip("1", "oliver", "made", speech, points=Points(15.0, values, "pats"))], tmp_path / "raw")
    prepare("pats", tmp_path / "raw", tmp_path / "store")
    store = Store(tmp_path / "store")
    assert store.names["audio"] == LOG_MEL_NAMES
    stored_rows, live_rows = store.clip(store.clips[0])["audio"], push_pieces(speech, 15.0, [5, 7000, 40_000])
    assert stored_rows.shape == live_rows.shape == (frames, 64)
    if rate == 16_000:
        np.testing.assert_array_equal(stored_rows, live_rows)
    else:
        loud = stored_rows > -7
        assert loud.mean() > 0.5
        np.testing.assert_allclose(live_rows[loud], stored_rows[loud], atol=1e-3)
