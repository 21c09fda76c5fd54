"""A character that listens: when it responds, and what the frames show."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import cospeech
from cospeech.audio.backchannel_cues import BackchannelCue
from cospeech.audio.conversation import HeardSpeaker, VoiceTrack
from cospeech.audio.prosodic_events import Phrase
from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.face.gaze import direction_of, head_rotation
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_angle, quat_multiply
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from cospeech.runtime.attention import AttentionShift
from cospeech.runtime.listening import ListeningLayer, Response, find_listening, plan_responses
from tests.support.rules_laws import babble, find_broken_laws

SHIFTS = (AttentionShift(0.0, 25.0), AttentionShift(1.0, -30.0), AttentionShift(2.2, 10.0))
NOD = Response(1.0, 2, np.radians(6.0), 0.4, 0.0, 1.0, 0.0, 0.5)


def person(phrases, cues=()):
    spans = tuple(Phrase(*each) for each in phrases)
    return HeardSpeaker(VoiceTrack("x.wav"), np.ones(1), Fraction(60), spans, tuple(cues))


def talk(minutes=20):
    """Somebody who makes a phrase of 2.5 s every 3 s."""
    starts = np.arange(0, 60 * minutes, 3.0)
    return person([(start, start + 2.5) for start in starts], [BackchannelCue(start + 2.5, "pause") for start in starts])


@pytest.fixture(scope="module")
def still():
    """Four seconds of the rules in silence."""
    return cospeech.load("rules").generate(Speech(np.zeros(64_000, np.float32)), seed=3)


def test_a_listener_responds_some_ten_times_a_minute_and_never_twice_at_once():
    responses = plan_responses(person([]), talk(), seed=1)
    times = np.array([each.time for each in responses])
    assert 8 < len(times) / 20 < 15, "a minute in which the other one speaks, with pauses"
    assert np.diff(times).min() >= 2.2
    late = (times - 2.5) % 3
    assert np.all((late >= 0.04) & (late <= 0.46)), "after the end of a phrase"


def test_seeds_respond_differently_and_one_seed_always_alike():
    first, again, other = (plan_responses(person([]), talk(), seed=seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_nobody_nods_while_speaking_or_just_before():
    own = [(start - 0.2, start + 3.0) for start in np.arange(10.0, 1200.0, 20.0)]
    for each in plan_responses(person(own), talk(), seed=5):
        assert not any(low - 0.7 < each.time < high for low, high in own), each


def test_a_row_of_nods_is_over_when_own_speech_begins():
    own = [(start - 0.2, start + 3.0) for start in np.arange(10.0, 6000.0, 6.0)]
    responses = plan_responses(person(own), talk(100), seed=5)
    assert max(each.nods for each in responses) == 3
    starts = np.array([low for low, _ in own] + [np.inf])
    for each in responses:
        assert each.time + each.nods * each.pace <= starts[np.searchsorted(starts, each.time)], each


def test_a_short_sound_while_the_other_one_goes_on_is_a_response_and_is_nodded():
    own = [(start + 1.0, start + 1.4) for start in np.arange(0.0, 1200.0, 9.0)]  # "mhm" in the middle of a phrase
    times = {each.time for each in plan_responses(person(own), person([(0.0, 1200.0)]), seed=2)}
    assert len(times & {low for low, _ in own}) > 0.7 * len(own)
    assert find_listening(person(own), person([(0.0, 1200.0)])) == [(0.0, 1200.0)], "who says mhm goes on listening"


def test_listening_ends_where_own_speech_begins():
    speaker, listener = person([(0, 4), (4.8, 9), (15, 20)]), person([(8.5, 12.0)])
    assert find_listening(listener, speaker) == [(0, 8.5), (15, 20)]


def test_a_nod_lowers_the_head_and_the_eyes_stay_on_the_other_one(still):
    nodding = ListeningLayer([NOD], [], seed=0).apply(still)
    before, after = (np.degrees(direction_of(head_rotation(each.rotations))) for each in (still, nodding))
    during = (still.times > 1.0) & (still.times < 1.8)
    assert 5.0 < (before - after)[during, 1].max() < 6.5
    assert np.abs(before - after)[~during].max() < 0.05
    assert np.array_equal(still.rotations[~during], nodding.rotations[~during]) or np.allclose(
        still.rotations[~during], nodding.rotations[~during], atol=2e-6
    )
    for eye in (still.skeleton.index["leftEye"], still.skeleton.index["rightEye"]):
        looks = [
            direction_of(quat_multiply(head_rotation(each.rotations), each.rotations[:, eye].astype(float)))
            for each in (still, nodding)
        ]
        assert np.degrees(np.abs(looks[0] - looks[1])).max() < 1.0


def test_only_neck_head_and_eyes_turn_and_the_face_keeps_its_mouth(still):
    layer = ListeningLayer([replace_smile(NOD)], [(0.0, 3.0)], seed=4)
    result = layer.apply(still)
    turns = quat_angle(still.rotations.astype(float), result.rotations.astype(float)).max(0) > 1e-3
    assert {name for name, yes in zip(still.skeleton.names, turns, strict=True) if yes} == {
        "neck",
        "head",
        "leftEye",
        "rightEye",
    }
    assert np.array_equal(still.root, result.root)
    weights = {name for name, k in ARKIT_INDEX.items() if np.abs(still.face[:, k] - result.face[:, k]).max() > 0.01}
    assert {"mouthSmileLeft", "mouthSmileRight", "browInnerUp"} <= weights
    assert not {name for name in weights if name.startswith(("jaw", "mouth")) and "Smile" not in name}
    assert result.face.min() >= 0
    assert result.face.max() <= 1


def replace_smile(response):
    return response._replace(smile=0.4, brows=0.3)


def test_pieces_give_what_the_whole_gives(still):
    layer = ListeningLayer([NOD, NOD._replace(time=3.1)], [(0.5, 2.7)], seed=4, shifts=SHIFTS)
    whole = layer.apply(still)
    parts = Motion.concatenate([layer.apply(still[k : k + 7]) for k in range(0, len(still), 7)])
    assert np.abs(whole.rotations - parts.rotations).max() < 1e-6
    assert np.abs(whole.face - parts.face).max() < 1e-6


@pytest.mark.parametrize("angle", [-40.0, 40.0])
def test_head_and_eyes_go_to_the_side_where_the_other_one_is(still, angle):
    result = ListeningLayer([], [], shifts=[AttentionShift(0.0, angle)]).apply(still)
    head = [np.degrees(direction_of(head_rotation(each.rotations)))[:, 0] for each in (still, result)]
    turn = np.median(head[1] - head[0])
    assert 0.6 < turn / angle < 0.9
    eye = still.skeleton.index["leftEye"]
    looks = [
        np.degrees(direction_of(quat_multiply(head_rotation(m.rotations), m.rotations[:, eye].astype(float))))[:, 0]
        for m in (still, result)
    ]
    assert abs(np.median(looks[1] - looks[0]) - angle) < 4


@pytest.mark.parametrize("angle", [-60.0, 60.0])
def test_a_head_that_is_turned_already_turns_no_further_than_a_neck_can(angle):
    speech = Speech(babble(3, 12.0), 16_000)
    bare = cospeech.load("rules").generate(speech, seed=3, intensity=2.0).retarget("humanoid")
    nods = [Response(time, 3, np.radians(8.0), 0.34, 0.4, 2.0, 0.4, 0.9) for time in np.arange(0.5, 12.0, 2.2)]
    result = ListeningLayer(nods, [(0.5, 12.0)], seed=4, intensity=2.0, shifts=[AttentionShift(0.0, angle)]).apply(bare)
    assert not find_broken_laws(bare, stand=True)
    assert not find_broken_laws(result, stand=True)


def test_intensity_0_shows_nothing_and_a_motion_without_a_face_is_taken(still):
    layer = ListeningLayer([replace_smile(NOD)], [(0.0, 3.0)], intensity=0.0)
    result = layer.apply(still)
    assert np.abs(quat_angle(still.rotations.astype(float), result.rotations.astype(float))).max() < 2e-3
    assert np.abs(result.face - still.face).max() < 2e-3
    bare = replace(still, face=None)
    assert ListeningLayer([NOD], [(0.0, 3.0)]).apply(bare).face is None


@pytest.mark.parametrize("angle", [75.0, float("nan"), "left", None])
def test_an_angle_behind_the_shoulder_is_refused(angle):
    with pytest.raises(InputError, match=r"(75|nan|'left'|None) degrees.*turn the character"):
        ListeningLayer([], [], shifts=[AttentionShift(0.0, 0.0), AttentionShift(3.0, angle)])
