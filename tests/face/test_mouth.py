"""Faces that speak with a learnt mouth: what a bundle of faces gives, in pieces as in one, and what a face makes of it."""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np
import pytest

from cospeech import models
from cospeech.audio.features.reduce import open_features as hear_columns
from cospeech.audio.features.reduce import reduce_audio
from cospeech.audio.speech import Speech, Word
from cospeech.cli.demo import EXAMPLE
from cospeech.errors import InputError
from cospeech.face.composition import Face
from cospeech.face.expressions import IS_MOUTH
from cospeech.face.gains import face_gains
from cospeech.motion.motion import Motion
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from cospeech.rules import RuleBasedModel
from cospeech.rules.foresight import LOOK_AHEAD, MOUTH_WAITS
from cospeech.runtime import mouth as mouths
from cospeech.runtime.mouth import BundleMouth, choose_layout, open_mouth
from tests.face.test_face import EMOTIONS, act, channel, hear, opening, silence, speech
from tests.support.runtime_bundles import NAMES, write_small_window

RATE = 16_000


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    """A face of random weights, at 60 frames a second."""
    return write_small_window(tmp_path_factory.mktemp("face") / "face.cospeech", pose="face", fps=60.0)


@pytest.fixture(scope="module")
def system(bundle):
    return open_mouth(bundle)


def sound(seconds: float) -> np.ndarray:
    return np.resize(Speech.load(EXAMPLE).samples, round(seconds * RATE))


def run_mouth(system, samples, cuts=(), times=None) -> np.ndarray:
    mouth = BundleMouth(system)
    for piece in np.split(samples, cuts):
        mouth.push(piece)
    mouth.finish()
    return mouth.at(np.arange(0, len(samples) / RATE, 1 / 30) if times is None else times)


@pytest.mark.slow
@pytest.mark.parametrize("cut", [77, 160, 3201, 40_000])
def test_the_same_bits_however_speech_is_cut(system, cut):
    samples = sound(5.3)
    whole = run_mouth(system, samples)
    assert whole.shape == (159, 52)
    assert whole.std(0).max() > 0.02
    assert np.array_equal(run_mouth(system, samples, np.arange(cut, len(samples), cut)), whole)


def test_it_says_what_the_network_says(system, monkeypatch):
    """The whole speech at once, by hand: features, the network, its mean and spread, smoothing, weights of 0 … 1.

    Level control, which would raise a weak first word, is off.
    """
    monkeypatch.setattr("cospeech.audio.level_control.USUAL", -200.0)
    samples, s, network = sound(3.0), system.statistics, system.networks["make"]
    ears = hear_columns(system.audio, system.fps)
    columns = np.concatenate([ears.push(Speech(samples)), ears.finish()])
    ears = hear_columns(system.audio, system.fps)
    silence = np.concatenate([ears.push(Speech(np.zeros(RATE, np.float32))), ears.finish()])[:1]
    columns = np.concatenate([np.repeat(silence, 40, 0), columns, np.repeat(silence, 40, 0)])
    rows = np.clip((reduce_audio(columns, system.audio) - s.audio_mean) / s.audio_std, s.audio_low, s.audio_high)
    who = system.styles.index(system.style)
    codes = np.broadcast_to(s.style_codes[who], (1, len(rows), len(NAMES)))
    poses = network.run(rows=rows[None], style=codes)["poses"][0, 40:-40]
    n = system.smooth
    padded = np.concatenate([np.repeat(poses[:1], n, 0), poses, np.repeat(poses[-1:], n, 0)])
    smooth = sum(comb(2 * n, k) / 4**n * padded[k : k + len(poses)] for k in range(2 * n + 1))
    expected = (s.speaker_mean[who] + s.style_gain[who] * (smooth - s.model_mean[who])) * s.pose_std + s.pose_mean
    assert np.allclose(run_mouth(system, samples, times=np.arange(180) / 60), np.clip(expected[:, :52], 0, 1), atol=2e-5)


def test_between_frames_it_is_linear_and_after_the_end_it_stays(system):
    samples = sound(2.0)
    frames = run_mouth(system, samples, times=np.arange(120) / 60)
    times = np.random.default_rng(0).uniform(0, 3.0, 500)
    times.sort()
    expected = np.stack([np.interp(times * 60, np.arange(120), column) for column in frames.T], 1)
    assert np.abs(run_mouth(system, samples, times=times) - expected).max() < 1e-6
    assert run_mouth(system, samples, times=np.zeros(0)).shape == (0, 52)


