"""Strokes of trained models that fall on accents: time is bent, poses are not, and a stream gives what the whole gives."""

from __future__ import annotations

import numpy as np
import pytest

import cospeech
from cospeech import Motion, Speech
from cospeech.audio.event_detection import listen
from cospeech.audio.prosodic_events import Accent
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.part_joints import arm_joints
from cospeech.motion.rotations import quat_angle, quat_identity
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.beat_alignment import LEAD, AccentTrack, BeatAlignment, Knot, bend_times

FPS = 30.0
ELBOW = humanoid().index["rightLowerArm"]


def example() -> Speech:
    return Speech.load(EXAMPLE, rate=16_000)


class Known(AccentTrack):
    """Accents that are all known."""

    def __init__(self, times: list[float]) -> None:
        super().__init__()
        self._times, self._accents = list(times), [Accent(time, 0.5) for time in times]
        self.known = np.inf


def beating(times: list[float], seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """A right elbow that bends by 40 degrees at each time, one way and back, under a head and hips that move, too."""
    at = np.arange(round(seconds * FPS)) / FPS
    bend = np.zeros(len(at))
    for k, time in enumerate(times):
        bend += (-1) ** k * np.radians(40) / (1 + np.exp(-(at - time) / 0.04))
    rotations = np.broadcast_to(quat_identity(1), (len(at), len(humanoid()), 4)).astype(np.float32).copy()
    rotations[:, ELBOW, 1], rotations[:, ELBOW, 3] = np.sin(bend / 2), np.cos(bend / 2)
    nod = 0.2 * np.sin(at)
    rotations[:, humanoid().index["head"], 0], rotations[:, humanoid().index["head"], 3] = np.sin(nod), np.cos(nod)
    return rotations, np.stack([at, np.ones_like(at), np.zeros_like(at)], -1).astype(np.float32)


def align(rotations: np.ndarray, root: np.ndarray, track: AccentTrack) -> tuple[np.ndarray, ...]:
    layer = BeatAlignment(FPS, track)
    pieces = [layer.push(rotations, root), layer.finish()]
    return tuple(np.concatenate(parts) for parts in zip(*pieces, strict=True))


def fastest(rotations: np.ndarray, around: float) -> float:
    """When the elbow turns fastest within .3 s of a time."""
    speeds = quat_angle(rotations[1:, ELBOW].astype(float), rotations[:-1, ELBOW].astype(float))
    at = (np.arange(len(speeds)) + 0.5) / FPS
    near = np.flatnonzero(np.abs(at - around) < 0.3)
    return float(at[near[speeds[near].argmax()]])


@pytest.mark.parametrize("off", [-0.2, -0.1, 0.1, 0.2])
def test_a_stroke_near_an_accent_is_moved_onto_it(off):
    accents = [1.5, 2.6, 3.4, 4.5, 5.7]
    rotations, root = beating([time - LEAD + off for time in accents], 7.0)
    result, same = align(rotations, root, Known(accents))
    np.testing.assert_array_equal(same, root)
    others = [k for k in range(len(humanoid())) if k not in arm_joints()]
    np.testing.assert_array_equal(result[:, others], rotations[:, others])
    for time in accents:
        assert abs(fastest(rotations, time - LEAD + off) - (time - LEAD)) > 0.06
        assert abs(fastest(result, time - LEAD) - (time - LEAD)) < 0.04
    np.testing.assert_allclose(result[[0, -1], ELBOW], rotations[[0, -1], ELBOW], atol=1e-3)


def test_without_accents_nothing_moves_and_far_strokes_stay():
    rotations, root = beating([1.0, 2.0, 3.0], 5.0)
    np.testing.assert_allclose(align(rotations, root, Known([]))[0], rotations, atol=1e-6)
    result, _ = align(rotations, root, Known([4.5]))
    for time in (1.0, 2.0, 3.0):
        assert abs(fastest(result, time) - fastest(rotations, time)) < 0.01


@pytest.mark.parametrize("seed", range(4))
def test_time_never_goes_back(seed):
    random = np.random.default_rng(seed)
    knots = [Knot(0.0, 0.0)]
    for _ in range(200):
        ahead = random.uniform(0.2, 0.8)
        last = knots[-1]
        knots.append(Knot(last.time + ahead, last.source + ahead * random.uniform(0.62, 1.6), random.choice([1.0, 1.3])))
    times = np.arange(0, knots[-1].time, 0.003)
    sources = bend_times(knots, times)
    assert np.diff(sources).min() >= 0
    assert np.diff(sources).max() / 0.003 < 2.5
    np.testing.assert_allclose(bend_times(knots, np.array([k.time for k in knots])), [k.source for k in knots], atol=1e-9)


@pytest.mark.parametrize("seed", [0, 6, 7, 22])  # of 120, those that showed peaks or accents taken too early
def test_pieces_of_any_size_give_the_whole(seed):
    random = np.random.default_rng(seed)
    speech = example().window(0, 9)
    rotations = np.cumsum(random.normal(0, 0.02, (270, len(humanoid()), 4)), 0) + [0, 0, 0, 1]
    rotations = (rotations / np.linalg.norm(rotations, axis=-1, keepdims=True)).astype(np.float32)
    root = random.normal(0, 1, (270, 3)).astype(np.float32)
    whole = AccentTrack()
    whole.push(speech)
    whole.finish()
    expected = align(rotations, root, whole)
    track, pieces, at = AccentTrack(), [], 0
    layer = BeatAlignment(FPS, track)
    for piece in speech.chunks(0.1):  # frames and sound go on together, the frames in pieces of their own
        track.push(piece)
        end = min(at + int(random.integers(0, 7)), len(rotations))
        pieces.append(layer.push(rotations[at:end], root[at:end]))
        at = end
    track.finish()
    pieces += [layer.push(rotations[at:], root[at:]), layer.finish()]
    for part, expected_part in zip(zip(*pieces, strict=True), expected, strict=True):
        np.testing.assert_array_equal(np.concatenate(part), expected_part)


def test_the_track_hears_the_accents_that_the_rules_hear():
    speech = example()
    track = AccentTrack()
    for piece in speech.chunks(0.13):
        before = track.known
        track.push(piece)
        assert track.known >= before
    assert 0 < speech.seconds - track.known < AccentTrack.delay + 0.14
    track.finish()
    assert [a.time for a in track.between(0, 100)] == [a.time for a in listen(speech)[1]]
    assert track.between(0, 100)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mix-stage", "chain-of-generation", "stylised-flow"])
def test_a_stream_waits_as_long_as_it_says_and_has_the_frames_of_the_whole(name):
    model, speech = cospeech.load(name), example().window(0, 6)
    options = {"seed": 1, "fps": 30, "parts": ("body", "hands"), "stance": True, "beat_alignment": True}
    session = model.session(**options)
    motions, seconds, late = [], 0.0, []
    for piece in speech.chunks(0.04):
        seconds += piece.seconds
        motions += list(session.push(piece))
        late.append(seconds - sum(map(len, motions)) / 30)
    motions += list(session.finish())
    whole = model.generate(speech, **options)
    np.testing.assert_array_equal(Motion.concatenate(motions).rotations, whole.rotations)
    assert session.latency - 0.3 < max(late) <= session.latency + 1e-6
    plain = model.generate(speech, **{**options, "beat_alignment": False, "stance": False})
    aligned_motion = model.generate(speech, **{**options, "stance": False})
    others = [k for k in range(len(humanoid())) if k not in arm_joints()]
    np.testing.assert_array_equal(aligned_motion.rotations[:, others], plain.rotations[:, others])
    assert np.abs(aligned_motion.rotations - plain.rotations).max() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mix-stage", "chain-of-generation", "stylised-flow"])
def test_the_hands_follow_the_accents_of_real_speech_more_closely(shared_folder, name):
    pytest.importorskip("scipy", reason="beat lift needs scipy (the eval extra)")
    from cospeech.metrics import beat_lift

    files = sorted((shared_folder / "data" / "speech" / "ljspeech").glob("LJ001-00*.flac"))[:4]
    sounds = [Speech.load(file, rate=16_000) for file in files]
    lifts = []
    for aligned in (False, True):
        options = {"fps": 30.0, "emotion": "neutral", "seed": 1, "beat_alignment": aligned, "parts": ("body", "hands")}
        model = cospeech.load(name)
        lifts.append(beat_lift([(s.samples, 16_000, model.generate(s, **options)) for s in sounds]).far)
    assert lifts[1] > lifts[0] + 0.05


@pytest.mark.slow
@pytest.mark.parametrize("parts", [("face", "body", "hands"), ("body", "hands")])
@pytest.mark.parametrize("name", ["mix-stage", "chain-of-generation", "stylised-flow"])
def test_takes_of_one_pass_are_those_played_alone(name, parts):
    """The time of each take is bent in its own way, so one has frames ready before another."""
    model, speech = cospeech.load(name), example().window(0, 12)
    options = {"fps": 30, "parts": parts, "stance": True, "beat_alignment": True}
    session = model.session(seed=3, takes=3, **options)
    rounds = [pieces for chunk in speech.chunks(1.7) for pieces in session.push_takes(chunk)]
    rounds += list(session.finish_takes())
    for take in range(3):
        together, alone = (
            Motion.concatenate([pieces[take] for pieces in rounds]),
            model.generate(speech, seed=3 + take, **options),
        )
        assert len(together) == len(alone) == 12 * 30
        np.testing.assert_allclose(together.rotations, alone.rotations, atol=1e-5)
        assert (together.face is None) == ("face" not in parts)
