"""Metrics of faces: laws on faces that were built to have a known answer; the way from a store's face to its score."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.audio.speech import Speech
from cospeech.corpora import Clip
from cospeech.corpora.samples import sample_of
from cospeech.errors import InputError
from cospeech.evaluation import evaluate_clips
from cospeech.metrics import METRICS, Sample, Tools, load_metric
from cospeech.metrics.blinks import blinks_of
from cospeech.metrics.controls import CONTROLS, control_rows
from cospeech.metrics.jaw_lag import LAGS, correlations
from cospeech.metrics.lip_closure import kappa
from cospeech.metrics.speech_level import RATE, level, silent
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT_INDEX

FPS, HZ, SECONDS = 30.0, 16_000, 24
JAW, LIDS = ARKIT_INDEX["jawOpen"], [ARKIT_INDEX["eyeBlinkLeft"], ARKIT_INDEX["eyeBlinkRight"]]
FACE = ("face_mse", "lip_closure", "lip_closure_agreement", "jaw_lag", "jaw_correlation",
        "blinks", "blink_rate", "blink_duration", "blink_gaps")  # fmt: skip
SCORE = {name: load_metric(name) for name in FACE}


def syllables(seed: int, at: np.ndarray) -> np.ndarray:
    """Loudness 0 … 1 at times: some four bursts a second, each of its size, and pauses of 0.6 s every 3 s."""
    sizes = np.random.default_rng(seed).uniform(0.3, 1, SECONDS * 4 + 8)
    beat = np.maximum(at * (4 - 0.3 * seed), 0)
    return np.where(np.mod(at - 0.7 * seed, 3) < 2.4, np.sin(np.pi * np.mod(beat, 1)) ** 2 * sizes[beat.astype(int)], 0)


def speech(seed: int) -> Speech:
    at = np.arange(SECONDS * HZ) / HZ
    sound = np.random.default_rng(seed + 50).normal(size=len(at)) * 0.1 * syllables(seed, at)
    return Speech(sound.astype(np.float32), HZ)


def face(seed: int, *, lag: float = 0.0, blinks_at: tuple[float, ...] = (), width: float = 0.15) -> np.ndarray:
    """A jaw that opens with the loudness, ``lag`` seconds later, and eyelids."""
    at = np.arange(int(SECONDS * FPS)) / FPS
    weights = np.zeros((len(at), 52))
    weights[:, JAW] = 0.6 * np.sqrt(syllables(seed, at - lag)) * (at >= lag)
    for when in blinks_at:
        weights[:, LIDS] += np.maximum(0, 1 - np.abs(at - when) / width)[:, None]
    return weights


def sample(weights: np.ndarray, seed: int, name: str = "", **more: object) -> Sample:
    return Sample(name or f"clip{seed}", FPS, face=weights, speech=speech(seed), **more)


def samples(**how: object) -> list[Sample]:
    return [sample(face(k, **how), k) for k in range(3)]


def test_they_are_registered_and_say_what_they_need():
    assert set(FACE) <= {*METRICS}
    assert all("face" in score.about.needs for score in SCORE.values())
    assert {name for name, score in SCORE.items() if score.about.hears} == {"lip_closure", "jaw_lag", "jaw_correlation"}
    bare = Sample("bare", FPS, positions=np.zeros((9, 3, 3)), speech=speech(0))
    for score in SCORE.values():
        with pytest.raises(InputError, match="face"):
            score([bare], [bare])


@pytest.mark.parametrize("weights", [np.zeros((9, 51)), np.zeros(9), np.full((9, 52), np.nan)])
def test_faces_have_52_finite_weights(weights):
    with pytest.raises(InputError, match="face"):
        Sample("a", FPS, face=weights)


# mean squared error ---------------------------------------------------------------------------------------------------------


def test_mse_is_the_mean_of_squares_over_all_frames_of_all_clips():
    rng = np.random.default_rng(0)
    true = [rng.random((frames, 52)) for frames in (20, 50)]
    faces = [x + rng.normal(size=x.shape) for x in true]
    pairs = [
        [Sample(str(k), FPS, face=x, seed_frames=4) for k, x in enumerate(side)] for side in (faces, true)
    ]  # fmt: skip
    differences = np.concatenate([(a - b)[4:] for a, b in zip(faces, true, strict=True)])
    assert SCORE["face_mse"](*pairs).value == pytest.approx(np.square(differences).mean())
    assert SCORE["face_mse"](pairs[1], pairs[1]).value == 0
    others = [replace(s, face=np.where(np.arange(len(s))[:, None] < 4, 9.0, s.face)) for s in pairs[1]]
    assert SCORE["face_mse"](others, pairs[1]).value == 0  # what was given does not count


# lips -------------------------------------------------------------------------------------------------------------------


def test_silence_is_where_nothing_is_said():
    is_silent = silent(level(speech(0)))
    at = np.arange(len(is_silent)) / RATE
    inside, outside = (np.mod(at, 3) > 2.45) & (np.mod(at, 3) < 2.95), (np.mod(at, 3) > 0.1) & (np.mod(at, 3) < 2.3)
    assert is_silent[inside].all()
    assert not is_silent[outside].any()  # gaps between syllables are no pauses
    assert silent(np.repeat([0.0, -50, 0], [80, 14, 80])).sum() == 0
    assert silent(np.repeat([0.0, -50, 0], [80, 16, 80])).sum() == 16
    with pytest.raises(InputError, match="silence"):
        level(Speech(np.zeros(HZ, np.float32), HZ))


def test_level_does_not_depend_on_how_loud_the_recording_is():
    loud = speech(1)
    np.testing.assert_allclose(level(loud), level(replace(loud, samples=loud.samples * 0.03, duration=None)), atol=1e-3)


@pytest.mark.slow
def test_lips_are_shut_in_pauses():
    assert SCORE["lip_closure"](samples()).value > 0.95
    open_ = [replace(s, face=s.face + 0.2) for s in samples()]
    assert SCORE["lip_closure"](open_).value == 0
    half = np.zeros((int(SECONDS * FPS), 52))
    half[len(half) // 2 :, JAW] = 0.5
    score = SCORE["lip_closure"]([sample(half, 0)])
    assert score.value == pytest.approx(0.5, abs=0.02)
    assert score.note == f"in speech {0.5:.2f}"


@pytest.mark.slow
def test_agreement_is_perfect_for_a_copy_and_nothing_for_chance():
    true = samples()
    assert SCORE["lip_closure_agreement"](true, true).value == 1
    rng = np.random.default_rng(0)
    for make in (np.zeros, np.ones, lambda shape: rng.random(shape) * 0.2):
        others = [replace(s, face=make(s.face.shape)) for s in true]
        assert abs(SCORE["lip_closure_agreement"](others, true).value) < 0.05
    against = [replace(s, face=0.6 - s.face) for s in true]
    assert SCORE["lip_closure_agreement"](against, true).value < -0.1


def test_kappa_is_cohens():
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, 2, 200), rng.integers(0, 2, 200)
    b[:120] = a[:120]
    counts = np.bincount(2 * a + b, minlength=4).reshape(2, 2).astype(float)
    chance = a.mean() * b.mean() + (1 - a.mean()) * (1 - b.mean())
    assert kappa(counts) == pytest.approx(((a == b).mean() - chance) / (1 - chance))
    assert kappa(np.array([[9.0, 0], [0, 0]])) == 0


# jaws ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("lag", [-0.12, 0.0, 0.05, 0.2])
def test_the_lag_is_found(lag):
    score = SCORE["jaw_lag"](samples(lag=lag))
    assert score.value == pytest.approx(lag, abs=0.025)
    assert score.interval[0] <= score.value <= score.interval[1]
    assert SCORE["jaw_correlation"](samples(lag=lag)).value > 0.7


def test_correlations_are_those_of_numpy():
    (one,) = samples()[:1]
    loud = level(one.speech)
    jaw = np.interp(np.arange(len(loud)) / RATE, np.arange(len(one)) / FPS, one.face[:, JAW])
    jaw, loud = jaw - jaw.mean(), loud - loud.mean()
    values = correlations([one])
    for lag, value in zip(LAGS, values, strict=True):
        a, b = (jaw[lag:], loud[: len(loud) - lag]) if lag >= 0 else (jaw[:lag], loud[-lag:])
        assert value == pytest.approx(a @ b / np.sqrt(a @ a * (b @ b)))


@pytest.mark.slow
def test_only_a_jaw_that_follows_correlates():
    rng = np.random.default_rng(0)
    noise = [replace(s, face=rng.random(s.face.shape)) for s in samples()]
    still = [replace(s, face=np.full_like(s.face, 0.3)) for s in samples()]
    assert SCORE["jaw_correlation"](noise).value < 0.2
    assert SCORE["jaw_correlation"](still).value == 0
    with pytest.raises(InputError, match="still"):
        SCORE["jaw_lag"](still)
    with pytest.raises(InputError, match="2 s"):
        SCORE["jaw_lag"]([Sample("a", FPS, face=face(0)[:30], speech=speech(0))])


# blinks -------------------------------------------------------------------------------------------------------------------

EVEN = tuple(np.arange(1.0, SECONDS, 3.0))
ODD = (1.0, 1.8, 2.6, 9.0, 9.9, 18.0, 21.0, 22.0)


@pytest.mark.slow
def test_blinks_are_counted_and_timed():
    blinks = blinks_of(face(0, blinks_at=EVEN), FPS)
    assert len(blinks.widths) == len(EVEN)
    np.testing.assert_allclose(blinks.widths, 0.15, atol=0.01)  # a triangle of 0.3 s at half height
    np.testing.assert_allclose(blinks.gaps, 3.0, atol=0.04)
    score = {name: SCORE[name](samples(blinks_at=EVEN), samples()).value for name in FACE[6:]}
    assert score["blink_rate"] == pytest.approx(60 * len(EVEN) / SECONDS)
    assert score["blink_duration"] == pytest.approx(0.15, abs=0.01)
    assert score["blink_gaps"] == pytest.approx(0, abs=0.02)
    assert SCORE["blink_gaps"](samples(blinks_at=ODD)).value == pytest.approx(
        np.diff(ODD).std() / np.diff(ODD).mean(), abs=0.03
    )


def test_half_shut_eyes_and_long_looks_down_are_no_blinks():
    weights = face(0, blinks_at=EVEN)
    low = weights * 0.6 + 0.4
    assert len(blinks_of(low, FPS).widths) == len(EVEN)
    assert len(blinks_of(face(0, blinks_at=(6.0, 12.0), width=1.0), FPS).widths) == 0
    assert len(blinks_of(0.2 * weights, FPS).widths) == 0


@pytest.mark.parametrize("fps", [15.0, 60.0])
def test_blinks_do_not_depend_on_the_rate(fps):
    at = np.arange(int(SECONDS * fps)) / fps
    weights = np.zeros((len(at), 52))
    for when in EVEN:
        weights[:, LIDS] += np.maximum(0, 1 - np.abs(at - when - 0.011) / 0.15)[:, None]
    blinks = blinks_of(weights, fps)
    assert len(blinks.widths) == len(EVEN)
    assert blinks.widths.mean() == pytest.approx(0.15, abs=0.03)


@pytest.mark.slow
def test_distance_of_blinks_is_0_for_a_copy_and_1_for_none():
    true = samples(blinks_at=ODD)
    assert SCORE["blinks"](true, true).value == 0
    assert SCORE["blinks"](samples(), true).value == 1
    slow = SCORE["blinks"](samples(blinks_at=ODD, width=0.25), true).value
    rare = SCORE["blinks"](samples(blinks_at=EVEN[:3], width=0.25), true).value
    assert 0 < slow < rare < 1
    with pytest.raises(InputError, match="does not blink"):
        SCORE["blinks"](true, samples())


# evaluation ---------------------------------------------------------------------------------------------------------------


def clips() -> list[Clip]:
    result = []
    for k in range(4):
        weights = face(k, blinks_at=tuple(t + 0.3 * k for t in ODD))
        rest = np.broadcast_to(humanoid().rest, (len(weights), len(humanoid()), 4))
        result.append(Clip(f"clip{k}", "ann", "made up", speech(k), Motion(FPS, rest, np.zeros((len(weights), 3)), weights)))
    return result


@pytest.mark.slow
def test_controls_have_faces_of_their_own():
    rows = control_rows(clips())
    true = np.concatenate([clip.motion.face for clip in rows[CONTROLS[0]]])
    frozen = np.concatenate([clip.motion.face for clip in rows["frozen pose"]])
    noise = np.concatenate([clip.motion.face for clip in rows["white noise"]])
    np.testing.assert_allclose(frozen, np.broadcast_to(true.mean(0), true.shape), atol=1e-5)
    assert np.abs(np.diff(noise[:, JAW])).mean() > 2 * np.abs(np.diff(true[:, JAW])).mean()
    assert noise.min() >= 0
    assert noise.max() <= 1
    np.testing.assert_array_equal(rows["another clip"][0].motion.face, clips()[1].motion.face)


@pytest.mark.slow
def test_they_put_the_control_rows_in_order():
    table = evaluate_clips({}, clips(), metrics=FACE, tools=Tools())
    assert table.cells["ground truth"]["face_mse"].value == 0
    wrong = {name: [fault for fault in faults if "not worse" in fault] for name, faults in table.faults.items()}
    assert not any(
        wrong.get(name) for name in ("jaw_correlation", "lip_closure", "lip_closure_agreement", "blinks", "blink_gaps")
    )
    assert wrong["face_mse"]  # the mean face is nearer than another clip's


@pytest.mark.slow
def test_a_systems_face_is_fitted_to_the_recording():
    motions = {clip.name: clip.motion for clip in clips()}
    short = {name: motion[: len(motion) - 2] for name, motion in motions.items()}
    double = {name: motion.resample(60.0) for name, motion in motions.items()}
    table = evaluate_clips({"short": short, "double": double}, clips(), metrics=("face_mse", "blinks"))
    assert table.cells["short"]["face_mse"].value < 1e-3
    assert table.cells["double"]["face_mse"].value < 1e-9
    bare = {name: replace(motion, face=None) for name, motion in motions.items()}
    table = evaluate_clips({"bare": bare}, clips(), metrics=("face_mse",))
    assert table.cells["bare"]["face_mse"] is None
    assert "face" in table.why["bare"]["face_mse"]


def test_legs_and_faces_of_a_clip_reach_the_sample():
    (clip, *_) = clips()
    np.testing.assert_array_equal(sample_of(clip).face, clip.motion.face)


def test_faces_of_a_store_reach_the_metrics(tmp_path):
    from cospeech.corpora.samples import load_stored_clips
    from cospeech.corpora.store import Entry
    from cospeech.corpora.store_writer import Piece, write_store
    from cospeech.motion.poses import find_pose
    from cospeech.motion.skeletons.arkit import ARKIT

    pose, weights = find_pose("expmap-humanoid"), face(0).astype(np.float32)
    values = {"pose": np.zeros((len(weights), pose.dimensions), np.float32), "face": weights}
    entries = [
        Entry(name, "ann", "test", 0, len(weights), 0.0, has) for name, has in (("a", ("pose", "face")), ("b", ("pose",)))
    ]
    pieces = [Piece(entry, (), lambda has=entry.has: {name: values[name] for name in has}) for entry in entries]
    write_store(
        tmp_path / "s", pieces, corpus="beat", pose=pose.name, fps=FPS, names={"pose": pose.names, "face": ARKIT}
    )  # fmt: skip
    a, b = load_stored_clips(tmp_path / "s")
    np.testing.assert_allclose(a.motion.face, weights)
    assert b.motion.face is None
