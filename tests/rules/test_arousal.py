"""Arousal: followed over looks at a voice, and what it changes in movement; categories are played where they are sure."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.emotions import EmotionTrack
from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.rules import EMOTIONS, RuleBasedModel
from cospeech.rules.arousal import Arousal, amplitude, arouse
from cospeech.rules.emotion_modifiers import MANNERS
from cospeech.rules.mood import Mood


def level(*looks: float | None, usual: int = 40) -> float:
    """The arousal after ``usual`` looks at a neutral voice, and then these looks."""
    arousal = Arousal()
    for one in (0.0,) * usual + looks:
        arousal.follow(one)
    return arousal.level


def test_what_is_heard_is_played():
    assert level() == pytest.approx(0.0, abs=1e-9)
    assert level(*[0.8] * 12) > 0.5
    assert level(*[-0.8] * 12) < -0.5


def test_it_is_careful_at_first_never_jumps_and_fades_in_silence():
    assert level(1.0, usual=1) < level(1.0, usual=40)
    arousal, before = Arousal(), 0.0
    for k in range(120):
        arousal.follow(3.0 * (-1) ** k)
        assert abs(arousal.level - before) <= 0.5
        assert -1 <= arousal.level <= 1
        before = arousal.level
    for _ in range(30):
        arousal.follow(None)
    assert abs(arousal.level) < 0.01


def test_arousal_makes_movement_larger_and_quicker_and_names_no_emotion():
    calm, lively = (arouse(MANNERS["neutral"], amount) for amount in (-1.0, 1.0))
    for name in ("amplitude", "rate", "tempo", "torso", "head"):
        assert getattr(calm, name) < getattr(MANNERS["neutral"], name) < getattr(lively, name)
    assert arouse(MANNERS["anger"], 0.0) == MANNERS["anger"]


def test_levels_are_known_at_any_time_from_the_first_look_on():
    arousal, levels = Arousal(), []
    assert arousal.at(np.array([0.0, 3.0])).tolist() == [0.0, 0.0]
    for k in range(40):
        arousal.follow(0.5 * (k > 20))
        levels.append(arousal.level)
    times = np.array([-1.0, 0.0, 10.25, 12.0, 19.5])
    expected = [0.0, levels[0], (levels[20] + levels[21]) / 2, levels[24], levels[39]]
    assert arousal.at(times) == pytest.approx(expected)
    assert arousal.at(times[2:]) == pytest.approx(expected[2:])  # what is before is forgotten, and the rest is as it was
    assert len(arousal._levels) == 20
    assert arousal.mean == pytest.approx(np.mean(levels))


def test_a_usual_voice_does_not_change_learned_poses_and_an_aroused_one_enlarges_them():
    factors = amplitude(np.array([-1.0, -0.2, 0.0, 0.2, 0.6, 1.0]))
    assert factors[1:4].tolist() == [1.0, 1.0, 1.0]
    assert factors[0] < 0.7 < 1.1 < factors[4] < factors[5] <= 1.4


class Category:
    """A classifier that is sure of one emotion after ``since`` looks."""

    def __init__(self, emotion: str, since: int) -> None:
        self.probabilities_then, self.since, self.looks = np.eye(8)[EMOTIONS.index(emotion)], since, 0
        self.played = self.probabilities = np.eye(8)[0]

    def follow(self, look: object) -> np.ndarray:
        self.looks += 1
        self.played = self.probabilities = self.probabilities_then if self.looks > self.since else np.eye(8)[0]
        return self.played


def test_a_category_that_is_surely_heard_is_played_and_after_a_change_it_is_played_again():
    mood, anger = Mood(), EMOTIONS.index("anger")
    mood._category = Category("anger", 10)
    for k in range(20):
        mood.follow(0.5 * k)
    assert mood.probabilities[anger] == 1
    assert mood.expression["anger"] == mood.guess["anger"] == pytest.approx(0.5)
    mood.change(EmotionTrack.constant("sadness"), 10.0)
    assert mood.track.at(np.array([9.9, 12.0]))[:, anger].tolist() == [1.0, 0.0]
    for k in range(20, 40):
        mood.listen(0.5 * k)
    mood.change(None, 15.0)
    assert mood.track.at(np.array([14.9, 17.0]))[:, anger].tolist() == [0.0, 1.0]


def test_the_voice_may_be_followed_only_later_and_for_hours():
    mood, fear = Mood(EmotionTrack.constant("sadness")), EMOTIONS.index("fear")
    mood._category = Category("fear", 4)
    mood.change(None, 5.0)
    for k in range(10, 1000):
        mood.listen(0.5 * k)
        if k == 30:
            shares = mood.track.at(np.array([5.0, 7.0, 7.25, 7.5, 9.0]))
            np.testing.assert_allclose(shares[:, fear], [0, 0, 0.5, 1, 1])  # half a second after the fifth look, at 7 s
    assert len(mood._course._looks) <= 80
    assert mood.track.at(np.array([490.0, 499.0]))[:, fear].tolist() == [1.0, 1.0]


@pytest.mark.slow
def test_auto_stays_neutral_on_a_reader_and_reports_what_is_heard():
    speech = Speech(np.resize(Speech.load(EXAMPLE).samples, 12 * 16_000))
    session = RuleBasedModel().session(emotion="auto", parts=("face",))
    list(session.push(speech))
    list(session.finish())
    assert session.expression["neutral"] > 0.95
    assert -1 < session.arousal < 1
    assert session.arousal != 0
    assert sum(session.emotion.values()) == pytest.approx(1)
    afraid = RuleBasedModel().session(emotion="fear", parts=("face",))
    list(afraid.push(speech))
    assert (afraid.expression["fear"], afraid.arousal) == (pytest.approx(1), None)