@pytest.mark.slow
def test_it_waits_less_than_a_face_and_says_so(system):
    mouth, samples = BundleMouth(system), sound(6.0)
    assert mouth.latency < MOUTH_WAITS < LOOK_AHEAD
    behind = []
    for k in range(0, len(samples), 100):
        mouth.push(samples[k : k + 100])
        behind.append((k + 100) / RATE - mouth.certain_until)
    assert max(behind[200:]) <= mouth.latency + 100 / RATE
    assert max(behind[200:]) > mouth.latency - 0.05  # and the latency that it states is not larger than it needs
    with pytest.raises(RuntimeError, match="known until"):
        mouth.at(np.array([mouth.certain_until + 0.1]))
    with pytest.raises(InputError, match=r"needs 1\.[4-9]"):
        BundleMouth(replace(system, smooth=60))


@pytest.mark.slow
def test_it_forgets_what_is_past(system):
    mouth, sizes, at = BundleMouth(system), [], 0
    for samples in np.split(sound(60.0), 120):
        mouth.push(samples)
        until = max(int(mouth.certain_until * 30), at)
        mouth.at(np.arange(at, until) / 30)
        at = until
        sizes.append(len(mouth._weights) + len(mouth._resampler._poses[0]) + len(mouth._decoder._windows._rows))
    assert at > 58 * 30
    assert max(sizes[20:]) == max(sizes[60:]) < 200


def test_windows_hold_what_matters_to_the_network(system):
    sizes = system.main_network.signature
    exact = choose_layout(sizes, 60.0)
    assert exact.ahead >= sizes.reach <= exact.past
    assert exact.fade == 0
    far = choose_layout(replace(sizes, reach=None), 60.0)
    assert (far.ahead, far.waits <= far.window, far.window % sizes.multiple) == (30, True, 0)
    assert far.fade > 0


@pytest.mark.slow
def test_what_is_no_face_is_refused(tmp_path, bundle, monkeypatch):
    body = write_small_window(tmp_path / "body.cospeech")
    with pytest.raises(InputError, match="expmap-humanoid"):
        open_mouth(body)
    cut_off = tmp_path / "broken.cospeech"
    cut_off.write_bytes(bundle.read_bytes()[:-1000])
    for path, problem in ((cut_off, "broken"), (tmp_path / "nothing.cospeech", "nothing.cospeech")):
        monkeypatch.setattr(mouths, "SHIPPED_FACE", path)
        mouths._open_default.cache_clear()
        with pytest.raises(InputError, match=problem):
            RuleBasedModel(mouths.open_default_mouth).generate(Speech(sound(1.0)))
    RuleBasedModel(mouths.open_default_mouth).generate(Speech(sound(1.0)), parts=("body",))  # which needs no mouth
    mouths._open_default.cache_clear()


class ConstantMouth:
    """A mouth that says the same all the time."""

    def __init__(self, row):
        self.row = row

    def push(self, samples):
        assert samples.dtype == np.float32

    def finish(self):
        pass

    def at(self, times):
        return np.tile(self.row, (len(times), 1))


def row(**weights) -> np.ndarray:
    result = np.zeros(52)
    for name, value in weights.items():
        result[ARKIT_INDEX[name]] = value
    return result


def test_a_face_takes_the_mouth_and_keeps_the_rest():
    voice, accents = speech(8)
    times = np.arange(240) / 30
    face = Face(seed=3)
    own = act(face, times, voice, accents=accents, emotion="happiness")
    spoken = np.random.default_rng(1).uniform(0.2, 1, (240, 52))  # lips that are open: those that all but touch are closed
    with_mouth = act(face, times, voice, accents=accents, emotion="happiness", spoken=spoken)
    assert np.array_equal(own[:, ~IS_MOUTH], with_mouth[:, ~IS_MOUTH])
    assert with_mouth.min() >= 0
    assert with_mouth.max() <= 1
    assert (channel(with_mouth, "mouthClose") <= channel(with_mouth, "jawOpen") + 1e-12).all()
    talking = voice.at(times, voice.loudness) > 0.5
    for name in ("jawOpen", "mouthFunnel", "mouthPucker"):  # which happiness leaves alone
        assert np.allclose(channel(with_mouth, name)[talking], channel(spoken, name)[talking], atol=0.05)
    smile = channel(with_mouth, "mouthSmileLeft") - channel(act(face, times, voice, spoken=spoken), "mouthSmileLeft")
    assert smile.mean() > 0.1  # expression comes on top


