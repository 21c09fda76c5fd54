"""What we compute of sound against librosa. One file has it all: librosa compiles itself for half a minute first."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.features import analyse, log_mel
from cospeech.audio.features.log_mel import log_mel_400
from cospeech.audio.features.mel import mel_filters
from cospeech.audio.speech import Speech, example
from cospeech.corpora.ted.write import _audio_feat
from cospeech.metrics.onsets import backtrack, onset_frames, onset_strength, onset_times, rms

pytestmark = pytest.mark.slow
librosa = pytest.importorskip("librosa", reason="needs librosa, to compare with")
RATE = 16_000


@pytest.fixture(scope="module")
def speech() -> Speech:
    return Speech.load(example()[0])


@pytest.mark.parametrize("n_mels", [40, 80, 128])
def test_mel_filters(n_mels):
    np.testing.assert_allclose(mel_filters(n_mels), librosa.filters.mel(sr=RATE, n_fft=400, n_mels=n_mels), atol=1e-8)


def test_log_mel(speech):
    theirs = librosa.feature.melspectrogram(y=speech.samples, sr=RATE, n_fft=400, hop_length=160, n_mels=80)
    np.testing.assert_allclose(log_mel(speech.samples), np.log(np.maximum(theirs.T, 1e-10)), atol=1e-4)


def test_log_mel_of_pats(speech):
    """Its reader and writer use the same function (tests/corpora/test_pats.py)."""
    part = speech.window(2, 5)
    short = np.abs(librosa.stft(part.samples, n_fft=512, hop_length=160, win_length=400, center=False))
    bands = librosa.feature.melspectrogram(S=short, sr=RATE, n_fft=512, power=1, n_mels=64, fmin=125, fmax=7500, norm=None)
    np.testing.assert_allclose(log_mel_400(part.samples), np.log(np.where(bands == 0, 1e-6, bands)).T, atol=1e-3)


def test_audio_feat_of_ted(speech):
    samples = speech.window(2, 6).samples
    power = librosa.feature.melspectrogram(y=samples, sr=RATE, n_fft=1024, hop_length=512, power=2, pad_mode="reflect")
    assert np.abs(_audio_feat(samples) - librosa.power_to_db(power, ref=np.max)).max() < 0.05


def pitch_differences(speech: Speech) -> np.ndarray:
    """Our pitch over librosa's YIN, less one, where we are sure of a voice and YIN is steady (at edges it jumps)."""
    ours = analyse(speech)
    yin = librosa.yin(speech.samples, fmin=60, fmax=500, sr=RATE, frame_length=1024, hop_length=160)[: len(ours)]
    rise = np.abs(np.diff(np.log(yin), prepend=np.log(yin[0]), append=np.log(yin[-1])))
    steady = np.maximum(rise[:-1], rise[1:]) < 0.08
    sure = (ours.voicing > 0.9) & (ours.energy > ours.energy.max() - 25) & steady
    assert sure.mean() > 0.2
    return np.abs(ours.pitch / yin - 1)[sure]


def test_pitch_agrees_with_yin(speech):
    off = pitch_differences(speech)
    assert np.median(off) < 0.01
    assert (off > 0.2).mean() < 0.02


def test_pitch_agrees_with_yin_on_people(shared_folder):
    for name in ("jfk/jfk", "ljspeech/LJ001-0002", "a2f_emotional/Claire_anger", "speechbrain/ASR_spk1_snt1"):
        off = pitch_differences(Speech.load(shared_folder / "data" / "speech" / f"{name}.flac"))
        assert np.median(off) < 0.02, name
        assert (off > 0.2).mean() < 0.03, name


@pytest.mark.parametrize("rate", [16000, 22050])
def test_onsets(rate):
    samples = Speech.load(example()[0], rate=rate).samples
    strength, theirs = onset_strength(samples, rate), librosa.onset.onset_strength(y=samples, sr=rate)
    np.testing.assert_allclose(strength, theirs, atol=1e-4)
    onsets = librosa.onset.onset_detect(y=samples, sr=rate)
    assert len(onsets) > 30
    np.testing.assert_array_equal(onset_frames(strength, rate), onsets)
    np.testing.assert_allclose(onset_times(samples, rate), librosa.frames_to_time(onsets, sr=rate))
    energy = librosa.feature.rms(y=samples)[0]
    np.testing.assert_allclose(rms(samples), energy, atol=1e-6)
    np.testing.assert_array_equal(backtrack(onsets, rms(samples)), librosa.onset.onset_backtrack(onsets, energy))


def test_hann_weighted_rms_is_that_of_an_stft(speech):
    theirs = librosa.feature.rms(S=np.abs(librosa.stft(y=speech.samples)))[0]
    np.testing.assert_allclose(rms(speech.samples, hann=True), theirs, atol=1e-6)
