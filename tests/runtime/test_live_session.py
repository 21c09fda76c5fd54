"""Live sessions: the bits of the whole while nothing is steered; no jump, no lost frame, no still moment when something is."""

from __future__ import annotations

import itertools
import threading
import time
from functools import cache

import numpy as np
import pytest

import cospeech
from cospeech.audio.speech import Speech, example
from cospeech.errors import InputError
from cospeech.metrics.blinks import blinks_of
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_angle, quat_conjugate, quat_multiply, quat_to_rotvec
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from cospeech.runtime.idle import nod_angles
from cospeech.runtime.live_session import LiveSession
from tests.support.rules_laws import find_broken_laws, speed_faults
from tests.support.runtime_bundles import same

S = humanoid()
EYES = [S.index["leftEye"], S.index["rightEye"]]
HANDS = [S.index["leftHand"], S.index["rightHand"]]
JAW = ARKIT_INDEX["jawOpen"]
TRAINED = ("stylised-flow", "mix-stage", "chain-of-generation", "speech-to-face")


@cache
def model(name: str = "rules"):
    return cospeech.load(name)


@cache
def load_speech() -> Speech:
    return Speech.load(example()[0])


def session(name: str = "rules", **options) -> LiveSession:
    return cospeech.open_live_session(model(name), **{"fps": 30, "seed": 1} | options)


def speak(live: LiveSession, start: float, end: float) -> list[Motion]:
    return [motion for piece in load_speech().window(start, end).chunks(0.1) for motion in live.push(piece.samples, piece.rate)]


def hush(live: LiveSession, seconds: float) -> list[Motion]:
    return [motion for _ in range(round(seconds * 10)) for motion in live.push(np.zeros(1600, np.int16), 16_000)]


def jumps(motion: Motion) -> np.ndarray:
    """(T − 2,) degrees by which the step of a joint from frame to frame differs from the step before; eyes are left out."""
    q = motion.rotations.astype(float)
    steps = quat_to_rotvec(quat_multiply(q[1:], quat_conjugate(q[:-1])))
    off = np.degrees(np.linalg.norm(np.diff(steps, axis=0), axis=-1))
    off[:, EYES] = 0
    return off.max(1)


def whole(pieces: list[Motion], live: LiveSession) -> Motion:
    """All frames, each once and at its time."""
    motion = Motion.concatenate(pieces)
    times = np.concatenate([piece.times for piece in pieces])
    np.testing.assert_allclose(times, np.arange(len(motion)) / motion.fps, atol=1e-9)
    assert len(motion) == np.ceil(live.time * motion.fps - 1e-6)
    dots = np.einsum("tji,tji->tj", motion.rotations[1:], motion.rotations[:-1])
    assert dots.min() > 0  # no sign flips
    return motion


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rules", *TRAINED])
def test_what_nobody_steers_is_what_a_session_of_the_model_gives(name):
    live, speech = session(name), load_speech().window(0, 3)
    motions = [motion for piece in speech.chunks(0.1) for motion in live.push(piece)] + list(live.finish())
    options = {layer: True for layer in ("stance", "rests", "arm_limits") if model(name).for_files.get(layer)}
    assert same(
        whole(motions, live), Motion.concatenate(list(model(name).stream(speech.chunks(0.1), fps=30, seed=1, **options)))
    )


def test_samples_of_both_kinds_are_heard_and_a_rate_is_asked_for():
    speech = load_speech().window(0, 2)
    whole_numbers = np.round(speech.samples * 32767).astype(np.int16)
    floats = (whole_numbers / 32768).astype(np.float32)
    motions = []
    for samples in (whole_numbers, floats):
        live = session()
        motions.append(Motion.concatenate([*live.push(samples, 16_000), *live.finish()]))
    assert same(*motions)
    with pytest.raises(InputError, match="samples without a rate"):
        session().push(floats)
    with pytest.raises(InputError, match="shape"):
        session().push(np.zeros((4, 2), np.float32), 16_000)