def test_it_stays_shut_in_silence_whatever_the_mouth_says():
    gaping = np.ones((300, 52))
    for emotion in set(EMOTIONS) - {"surprise"}:  # its jaw drops
        weights = act(Face(seed=1), np.arange(300) / 30, silence(10), emotion=emotion, spoken=gaping)
        assert channel(weights, "jawOpen").max() < 0.03
        assert np.array_equal(weights, act(Face(seed=1), np.arange(300) / 30, silence(10), emotion=emotion))
    loud = np.zeros(600)
    loud[200:400] = 0.9
    jaw = channel(act(Face(seed=1), np.arange(600) / 100, hear(loud), spoken=np.ones((600, 52))), "jawOpen")
    assert max(jaw[:160].max(), jaw[440:].max()) < 0.03
    assert jaw[195:405].min() > 0.9  # never late for a phrase


@pytest.mark.parametrize("emotion", EMOTIONS)
def test_words_close_the_lips_of_a_learnt_mouth(emotion):
    words = [Word("papa", 0.5, 0.94), Word("mama", 1.0, 1.44)]
    times, spoken = np.arange(180) / 60, np.tile(row(jawOpen=0.4, mouthLowerDownLeft=0.3, mouthLowerDownRight=0.3), (180, 1))
    voice = hear(np.full(300, 0.9))
    given = {"emotion": emotion, "spoken": spoken}
    without, closed = (opening(act(Face(seed=2), times, voice, words=w, **given)) for w in ((), words))
    within = (times > 0.45) & (times < 1.44)
    assert without[within].min() > 0.3
    dips = (closed[1:-1] < 0.05) & (closed[1:-1] <= closed[:-2]) & (closed[1:-1] < closed[2:])
    assert dips.sum() == 4  # two p, two m
    assert closed[within].max() > 0.3
    far = (times < 0.2) | (times > 1.75)
    assert np.allclose(without[far], closed[far], atol=1e-6)


def test_words_shape_the_lips_of_a_learnt_mouth_but_not_its_jaw():
    voice, times = hear(np.full(300, 0.85)), np.arange(60, 110) / 100
    spoken = np.tile(row(jawOpen=0.2, mouthPucker=0.1), (50, 1))

    def most(word, name):
        return channel(act(Face(seed=1), times, voice, words=[Word(word, 0.6, 1.1)], spoken=spoken), name).max()

    assert most("woo", "mouthPucker") > 0.4 > 0.2 > most("see", "mouthPucker") >= 0.09
    assert most("fife", "mouthRollLower") > 0.25
    assert most("thin", "tongueOut") > 0.1
    assert most("father", "jawOpen") == pytest.approx(most("see", "jawOpen"), abs=1e-9)


@pytest.mark.slow
def test_a_performance_with_a_mouth_is_the_same_in_pieces(system):
    talk = Speech(np.resize(Speech.load(EXAMPLE).samples, 8 * RATE))
    gesturer = RuleBasedModel(lambda: BundleMouth(system))
    whole = gesturer.generate(talk, seed=2)
    pieces = Motion.concatenate(list(gesturer.stream(talk.chunks(0.13), seed=2)))
    assert np.allclose(whole.face, pieces.face, atol=1e-6)
    assert np.allclose(whole.rotations, pieces.rotations, atol=1e-6)
    own = RuleBasedModel().generate(talk, seed=2)
    assert np.array_equal(own.rotations, whole.rotations)  # the mouth does not change the body
    assert np.array_equal(own.face[:, ~IS_MOUTH], whole.face[:, ~IS_MOUTH])
    assert np.abs(own.face - whole.face).max() > 0.1
    for times in (2, 5):  # a function of time, whatever the rate
        other = gesturer.generate(talk, seed=2, fps=30.0 * times)
        assert np.allclose(other.face[::times], whole.face, atol=1e-5)
    with pytest.raises(InputError, match="no speech"):
        gesturer.generate(Speech(np.zeros(0, np.float32)))


