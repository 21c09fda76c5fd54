"""Voices that act: each part does to the sound what it says, words stay with it, and the emotions differ as the reviews say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import soundfile

from cospeech.audio.features import analyse
from cospeech.audio.speech import Speech, Word
from cospeech.audio.speech import example as example_files
from cospeech.corpora.synthetic.acting import ACTING, LEVEL, Acting, Actor, act
from cospeech.rules import EMOTIONS

RATE = 16_000


def vowel(pitch: np.ndarray, seconds: float) -> np.ndarray:
    """A buzz whose harmonics have two formants, 700 and 1200 Hz, at the pitch of each instant (Hz, evenly over the time)."""
    t = np.arange(round(seconds * RATE)) / RATE
    f = np.interp(t, np.linspace(0, seconds, len(pitch)), pitch)
    phase = 2 * np.pi * np.cumsum(f) / RATE
    out = np.zeros(len(t))
    for k in range(1, 40):
        strength = sum(1 / (1 + ((k * f - centre) / 120) ** 2) for centre in (700, 1200)) + 0.02
        out += np.where(k * f < 7000, strength, 0) * np.cos(k * phase)
    return (0.1 * out).astype(np.float32)


def strongest_harmonic_pitch(samples: np.ndarray) -> float:
    """Hz, by the first high peak of the autocorrelation of the whole (no code of ours)."""
    spectrum = np.abs(np.fft.rfft(samples, 1 << 18)) ** 2
    lags = np.fft.irfft(spectrum)[: RATE // 60]
    first = RATE // 500
    high = first + int(np.flatnonzero(lags[first:] > 0.9 * lags[first:].max())[0])
    return RATE / (high + int(np.argmax(lags[high : high + 8])))


@pytest.fixture(scope="module")
def example():
    samples, rate = soundfile.read(example_files()[0], dtype="float32")
    words = tuple(Word(f"w{k}", k + 0.25, k + 0.75) for k in range(9))
    return Speech(samples[: 10 * rate], rate, words)


@pytest.mark.parametrize("pitch", [100.0, 210.0])
@pytest.mark.parametrize("semitones", [-3.0, 0.0, 4.0])
def test_pitch_goes_where_it_shall_and_formants_stay(pitch, semitones):
    speech = act(Speech(vowel(np.array([pitch]), 2.0)), Acting(pitch=semitones), 0)
    middle = speech.samples[RATE // 2 : -RATE // 2]
    assert 12 * np.log2(strongest_harmonic_pitch(middle) / pitch) == pytest.approx(semitones, abs=0.35)
    if pitch > 150:
        return  # harmonics too far apart to tell formants by
    smooth = np.convolve(np.abs(np.fft.rfft(middle)), np.ones(301), "same")
    hz = np.fft.rfftfreq(len(middle), 1 / RATE)
    low = hz[(hz > 400) & (hz < 950)][np.argmax(smooth[(hz > 400) & (hz < 950)])]
    assert low == pytest.approx(700, abs=pitch / 2)  # harmonics are no nearer than that
    assert len(speech) == 2 * RATE


def test_range_of_pitch():
    """A glide of an octave about its middle comes out as half an octave, or one and a half."""
    glide = Speech(vowel(150 * 2 ** np.linspace(-0.5, 0.5, 50), 3.0))
    for span in (0.5, 1.5):
        pitch = analyse(act(glide, Acting(span=span), 0)).pitch[20:-20]
        voiced = pitch > 0
        slope = np.polyfit(np.arange(len(pitch))[voiced] / 100, np.log2(pitch[voiced]), 1)[0]
        assert slope * 3 == pytest.approx(span, rel=0.1)


@pytest.mark.parametrize(("rate", "pauses"), [(0.8, 1.0), (1.25, 1.0), (1.0, 2.0), (0.8, 1.8), (1.2, 0.6)])
def test_words_stay_with_their_sound(rate, pauses):
    """Bursts between silences: they begin and end where the words say, and last as long as was asked."""
    burst, gap = vowel(np.array([120.0]), 0.4), np.zeros(round(0.5 * RATE), np.float32)
    samples = np.concatenate([gap, *[part for _ in range(4) for part in (burst, gap)]])
    words = tuple(Word(f"w{k}", 0.5 + 0.9 * k, 0.9 + 0.9 * k) for k in range(4))
    speech = act(Speech(samples, RATE, words), Acting(rate=rate, pauses=pauses), 0)
    assert [word.text for word in speech.words] == [word.text for word in words]
    assert float(speech.duration) == pytest.approx(
        4 * 0.4 / rate + 5 * 0.5 * pauses / rate, abs=0.08 * abs(pauses - 1) * 9 + 0.01
    )
    loud = np.convolve(np.square(speech.samples), np.ones(160) / 160, "same") > 1e-5
    edges = np.flatnonzero(np.diff(np.concatenate([[0], loud.astype(int), [0]])))
    np.testing.assert_allclose(edges[::2] / RATE, [word.start for word in speech.words], atol=0.03)
    np.testing.assert_allclose(edges[1::2] / RATE, [word.end for word in speech.words], atol=0.03)


@pytest.mark.slow
def test_loudness_and_tilt(example):
    def powers(acting: Acting) -> tuple[float, np.ndarray]:
        samples = act(example, acting, 0).samples.astype(float)
        spectrum = np.abs(np.fft.rfft(samples)) ** 2
        hz = np.fft.rfftfreq(len(samples), 1 / RATE)
        bands = [spectrum[(hz >= low) & (hz < high)].sum() for low, high in ((60, 250), (4000, 8000))]
        return 10 * np.log10(np.mean(samples**2)), 10 * np.log10(bands)

    plain, bands = powers(Acting())
    assert plain == pytest.approx(LEVEL, abs=4)  # pauses count here
    assert powers(Acting(gain=5.0))[0] - plain == pytest.approx(5, abs=0.2)
    for tilt in (-6.0, 6.0):
        level, now = powers(Acting(tilt=tilt))
        assert level == pytest.approx(plain, abs=0.3)  # brighter is not louder
        assert np.subtract(*(now - bands)[::-1]) == pytest.approx(tilt, abs=0.8)


@pytest.mark.slow
def test_dynamics_and_jitter(example):
    def energy(acting: Acting) -> np.ndarray:
        return np.convolve(analyse(act(example, acting, 0)).energy, np.full(20, 0.05), "valid")

    plain = energy(Acting())
    spoken = plain > np.percentile(plain, 95) - 15
    for dynamics in (0.6, 1.5):
        slope = np.polyfit(plain[spoken], energy(Acting(dynamics=dynamics))[spoken], 1)[0]
        assert slope == pytest.approx(dynamics, abs=0.2)
    steady = Speech(vowel(np.array([130.0]), 2.0))

    def harmonicity(jitter: float) -> float:
        x = act(steady, Acting(jitter=jitter), 0).samples[3200:-3200].astype(float)
        lag = round(RATE / 130)
        return max(float(np.corrcoef(x[:-k], x[k:])[0, 1]) for k in range(lag - 2, lag + 3))

    assert harmonicity(0.0) > 0.97 > 0.93 > harmonicity(0.03)


def test_nothing_but_noise_or_silence_survives():
    for samples in (np.zeros(0), np.zeros(8000), np.full(100, 1e-4)):
        speech = act(Speech(samples.astype(np.float32)), ACTING["anger"], 0)
        assert np.isfinite(speech.samples).all()
        assert np.abs(speech.samples).max(initial=0.0) < 0.01


@pytest.mark.slow
def test_the_emotions_differ_as_the_reviews_say(example):
    """Measured on the sound: which emotions are faster, higher, wider, louder, brighter than neutral."""
    rows = {}
    for emotion in EMOTIONS:
        speech = act(example, ACTING[emotion], 0)
        assert np.abs(speech.samples).max() < 1
        features = analyse(speech)
        voiced, loud = np.log2(features.pitch[features.pitch > 0]), features.energy > np.percentile(features.energy, 95) - 30
        rows[emotion] = (
            float(example.duration) / float(speech.duration), np.median(voiced), np.subtract(*np.percentile(voiced, [90, 10])),
            features.energy[loud].mean(), (features.bands[loud, 3:].mean(1) - features.bands[loud, 1]).mean(),
        )  # fmt: skip
    signs = {e: np.sign(np.subtract(rows[e], rows["neutral"])).astype(int).tolist() for e in EMOTIONS}
    faster, higher, wider, louder, _ = range(5)
    assert signs["happiness"] == signs["anger"] == [1, 1, 1, 1, 1]
    assert signs["sadness"] == [-1, -1, -1, -1, -1]
    assert signs["fear"] == [1, 1, -1, -1, -1]
    assert [signs["surprise"][k] for k in (higher, wider)] == [1, 1]
    for emotion in ("contempt", "disgust"):
        assert [signs[emotion][k] for k in (faster, higher, louder)] == [-1, -1, -1]


def test_speakers_act_in_their_own_way_and_no_take_is_like_another():
    takes = {(who, seed): Actor(0, who).acting("anger", seed) for who in range(6) for seed in range(20)}
    assert takes[2, 3] == Actor(0, 2).acting("anger", 3)
    assert len(set(takes.values())) == len(takes)
    means = np.array(
        [[np.mean([getattr(takes[who, seed], part) for seed in range(20)]) for part in ("rate", "tilt")] for who in range(6)]
    )
    within = np.std([takes[0, seed].tilt for seed in range(20)])
    assert np.std(means[:, 1]) > 0.5 * within / np.sqrt(20)  # more than what chance leaves of the takes
    assert (means[:, 0] > 1.03).all()
    assert (means[:, 1] > 2).all()
    plain = [Actor(0, who).acting("neutral", seed).rate for who in range(6) for seed in range(20)]
    assert np.mean(plain) == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("emotion", ["neutral", "anger", "sadness", "fear", "disgust"])
def test_the_words_are_still_there(emotion, example):
    """In each band the acted sound is like the plain sound at the same moment of the speech, and unlike it at another."""
    acting = replace(ACTING[emotion], pauses=1.0)
    speech = act(example, acting, 0)
    rate = len(example.samples) / len(speech.samples)
    plain, now = analyse(example).bands, analyse(speech).bands
    loud = np.flatnonzero(plain.mean(1) > np.percentile(plain.mean(1), 40))
    at = np.minimum(np.round(loud / rate).astype(int), len(now) - 1)

    def alike(shift: int) -> float:
        other = now[np.clip(at + shift, 0, len(now) - 1)]
        return float(np.mean([np.corrcoef(plain[loud, k], other[:, k])[0, 1] for k in range(plain.shape[1])]))

    assert alike(0) > 0.8
    assert alike(50) < 0.5