def check_interruption(name: str, at: float, seed: int) -> None:
    live = session(name, seed=seed)
    motions = speak(live, 0, at)
    first = sum(map(len, motions))
    live.interrupt()
    motions += hush(live, 2.4) + speak(live, 3, 4.5) + list(live.finish())
    motion = whole(motions, live)
    around = slice(max(first - 2, 0), first + 45)
    usual = jumps(motion[: max(first - 1, 3)]).max()
    assert jumps(motion)[around].max() < max(usual, 4.3)  # degrees at 30 fps: a stroke, a step of a leg
    k = max(first - 1, 0)
    degrees = np.degrees(quat_angle(motion.rotations[k + 1].astype(float), motion.rotations[k].astype(float)))
    before = np.degrees(quat_angle(motion.rotations[k].astype(float), motion.rotations[k - 1].astype(float)))
    assert np.abs(np.delete(degrees - before, EYES)).max() < 3.0
    assert speed_faults(motion[k : k + 60]) == []
    shut = motion.face[first + 9 : first + 60, JAW]
    assert shut.max() < 0.03  # 0.3 s after
    hands = motion.positions()[:, HANDS, 1]
    resting = hands[first + 50]
    for hand in range(2):
        if hands[k, hand] - resting[hand] > 0.1:
            assert hands[first + 9, hand] < hands[k, hand] - 0.3 * (hands[k, hand] - resting[hand])
            assert hands[first + 20, hand] < resting[hand] + 0.08


def test_an_interruption_shuts_the_mouth_and_brings_the_hands_down():
    check_interruption("rules", 5.1, 1)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(8))
def test_interruptions_at_random_moments(number):
    random = np.random.default_rng(number)
    check_interruption(("rules", *TRAINED[:3])[number % 4], round(random.uniform(2.2, 12.0), 1), number)


@pytest.mark.slow
def test_frames_come_by_the_clock_after_an_interruption():
    live = session()
    motions = speak(live, 0, 4)
    live.interrupt()
    motions += hush(live, 0.1)  # some frames were given early
    for _ in range(20):
        before = sum(map(len, motions))
        motions += hush(live, 0.1)
        assert sum(map(len, motions)) - before == 3
    assert abs(sum(map(len, motions)) / 30 + live.latency - live.time) < 0.12


@pytest.mark.slow
def test_who_pushes_ahead_says_what_is_shown():
    live = session()
    motions = speak(live, 0, 8)
    assert sum(map(len, motions)) / 30 > 6
    live.interrupt(at=4.0)
    assert live.time == pytest.approx(4.0)
    start = Motion.concatenate(motions)[:120]
    motions = [*live.idle(0.5), *speak(live, 3, 6), *live.finish()]
    assert motions[0].start == pytest.approx(4.0)
    motion = Motion.concatenate([start, *motions])
    assert len(motion) == round(7.5 * 30)
    assert jumps(motion[110:135]).max() < 4.3
    with pytest.raises(InputError, match="interrupted at 99"):
        live.interrupt(at=99)


@pytest.mark.parametrize("name", ["rules", pytest.param("mix-stage", marks=pytest.mark.slow)])
def test_a_new_utterance_takes_over_without_a_jump_of_speed(name):
    """A sentence that comes at once begins in the middle of a preparation."""
    live = session(name, fps=60)
    motions = [*speak(live, 0, 3), *live.idle(0.5)]
    starts = [sum(map(len, motions))]
    motions += [*speak(live, 0.5, 3.5), *live.idle(2.0)]
    starts.append(sum(map(len, motions)))
    motions += [*speak(live, 4, 7), *live.finish()]
    hands = whole(motions, live).positions()[:, HANDS]
    change = np.linalg.norm(np.diff(hands, 2, axis=0), axis=-1).max(1) * 60  # m/s from frame to frame
    for first in starts:
        assert change[first - 4 : first + 4].max() < 0.7


def test_a_session_is_interrupted_before_anything_was_shown():
    live = session()
    assert sum(map(len, speak(live, 0, 4))) > 30
    live.interrupt(at=0.0)
    assert live.time == 0
    motion = whole([*speak(live, 3, 6), *live.finish()], live)
    assert len(motion) == 90


def test_after_an_interruption_at_the_beginning_nothing_is_led_over():
    times, motions = np.arange(32_000) / 16_000, []
    sound = (0.3 * np.sin(2 * np.pi * 140 * times) * np.sin(np.pi * 2.3 * times) ** 2).astype(np.float32)
    for speaks in (False, True):
        live = session(parts=("body", "hands"))
        list(live.idle(0.5))
        if speaks:
            list(live.push(sound, 16_000))
        live.interrupt(at=0.0)
        motions.append(Motion.concatenate(list(live.idle(0.3))))
    np.testing.assert_array_equal(motions[1].rotations, motions[0].rotations)


