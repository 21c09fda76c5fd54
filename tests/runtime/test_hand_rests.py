"""Hands of trained models that rest while somebody speaks: when they go down, when they come up, and in pieces of any size."""

from __future__ import annotations

import numpy as np
import pytest

import cospeech
from cospeech import Speech
from cospeech.audio.prosodic_events import Accent
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.part_joints import arm_joints
from cospeech.motion.rotations import quat_angle, quat_identity
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.beat_alignment import LEAD, AccentTrack
from cospeech.runtime.hand_rests import HandRests
from cospeech.runtime.rest_in_silence import resting_pose

LEFT, ARM = (humanoid().index[f"{side}UpperArm"] for side in ("left", "right"))


class Known(AccentTrack):
    """Accents that are all known, as strong as is said."""

    def __init__(self, times: list[float], strength: float = 0.6) -> None:
        super().__init__()
        self._times, self._accents = list(times), [Accent(time, strength) for time in times]
        self.known = np.inf


def tpose(seconds: float, fps: float, tremble: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Somebody who keeps the arms out to the sides, far from where they rest."""
    count = round(seconds * fps)
    rotations = np.broadcast_to(quat_identity(1), (count, len(humanoid()), 4)).astype(np.float32).copy()
    if tremble:
        rotations += np.random.default_rng(0).normal(0, tremble, rotations.shape).astype(np.float32)
        rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    return rotations, np.zeros((count, 3), np.float32)


def play(
    track: AccentTrack, seconds: float, *, fps: float = 30.0, seed: int = 0, piece: int | None = None, tremble: float = 0.0
) -> np.ndarray:
    """The rotations that the layer gives for pieces of ``piece`` frames."""
    rotations, root = tpose(seconds, fps, tremble)
    layer = HandRests(fps, track, seed)
    size = piece or len(rotations)
    pieces = [layer.push(rotations[k : k + size], root[k : k + size]) for k in range(0, len(rotations), size)]
    pieces.append(layer.finish())
    whole = np.concatenate([part for part, _ in pieces])
    assert len(whole) == len(rotations) == sum(len(part) for _, part in pieces)
    return whole


def measure_rest(rotations: np.ndarray, arm: int = ARM) -> np.ndarray:
    """(n,) how far an arm is on its way to rest, 0 … 1."""
    way = quat_angle(rotations[:, arm].astype(float), np.broadcast_to(quat_identity(1), (len(rotations), 4)))
    return way / quat_angle(quat_identity(1), resting_pose()[None, arm].astype(float))


def spells_of(down: np.ndarray, fps: float) -> np.ndarray:
    """Seconds of each rest."""
    return np.diff(np.flatnonzero(np.diff(np.concatenate([[0], (down > 0.5).astype(int), [0]]))))[::2] / fps


def near_rest(rotations: np.ndarray) -> float:
    """Share of the time of both arms in which they are less than 0.25 rad from where they rest."""
    arms = [LEFT, ARM]
    return float(np.mean(quat_angle(rotations[:, arms].astype(float), resting_pose()[None, arms].astype(float)) < 0.25))


def test_hands_rest_for_a_part_of_the_time_and_gesture_for_most_of_it():
    rotations = play(Known(list(np.arange(0.4, 600, 0.6))), 600.0)
    down = np.maximum(measure_rest(rotations, LEFT), measure_rest(rotations))
    assert down.max() < 0.92  # a hand that rests still lives a little
    spells = spells_of(down, 30.0)
    assert 0.15 < (down > 0.5).mean() < 0.35
    assert 4 < 60 * len(spells) / 600 < 9  # rests in a minute
    assert np.median(spells) > 1.5


def test_often_one_hand_rests_and_the_other_goes_on():
    takes = [play(Known(list(np.arange(0.4, 600, 0.6))), 600.0, seed=seed) for seed in range(3)]
    left, right = (np.concatenate([measure_rest(one, arm) > 0.5 for one in takes]) for arm in (LEFT, ARM))
    both, some = (left & right).mean(), (left | right).mean()
    assert 0.35 < both / some < 0.65
    assert (left & ~right).mean() > 0.15 * some < (right & ~left).mean()
    one_at_rest = play(Known(list(np.arange(0.4, 600, 0.6))), 600.0, tremble=0.1)
    own = tpose(600.0, 30.0, 0.1)[0]
    alone = (measure_rest(one_at_rest, LEFT) > 0.9) & (one_at_rest[:, ARM] == own[:, ARM]).all(-1)
    assert alone.any()  # the hand that goes on keeps its bits


def test_hands_go_down_where_no_accent_is_near_and_come_up_on_one():
    bars = np.arange(0.0, 400.0, 2.5)  # three accents in each, and then 1.5 s of nothing
    times = [bar + more for bar in bars for more in (0.2, 0.7, 1.2)]
    clear = [(bar + 1.2, bar + 2.7 - 0.7) for bar in bars]
    down = measure_rest(play(Known(times), 400.0, fps=100.0))
    speed = np.gradient(down) * 100
    ways_down = [k / 100 for k in np.flatnonzero((down[1:] > 0) & (down[:-1] == 0))]
    ups = [k / 100 for k in range(50, len(speed) - 50) if speed[k] < -0.5 and speed[k] == speed[k - 50 : k + 50].min()]
    assert min(len(ways_down), len(ups)) > 20
    assert all(any(start <= time <= end for start, end in clear) for time in ways_down)
    assert all(min(abs(time - LEAD - up) for time in times) < 0.03 for up in ups)


def test_weak_accents_do_not_raise_the_hands_until_they_have_waited_long():
    down = measure_rest(play(Known(list(np.arange(0.4, 120, 0.6)), strength=0.1), 120.0))
    strong = measure_rest(play(Known(list(np.arange(0.4, 120, 0.6))), 120.0))
    assert (down > 0.85).mean() > (strong > 0.85).mean() + 0.1


def test_a_bout_begins_after_a_pause():
    """Where pauses come more often than bouts end, hands rest in them, and not in the speech as well."""
    phrases = [bar + more for bar in np.arange(0.0, 120.0, 5.0) for more in np.arange(0.2, 3.0, 0.4)]
    speaks = (np.arange(3600) / 30 % 5 > 0.2) & (np.arange(3600) / 30 % 5 < 2.8)
    assert measure_rest(play(Known(phrases), 120.0))[speaks].max() < 0.05
    assert measure_rest(play(Known(list(np.arange(0.2, 120, 0.4))), 120.0)).max() > 0.5
    for seed in range(8):  # also where the bout before it ended in the pause
        down = measure_rest(play(Known([*np.arange(0.2, 4, 0.3), *np.arange(7.0, 12, 0.3)]), 12.0, fps=50.0, seed=seed))
        assert down[360:500].max() < 0.05


@pytest.mark.parametrize("fps", [15.0, 24.0, 30.0, 59.94, 120.0])
def test_pieces_of_any_size_are_the_whole(fps):
    track = Known(list(np.arange(0.3, 30, 0.77)))
    whole = play(track, 30.0, fps=fps, tremble=0.1)
    for piece in (1, 7, 100):
        np.testing.assert_array_equal(play(track, 30.0, fps=fps, piece=piece, tremble=0.1), whole)
    assert not (play(track, 30.0, fps=fps, seed=1, tremble=0.1) == whole).all()


def test_a_frame_waits_until_its_accents_are_known():
    track = Known(list(np.arange(0.3, 30, 0.77)))
    track.known = 5.0
    layer = HandRests(30.0, track, 0)
    rotations, root = tpose(10.0, 30.0)
    first, _ = layer.push(rotations, root)
    assert 3.5 * 30 < len(first) < 5.0 * 30
    track.known = np.inf
    assert len(first) + len(layer.finish()[0]) == len(rotations)


def test_only_arms_and_hands_are_led():
    rotations = play(Known(list(np.arange(0.4, 60, 0.6))), 60.0)
    others = [k for k in range(len(humanoid())) if k not in arm_joints()]
    assert (rotations[:, others] == tpose(60.0, 30.0)[0][:, others]).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mix-stage", "chain-of-generation", "stylised-flow"])
def test_hands_of_files_reach_down_while_somebody_speaks(name):
    """Without it the lowest twentieth of the heights lies well above where hands rest."""
    model, speech = cospeech.load(name), Speech.load(EXAMPLE, rate=16_000)
    options = {**model.for_files, "fps": 30, "parts": ("body", "hands"), "emotion": "neutral"}
    shares = []
    for rests in (False, True):
        takes = model.generate_takes(speech, takes=4, **{**options, "rests": rests})
        shares.append(np.mean([near_rest(take.rotations) for take in takes]))
    assert shares[1] > shares[0] + 0.05
    assert shares[1] < 0.6


def test_streams_have_them_where_they_cost_no_time():
    model = cospeech.load("mix-stage")
    plain, rests = (cospeech.open_live_session(model=model, rests=on) for on in (False, True))
    assert plain.latency == rests.latency == cospeech.open_live_session(model=model).latency
    for options in ({"look_ahead": 0.5}, {"parts": ("body", "hands")}):  # there they would
        usual = cospeech.open_live_session(model=model, **options)
        assert usual.latency < cospeech.open_live_session(model=model, rests=True, **options).latency


def test_hands_of_a_stream_rest_while_somebody_speaks():
    speech = Speech.load(EXAMPLE, rate=16_000)
    near = []
    for options in ({"rests": False}, {}):
        session = cospeech.open_live_session(model="mix-stage", emotion="neutral", seed=3, **options)
        pieces = [motion for chunk in speech.chunks(0.5) for motion in session.push(chunk)] + [*session.finish()]
        near.append(near_rest(np.concatenate([piece.rotations for piece in pieces])))
    assert near[1] > near[0] + 0.05
