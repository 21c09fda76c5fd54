"""Arousal: a voice against its own baseline, and what it changes in movement."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.prosodic_events import RATE, Accent, Heard
from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.rules import EMOTIONS, RuleBasedModel
from cospeech.rules.arousal import Arousal, amplitude, arouse, loudness_rate_pitch
from cospeech.rules.emotion_modifiers import MANNERS


def heard(louder: float = 0.0, higher: float = 0.0, seconds: float = 3.0, speaking: bool = True) -> Heard:
    """Speech so many dB louder and semitones higher than usual."""
    n = round(seconds * RATE)
    bands = np.full((n, 5), -20.0) + louder
    on = np.full(n, float(speaking))
    return Heard(0, 0.8 * on, higher * on, on, np.zeros(n), bands)


def accents(per_second: float) -> list[Accent]:
    return [Accent(t, 0.5) for t in np.arange(0.05, 3.0, 1 / per_second)]


def level(*looks: tuple[float, float, float], usual: int = 40) -> float:
    """After forty looks at a voice as it usually speaks, and these louder, higher, faster ones."""
    arousal = Arousal()
    for _ in range(usual):
        arousal.follow(heard(), accents(3.0))
    for louder, higher, rate in looks:
        arousal.follow(heard(louder, higher), accents(rate))
    return arousal.level


def test_louder_higher_and_faster_than_usual_is_aroused_and_the_other_way_round():
    assert level() == pytest.approx(0.0, abs=1e-9)
    for look in ((6.0, 0.0, 3.0), (0.0, 4.0, 3.0), (0.0, 0.0, 5.0)):
        assert level(*[look] * 8) > 0.1
    assert level(*[(6.0, 4.0, 5.0)] * 8) > 0.5
    assert level(*[(-6.0, -4.0, 1.5)] * 8) < -0.5


def test_the_baseline_is_the_voices_own():
    """A microphone's gain and a high voice are no arousal."""
    loud = Arousal()
    for _ in range(60):
        loud.follow(heard(30.0, 8.0), accents(5.0))
        assert abs(loud.level) < 1e-9
    assert abs(level(*[(6.0, 4.0, 5.0)] * 400)) < 0.2  # who shouts for minutes is used to it


def test_it_is_careful_at_first_never_jumps_and_fades_in_silence():
    assert level((6.0, 4.0, 5.0), usual=1) < level((6.0, 4.0, 5.0), usual=40)
    arousal, before = Arousal(), 0.0
    for k in range(120):
        arousal.follow(heard(12.0 * (k % 2), 6.0 * (k % 2)), accents(3.0))
        assert abs(arousal.level - before) <= 0.3
        assert -1 <= arousal.level <= 1
        before = arousal.level
    for _ in range(30):
        arousal.follow(heard(speaking=False), [])
    assert abs(arousal.level) < 0.01
    assert loudness_rate_pitch(heard(speaking=False), []) is None


def test_arousal_makes_movement_larger_and_quicker_and_names_no_emotion():
    calm, excited = (arouse(MANNERS["neutral"], amount) for amount in (-1.0, 1.0))
    for name in ("amplitude", "rate", "tempo", "torso", "head"):
        assert getattr(calm, name) < getattr(MANNERS["neutral"], name) < getattr(excited, name)
    assert arouse(MANNERS["anger"], 0.0) == MANNERS["anger"]


def test_levels_are_known_at_any_time_from_the_first_look_on():
    arousal, levels = Arousal(), []
    assert arousal.at(np.array([0.0, 3.0])).tolist() == [0.0, 0.0]
    for k in range(40):
        arousal.follow(heard(6.0 * (k > 20), 0.0), accents(3.0))
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


@pytest.mark.slow
def test_auto_plays_no_category_and_reports_both():
    speech = Speech(np.resize(Speech.load(EXAMPLE).samples, 12 * 16_000))
    session = RuleBasedModel().session(emotion="auto", parts=("face",))
    list(session.push(speech))
    list(session.finish())
    assert session.expression == {name: float(name == "neutral") for name in EMOTIONS}
    assert -1 < session.arousal < 1
    assert session.arousal != 0
    assert sum(session.emotion.values()) == pytest.approx(1)
    named = RuleBasedModel().session(emotion="fear", parts=("face",))
    list(named.push(speech))
    assert (named.expression["fear"], named.arousal) == (pytest.approx(1), None)