@pytest.mark.slow
def test_what_was_not_taken_is_dropped_by_an_interruption():
    live = session()
    motions = list(live.push(load_speech().samples[:40_000], 16_000))
    live.push(load_speech().samples[40_000:80_000], 16_000)  # nobody takes these frames
    live.interrupt()
    rest = list(live.idle(0.2))
    assert rest[0].start * 30 == pytest.approx(sum(map(len, motions)))
    whole([*motions, *rest], live)


def test_idle_gives_every_frame_of_its_seconds():
    live = session(fps=60)
    motions = [motion for _ in range(90) for motion in live.idle(1 / 60)]
    assert sum(map(len, motions)) == 90
    motions += speak(live, 1, 2.5)
    motions += live.idle(0.5)
    assert len(whole(motions, live)) == 210
    for wrong in (-1, 61, float("nan"), "1"):
        with pytest.raises(InputError, match="idle for"):
            live.idle(wrong)


@pytest.mark.parametrize("look_ahead", [None, 0.5])
def test_idle_in_steps_gives_the_same_frames(look_ahead):
    once, steps = session(look_ahead=look_ahead), session(look_ahead=look_ahead)
    whole_at_once = [*speak(once, 1, 2.5), *once.idle(1.0)]
    in_steps = [*speak(steps, 1, 2.5), *(motion for seconds in (0.0, *[0.1] * 10) for motion in steps.idle(seconds))]
    a, b = (Motion.concatenate(parts) for parts in (whole_at_once, in_steps))
    np.testing.assert_array_equal(a.rotations, b.rotations)
    np.testing.assert_array_equal(a.root, b.root)
    np.testing.assert_array_equal(a.face, b.face)


@pytest.mark.slow
def test_minutes_of_idling_never_freeze_and_blink_as_people_do():
    live = session(seed=4)
    motion = Motion.concatenate([piece for _ in range(2) for piece in live.idle(60)])
    assert 10 <= len(blinks_of(motion.face, 30).widths) / 2 <= 25
    speed = np.degrees(quat_angle(motion.rotations[1:].astype(float), motion.rotations[:-1].astype(float)))
    for name in ("hips", "spine", "head", "leftUpperArm", "rightLowerArm", "leftUpperLeg"):
        assert speed[:, S.index[name]].reshape(-1, 1)[: 30 * 119].reshape(-1, 30).max(1).min() > 1e-3, name  # in every second
    assert find_broken_laws(motion, stand=True) == []
    assert np.ptp(motion.root[:, 0]) > 0.03  # the weight shifts


def test_a_listener_nods_now_and_then():
    angles = np.degrees(nod_angles(3, np.arange(0, 600, 1 / 30)))
    assert angles.min() == 0
    assert 2.5 < angles.max() < 5.6
    begins = np.flatnonzero((angles[1:] > 0) & (angles[:-1] == 0))
    assert 4 * 10 < len(begins) < 16 * 10
    assert np.abs(np.diff(angles)).max() < 1.5  # at 30 fps: no jerk
    np.testing.assert_array_equal(angles[900:905], np.degrees(nod_angles(3, np.arange(900, 905) / 30)))


@pytest.mark.slow
def test_silence_turns_to_idling_and_speech_is_heard_again():
    live = session(idle_after=2.0)
    motions = speak(live, 0, 3) + hush(live, 4)
    assert live._speaking is None
    motions += speak(live, 1, 3)
    assert live._speaking is not None
    motion = whole(motions + list(live.finish()), live)
    assert motion.face[round(7.6 * 30) : round(8.6 * 30), JAW].max() > 0.1  # said at 7 … 9 s
    with pytest.raises(InputError, match="idle_after"):
        session(idle_after=0.5)


@pytest.mark.slow
def test_the_same_calls_with_the_same_seed_give_the_same_bits():
    def play(seed: int) -> Motion:
        live = session(seed=seed)
        motions = speak(live, 0, 3)
        live.interrupt()
        live.set_emotion("anger")
        return Motion.concatenate([*motions, *hush(live, 0.5), *speak(live, 2, 4), *live.idle(1)])

    assert same(play(5), play(5))
    assert not same(play(5), play(6))


@pytest.mark.slow
def test_warming_up_changes_no_frame():
    cold, warm = session(), session()
    warm.warm_up()
    assert same(*(Motion.concatenate([*speak(live, 0, 2.5), *live.finish()]) for live in (cold, warm)))


STEERING = [("restyle", "lively"), ("set_emotion", "happiness"), ("set_intensity", 1.6), ("set_parts", "face,body")]


