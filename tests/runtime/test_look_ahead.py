"""A shorter look-ahead: sessions are as late as they say, hear no more than they say, and pieces of any size do not show."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import cospeech
from cospeech.audio.speech import Speech, example
from cospeech.errors import InputError
from cospeech.face.delays import FaceDelays
from cospeech.motion.motion import Motion
from cospeech.rules import LATENCY, LOOK_AHEAD, RuleBasedModel
from cospeech.rules.foresight import LEAST_FACE, USUAL, foresee
from cospeech.rules.stance_layer import StanceLayer
from cospeech.runtime.window_layout import Sliding, WindowLayout
from tests.support.runtime_bundles import same

TARGETS = {  # look-ahead of each, and how late it may be at most
    "rules": (0.5, 0.6),
    "stylised-flow": (0.16, 0.5),
    "mix-stage": (0.16, 0.5),
    "chain-of-generation": (0.2, 0.5),
}
SPOKEN = 4.0


@cache
def model(name: str):
    return cospeech.load(name)


@cache
def load_speech() -> Speech:
    return Speech.load(example()[0]).window(0.0, SPOKEN)


def options_of(name: str) -> dict:
    if name == "face":
        return {"fps": 60, "seed": 2, "look_ahead": 0.25, "parts": ("face",)}
    return {"fps": 30, "seed": 2, "look_ahead": TARGETS[name][0], "stance": name != "rules"}


def play(name: str, seconds: float, samples: np.ndarray | None = None) -> Motion:
    speech = load_speech() if samples is None else Speech(samples)
    session = model("rules" if name == "face" else name).session(**options_of(name))
    motions = [motion for piece in speech.chunks(seconds) for motion in session.push(piece)]
    return Motion.concatenate([*motions, *session.finish()])


def test_settings_of_rules_are_what_is_asked_for_or_less():
    assert foresee(None) is foresee(LOOK_AHEAD) is foresee(float("inf")) is USUAL
    assert USUAL.latency == LATENCY == USUAL.decision + 1 / 30
    assert USUAL.face == FaceDelays()
    before = foresee(0.4)
    for seconds in (0.5, 0.66, 0.8, 1.0, 1.4):
        now = foresee(seconds)
        assert seconds - 0.1 < now.look_ahead <= seconds
        assert now.look_ahead < now.decision < now.look_ahead + 0.05
        assert now.decision < now.latency <= now.decision + 1 / 50
        assert (now.late, -now.horizon, -now.latency) <= (before.late, -before.horizon, -before.latency)
        before = now
    assert foresee(LEAST_FACE, least=LEAST_FACE).latency < 0.25


@pytest.mark.parametrize("seconds", [0.2, -1.0, np.nan, "long", True])
def test_look_aheads_that_rules_cannot_do_with(seconds):
    with pytest.raises(InputError, match="look_ahead"):
        RuleBasedModel().session(look_ahead=seconds)


def test_a_mouth_that_cannot_hurry_is_refused():
    class Slow:
        certain_until = 0.0

    with pytest.raises(InputError, match="mouth"):
        RuleBasedModel(mouth=Slow).session(look_ahead=0.5)  # type: ignore[arg-type]


def test_windows_hold_the_last_row_in_the_place_of_what_is_not_waited_for():
    windows: list[np.ndarray] = []

    def make(rows: np.ndarray, first: int, noise: np.ndarray) -> np.ndarray:
        windows.append(rows[:, 0])
        return np.zeros((1, len(rows), 1), np.float32)

    layout = WindowLayout(window=8, hop=1, ahead=2, fade=1, held=3)
    sliding = Sliding(layout, np.zeros((1, 1), np.float32), lambda count: np.zeros((1, count, 0), np.float32), make)
    assert (layout.past, layout.waits) == (2, 3)
    assert [poses.shape for poses in sliding.push(np.arange(1.0, 5.0, dtype=np.float32)[:, None])] == [(1, 1, 1)] * 2
    assert [window.tolist() for window in windows] == [[0, 0, 1, 2, 3, 3, 3, 3], [0, 1, 2, 3, 4, 4, 4, 4]]


def test_a_stance_that_does_not_wait_gives_each_frame_at_once():
    layer, frames = StanceLayer(seed=1, fps=30, waits=0.0), model("rules").generate(load_speech().window(0, 1), seed=1)
    assert layer.look_ahead == 0
    for k in range(len(frames)):
        assert len(layer.push(frames.rotations[k : k + 1], frames.root[k : k + 1])[0]) == 1
    assert not len(layer.finish()[0])


@pytest.mark.parametrize(("seconds", "latency"), [(0.2, 0.245), (0.25, 0.295), (0.5, 0.565)])
def test_a_model_of_faces_looks_ahead_as_a_face_does(seconds, latency):
    assert model("speech-to-face").session(look_ahead=seconds).latency == pytest.approx(latency)


def test_whole_windows_play_only_where_they_lie_within_the_look_ahead():
    usual, *others = (
        model("chain-of-generation").session(look_ahead=seconds, parts=("body", "hands")).latency
        for seconds in (None, 0.5, 3.0, 4.0)
    )
    assert others[:2] == [usual, usual]
    assert 3.0 < others[2] <= 4.0


@pytest.mark.slow
@pytest.mark.parametrize("name", [*TARGETS, "face"])
def test_pieces_do_not_show(name):
    whole = play(name, SPOKEN)
    assert len(whole) == SPOKEN * whole.fps
    for seconds in (0.02, 0.0137, 1 / 30, 0.33):
        assert same(play(name, seconds), whole)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*TARGETS, "face"])
def test_sessions_are_as_late_as_they_say(name):
    session = model("rules" if name == "face" else name).session(**options_of(name))
    samples, count, late = 0, 0, []
    for chunk in load_speech().chunks(0.01):
        samples += len(chunk)
        count += sum(len(piece) for piece in session.push(chunk))
        late.append(samples / 16_000 - count / options_of(name)["fps"])
    most = 0.30 if name == "face" else TARGETS[name][1]
    assert session.latency - 0.1 < max(late) <= session.latency <= most
    assert 0 < session.look_ahead <= session.latency


@pytest.mark.slow
@pytest.mark.parametrize("name", [*TARGETS, "face"])
def test_frames_depend_on_no_more_than_the_look_ahead(name):
    session = model("rules" if name == "face" else name).session(**options_of(name))
    whole = play(name, 1.0)
    for at in (1.7, 2.93):
        samples = load_speech().samples.copy()
        first = round(at * 16_000)
        samples[first:] = np.random.default_rng(0).normal(size=len(samples) - first) * 0.2
        frames = int(np.floor((at - session.look_ahead) * whole.fps))
        assert same(whole[:frames], play(name, 1.0, samples.astype(np.float32))[:frames])
