"""Eyes on the listener: the plan of the gaze, and eyes that make up for the turns of the head, whatever system moves it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cospeech import models
from cospeech.audio.event_detection import EventDetector
from cospeech.audio.prosodic_events import Phrase
from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.face.gaze import LISTENER, GazePlanner, direction_of, eye_angles, lids_and_looks, look, toward
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_conjugate, quat_identity, quat_multiply, rotvec_to_quat
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from cospeech.rules.styles import STYLES

JOINT = humanoid().index
CHAIN = ("hips", "spine", "chest", "upperChest", "neck", "head")
NEAR = np.radians(12.0)


def world(motion: Motion, joint: str) -> np.ndarray:
    """(N, 4) of a joint of the head in the world."""
    rotations = quat_identity(len(motion))
    for name in (*CHAIN, joint) if joint != "head" else CHAIN:
        rotations = quat_multiply(rotations, motion.rotations[:, JOINT[name]].astype(float))
    return rotations


def off_listener(motion: Motion) -> np.ndarray:
    """(N,) radians between where both eyes look, on average, and the listener."""
    gaze = np.mean([direction_of(world(motion, eye)) for eye in ("leftEye", "rightEye")], 0)
    place = motion.root.astype(float) - humanoid().offsets[0]
    gaze[:, 0] -= np.arctan2(-place[:, 0], LISTENER - place[:, 2])
    return np.arccos(np.clip(np.cos(gaze[:, 0]) * np.cos(gaze[:, 1]), -1, 1))


@cache
def talk() -> Speech:
    """A minute and a half: one passage three times; every performance of it is another one."""
    samples = Speech.load(EXAMPLE).samples
    return Speech(np.concatenate([samples, samples, samples]))


@cache
def speaking() -> np.ndarray:
    """(N,) whether somebody speaks, at 30 frames per second."""
    listener = EventDetector()
    listener.push(talk().samples)
    listener.finish()
    features = listener.window(0.0, talk().duration)
    return features.at(np.arange(talk().frames(30)) / 30, features.loudness) > 0.4


def turn_joints(**turns: tuple[float, float, float]) -> np.ndarray:
    """(1, J, 4) of a body with joints turned by rotation vectors in degrees."""
    rotations = quat_identity(1, len(humanoid()))
    for name, turn in turns.items():
        rotations[:, JOINT[name]] = rotvec_to_quat(np.radians([turn]))
    return rotations


HOME = humanoid().offsets[0][None].astype(float)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["rules", *sorted(path.stem for path in models.SHIPPED.glob(f"*{models.BUNDLE}"))])
def test_every_system_looks_at_the_listener_while_it_speaks(model):
    motion = models.load(model).generate(talk(), seed=3, emotion="neutral", fps=30.0)
    near = (off_listener(motion) < NEAR)[speaking()]
    assert 0.75 <= near.mean() <= 0.95
    changes = np.flatnonzero(np.diff(near.astype(int)))
    assert 4 <= len(changes) / (len(near) / 30 / 60) <= 60  # a minute: glances away, not one long stare


@pytest.mark.slow
@pytest.mark.parametrize("style", ["lively", "reserved", "restless"])
def test_styles_look_at_the_listener(style):
    assert style in STYLES
    motion = models.load("rules").generate(talk(), seed=1, emotion="neutral", fps=30.0, style=style)
    assert 0.75 <= (off_listener(motion) < NEAR)[speaking()].mean() <= 0.95


@pytest.mark.parametrize("head", [(0, 0, 0), (0, 25, 0), (15, -20, 8), (-10, 10, -12)])
@pytest.mark.parametrize("chest", [(0, 0, 0), (5, 12, -4)])
def test_eyes_stay_where_they_are_planned_while_the_head_turns(head, chest):
    """As long as the eyes can turn so far in their sockets."""
    body = turn_joints(head=head, chest=chest)
    plan = np.array([[0.05, -0.03]])
    motion = Motion(30.0, look(body, eye_angles(body, HOME, plan)), HOME, None, humanoid())
    both = np.mean([direction_of(world(motion, eye)) for eye in ("leftEye", "rightEye")], 0)
    np.testing.assert_allclose(both, plan, atol=np.radians(0.6))


def test_eyes_converge_on_the_listener_and_follow_them_when_the_body_walks():
    body = turn_joints()
    angles = eye_angles(body, HOME, np.zeros((1, 2)))[0]
    assert angles[0, 0] < 0 < angles[1, 0]  # the left eye looks to the right
    apart = np.degrees(angles[1, 0] - angles[0, 0])
    assert apart == pytest.approx(np.degrees(2 * np.arctan(0.0315 / LISTENER)))
    aside = eye_angles(body, HOME + [[0.5, 0, 0]], np.zeros((1, 2)))[
        0
    ]  # half a metre to the left: the listener is to the right
    assert np.degrees(aside.mean(0)[0]) == pytest.approx(-np.degrees(np.arctan2(0.5, LISTENER)), abs=0.1)


def test_eyes_turn_no_further_than_eyes_do():
    far = eye_angles(turn_joints(head=(0, 80, 0)), HOME, np.zeros((1, 2)))[0]
    assert np.degrees(np.abs(far)).max() < 40
    near = eye_angles(turn_joints(head=(0, 20, 0)), HOME, np.zeros((1, 2)))[0]
    assert np.degrees(near.mean(0)[0]) == pytest.approx(-20, abs=0.1)


def test_directions_and_rotations_are_each_others_inverse():
    gaze = np.random.default_rng(0).uniform(-1.2, 1.2, (50, 2))
    np.testing.assert_allclose(direction_of(toward(gaze)), gaze, atol=1e-12)
    back = quat_multiply(quat_conjugate(toward(gaze)), toward(gaze))
    np.testing.assert_allclose(np.abs(back[:, 3]), 1)


def test_lids_follow_the_eyes_down_and_up_and_a_blink_stays_a_blink():
    face = np.zeros((3, 52))
    face[1, [ARKIT_INDEX["eyeBlinkLeft"], ARKIT_INDEX["eyeBlinkRight"]]] = 1.0
    down = lids_and_looks(face, np.full((3, 2, 2), [0.0, -0.3]))
    up = lids_and_looks(face, np.full((3, 2, 2), [0.0, 0.3]))
    assert down[0, ARKIT_INDEX["eyeBlinkLeft"]] > 0.1
    assert down[1, ARKIT_INDEX["eyeBlinkLeft"]] == up[1, ARKIT_INDEX["eyeBlinkLeft"]] == 1.0
    assert up[0, ARKIT_INDEX["eyeWideRight"]] > 0.05 > up[1, ARKIT_INDEX["eyeWideRight"]]
    assert down[0, ARKIT_INDEX["eyeLookDownLeft"]] > 0.5 > 0 == up[0, ARKIT_INDEX["eyeLookDownLeft"]]


def plan(seed: int, averted: float = 0.25, minutes: float = 5.0) -> tuple[np.ndarray, list[Phrase]]:
    """(N, 3) time in s, degrees off the listener, whether the eyes are away, tick by tick; and the phrases."""
    phrases = [Phrase(3.0 * k + 0.4, 3.0 * k + 2.7) for k in range(int(minutes * 20))]
    gaze, rows, at = GazePlanner(seed, averted), [], 0.0
    for tick in range(int(minutes * 600)):
        now = tick / 10
        saccade = gaze.decide(now, [p for p in phrases if now - 4 < p.start < now + 0.78])
        at = at if saccade is None else float(np.hypot(saccade.yaw, saccade.up))
        rows.append((now, at, gaze.away))
    return np.array(rows), phrases


def test_the_gaze_leaves_as_phrases_begin_and_is_back_as_they_end():
    begin, end = [], []
    for seed in range(6):
        rows, phrases = plan(seed)
        phase = rows[:, 0] % 3.0
        begin.append(rows[(phase > 0.35) & (phase < 0.9), 2].mean())
        end.append(rows[(phase > 2.45) & (phase < 2.7), 2].mean())
    assert np.mean(begin) > 0.2 > 0.05 > np.mean(end)
    assert len(phrases) == 100


@pytest.mark.slow
def test_who_averts_their_gaze_more_looks_away_more():
    away = [np.mean([plan(seed, averted)[0][:, 2].mean() for seed in range(4)]) for averted in (0.0, 0.15, 0.5)]
    assert away[0] == 0
    assert 0.02 < away[1] < away[2] < 0.45


def test_fixations_last_one_to_four_seconds_and_saccades_are_as_fast_as_eyes():
    gaze, times = GazePlanner(5, 0.25), []
    for tick in range(6000):
        saccade = gaze.decide(tick / 10, [])
        if saccade is not None:
            times.append(saccade.time)
            assert 0.02 < saccade.length < 0.12
    gaps = np.diff(times)
    assert gaps.min() >= 0.3
    assert 0.9 < np.median(gaps) < 3.6
    assert plan(7)[0].tobytes() == plan(7)[0].tobytes() != plan(8)[0].tobytes()