def check_control(name: str, control: str, value: object) -> None:
    results = {}
    for steers in (False, True):
        live = session(name)
        pieces = speak(live, 0, 3.6)
        first = sum(map(len, pieces))
        if steers:
            getattr(live, control)(value)
        results[steers] = whole(pieces + speak(live, 3.6, 6.5) + list(live.finish()), live)
    plain, other = results[False], results[True]
    np.testing.assert_array_equal(other.rotations[:first], plain.rotations[:first])
    assert not np.array_equal(other.rotations, plain.rotations) or not np.array_equal(other.face, plain.face)
    assert jumps(other)[first - 2 : first + 30].max() < jumps(plain).max() + 3.0
    assert np.abs(np.diff(other.face[first - 1 : first + 1, JAW])).max() < 0.2


@pytest.mark.slow
@pytest.mark.parametrize(("control", "value"), STEERING)
def test_controls_change_what_comes_without_a_jump(control, value):
    check_control("rules", control, value)


@pytest.mark.slow
@pytest.mark.parametrize("name", TRAINED[:3])
@pytest.mark.parametrize(("control", "value"), STEERING[1:])
def test_controls_of_trained_models(name, control, value):
    check_control(name, control, value)


@pytest.mark.slow
def test_emotions_are_shown_in_speech_and_while_idling():
    live, smile = session(), ARKIT_INDEX["mouthSmileLeft"]
    before = Motion.concatenate([*speak(live, 0, 3), *live.idle(2)]).face[-30:, smile].mean()
    live.set_emotion("happiness")
    idling = Motion.concatenate(list(live.idle(4))).face[-30:, smile].mean()
    motions = speak(live, 0, 3)
    speaking = Motion.concatenate([*motions, *live.finish()]).face[30:60, smile].mean()
    assert idling > before + 0.1
    assert speaking > before + 0.05
    live.set_emotion("auto")
    assert Motion.concatenate(list(live.idle(4))).face[-30:, smile].mean() < idling - 0.1


@pytest.mark.slow
def test_parts_that_are_off_come_to_rest_and_back():
    live = session()
    list(speak(live, 0, 3))
    live.set_parts("body")
    off = Motion.concatenate(list(live.idle(2)))[-5:]
    assert np.abs(off.face).max() == 0
    assert np.degrees(quat_angle(off.rotations[:, S.left_hand], np.array([0.0, 0, 0, 1]))).max() < 1e-3
    live.set_parts(["face", "body", "hands"])
    on = Motion.concatenate(list(live.idle(2)))[-5:]
    assert np.degrees(quat_angle(on.rotations[:, S.left_hand], np.array([0.0, 0, 0, 1]))).max() > 5
    with pytest.raises(InputError, match="does not make the part 'hands'"):
        session(parts=("face", "body")).set_parts("hands")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("control", "value", "problem"),
    [
        ("restyle", "nobody", "no style"),
        ("restyle", "seated", "a style that sits"),
        ("set_emotion", "joy", "no emotion"),
        ("set_intensity", 3, "out of range"),
        ("set_parts", "feet", "no part"),
        ("set_parts", None, "parts None"),
        ("set_emotion", None, "an emotion that is None"),
    ],
)
def test_a_wrong_control_changes_nothing(control, value, problem):
    live, plain = session(), session()
    motions = {each: speak(each, 0, 2.5) for each in (live, plain)}
    with pytest.raises(InputError, match=problem):
        getattr(live, control)(value)
    assert same(*(Motion.concatenate(motions[each] + list(each.finish())) for each in (live, plain)))


def test_one_take_and_something_to_finish():
    with pytest.raises(InputError, match="2 takes in a live session"):
        session(takes=2)
    with pytest.raises(InputError, match="there is no speech"):
        session().finish()


@pytest.mark.slow
def test_another_thread_may_steer_while_sound_is_pushed():
    session, motions, over = cospeech.open_live_session("rules", fps=30), [], threading.Event()

    def steer() -> None:
        for k in itertools.count():
            if over.is_set():
                return
            session.set_emotion(("happiness", "anger", "neutral")[k % 3])
            session.set_intensity(0.8 + 0.1 * (k % 4))
            time.sleep(0.002)

    other = threading.Thread(target=steer)
    other.start()
    try:
        for piece in Speech.load(example()[0]).window(0, 8).chunks(0.02):
            motions += list(session.push(piece))
        motions += list(session.finish())
    finally:
        over.set()
        other.join()
    starts = np.cumsum([0, *(len(motion) for motion in motions)])
    assert [round(motion.start * 30) for motion in motions] == starts[:-1].tolist()
    assert starts[-1] == 240