@pytest.mark.slow
def test_speech_of_another_rate_reaches_the_mouth_at_16_khz():
    lengths = []

    class Counting(ConstantMouth):
        def push(self, samples):
            lengths.append(len(samples))

    talk = Speech(np.resize(Speech.load(EXAMPLE).samples, 3 * 48_000), 48_000)
    RuleBasedModel(lambda: Counting(row())).generate(talk)
    assert sum(lengths) == 3 * RATE


def test_gains_are_read():
    both = [ARKIT_INDEX["mouthSmileLeft"], ARKIT_INDEX["mouthSmileRight"]]
    plain = face_gains(1.2)
    assert set(plain[IS_MOUTH]) == {1.2}
    assert set(plain[~IS_MOUTH]) == {1.0}
    assert np.array_equal(face_gains("1.2"), plain)
    text = face_gains("1.2, jawOpen:0.8 ,mouthSmile:0.5,browInnerUp:2")
    assert np.array_equal(text, face_gains("mouthSmile:0.5,browInnerUp:2,jawOpen:0.8,1.2"))
    assert list(text[both]) == [0.5, 0.5]
    assert text[ARKIT_INDEX["jawOpen"]] == 0.8
    assert text[ARKIT_INDEX["browInnerUp"]] == 2
    assert text[ARKIT_INDEX["mouthFunnel"]] == 1.2
    gains = face_gains({"jawOpen": 0.8, "mouthSmileLeft": 0})
    assert np.array_equal(np.flatnonzero(gains != 1), sorted([ARKIT_INDEX["jawOpen"], both[0]]))
    assert np.array_equal(face_gains("eyeBlink:0"), face_gains({"eyeBlinkLeft": 0, "eyeBlinkRight": 0}))


@pytest.mark.parametrize(
    ("gain", "match"),
    [
        ("jawOpn:1", "jawOpen"), ("mouthsmile:1", "mouthSmile"), ("jaw:1", "no channel"), ("mouth:1", "no channel"),
        (2.1, "0 … 2"), (-0.1, "0 … 2"), (float("nan"), "0 … 2"), (True, "0 … 2"), (None, "0 … 2"), ("", "0 … 2"),
        ("jawOpen:", "0 … 2"), ("jawOpen:much", "much"), ("1.2,", "0 … 2"), ({"jawOpen": "1"}, "0 … 2"), ([1.0], "0 … 2"),
        ({"nobody": 1.0}, "nobody"), ("1e999", "0 … 2"), ({3: 1.0}, "no channel"),
    ],
)  # fmt: skip
def test_gains_that_are_none(gain, match):
    with pytest.raises(InputError, match=match):
        face_gains(gain)
    with pytest.raises(InputError):
        RuleBasedModel().session(face_gain=gain)


@pytest.mark.slow
def test_gains_scale_the_final_face():
    talk = Speech(np.resize(Speech.load(EXAMPLE).samples, 6 * RATE))

    def face(gain=1.0):
        options = {"face_gain": gain, "parts": ("face",), "emotion": "happiness", "seed": 4}
        return (
            RuleBasedModel(lambda: ConstantMouth(row(jawOpen=0.3, mouthFunnel=0.8, mouthClose=0.1)))
            .generate(talk, **options)
            .face
        )

    usual, close, jaw = face(), ARKIT_INDEX["mouthClose"], ARKIT_INDEX["jawOpen"]
    others = np.arange(52) != close
    for gain in (0.0, 0.5, 2.0, "1.5,jawOpen:0.5,mouthSmile:2,browInnerUp:0"):
        expected = np.clip(usual * face_gains(gain), 0, 1)
        got = face(gain)
        assert np.allclose(got[:, others], expected[:, others], atol=1e-6)
        assert np.allclose(got[:, close], np.minimum(expected[:, close], expected[:, jaw]), atol=1e-6)
    assert not face(0.0)[:, IS_MOUTH].any()
    assert face(2.0).max() == 1
    assert list(ARKIT[k] for k in np.flatnonzero((face("mouthFunnel:0.9") != usual).any(0))) == ["mouthFunnel"]


@pytest.mark.slow
def test_every_system_speaks_with_the_mouth_that_ships(monkeypatch):
    speech = Speech(np.resize(Speech.load(EXAMPLE).samples, 3 * RATE))
    of_rules = models.load("rules").generate(speech, seed=1, emotion="neutral")
    assert np.abs(of_rules.face - RuleBasedModel().generate(speech, seed=1, emotion="neutral").face)[:, IS_MOUTH].max() > 0.05
    for name in ("stylised-flow", "mix-stage"):
        motion = models.load(name).generate(speech, seed=1, emotion="neutral", fps=30.0)
        assert np.array_equal(motion.face[:, IS_MOUTH], of_rules.face[:, IS_MOUTH])
        differ = {ARKIT[k] for k in np.flatnonzero((motion.face != of_rules.face).any(0))}
        assert differ  # each system looks from its own head, and the rules raise brows with their own strokes
        assert all(name.startswith(("eyeLook", "eyeBlink", "eyeWide", "brow")) for name in differ)
        with_gain = models.load(name).generate(speech, seed=1, emotion="neutral", face_gain="jawOpen:0,mouthClose:0")
        assert not with_gain.face[:, ARKIT_INDEX["jawOpen"]].any()
        with pytest.raises(InputError, match="jawOpen"):
            models.load(name).session(face_gain="jawopen:1")

    def missing():
        raise InputError("no mouth", "none")

    monkeypatch.setattr(mouths, "_open_default", missing)
    for name in ("rules", "stylised-flow", "mix-stage"):
        with pytest.raises(InputError, match="no mouth"):
            models.load(name).generate(speech)
        assert models.load(name).generate(speech, parts=("body",)).face is None


@pytest.mark.slow
def test_the_mouth_that_ships_opens_for_vowels_and_rests():
    speech = Speech.load(EXAMPLE)
    face = models.load("rules").generate(speech, emotion="neutral", fps=60.0).face
    jaw = face[:, ARKIT_INDEX["jawOpen"]]
    columns = np.array([np.square(speech.window(k / 60, (k + 1) / 60).samples).mean() for k in range(len(face) - 1)])
    loud = np.log10(columns + 1e-8)
    assert np.corrcoef(jaw[1:], loud)[0, 1] > 0.4
    assert jaw.max() > 0.15
    assert np.abs(np.diff(jaw)).max() * 60 < 12  # a weight per second: jaws are heavy
    still = models.load("rules").generate(Speech(np.zeros(3 * RATE, np.float32)), emotion="neutral").face
    assert still[:, ARKIT_INDEX["jawOpen"]].max() < 0.01


@pytest.mark.slow
def test_the_command_takes_gains(tmp_path):
    from typer.testing import CliRunner

    from cospeech.cli.main import app

    def face(*line):
        out = tmp_path / "a.npz"
        result = CliRunner().invoke(app, ["generate", str(EXAMPLE), "-o", str(out), "-q", "--parts", "face", *line])
        return result.exception if result.exit_code else Motion.load(out).face

    usual, less = face(), face("--face-gain", "1,jawOpen:0.5")
    jaw = ARKIT_INDEX["jawOpen"]
    assert np.allclose(less[:, jaw], usual[:, jaw] / 2, atol=1e-6)
    assert "jawOpen" in str(face("--face-gain", "jawOpn:1"))


def test_the_mouth_that_ships_understands_a_telephone_and_a_quiet_recording():
    samples, jaw = sound(6), ARKIT_INDEX["jawOpen"]
    hertz = np.fft.rfftfreq(len(samples), 1 / RATE)
    telephone = np.fft.irfft(np.fft.rfft(samples) * ((hertz >= 300) & (hertz <= 3400)), len(samples)).astype(np.float32)
    times = np.arange(0, 5.9, 1 / 30)
    ours = open_mouth(mouths.SHIPPED_FACE)
    jaws = [run_mouth(ours, x, times=times)[:, jaw] for x in (samples, telephone, samples / 20)]
    for worse in jaws[1:]:
        assert np.corrcoef(jaws[0], worse)[0, 1] > 0.8
        assert 0.7 < worse.mean() / jaws[0].mean() < 1.3  # 1.4 before the network was trained on such speech
