"""The form of single movements, and hands that beat for long."""

from random import Random

import numpy as np
import pytest

import cospeech
from cospeech.audio.prosodic_events import Accent, Phrase
from cospeech.audio.speech import Speech, example
from cospeech.motion.kinematics.hands import CHANNELS
from cospeech.motion.skeleton import humanoid
from cospeech.rules import STYLES
from cospeech.rules.emotion_modifiers import EmotionModifier
from cospeech.rules.plan import Planner
from cospeech.rules.strokes import draw_beat, recoil

GAP = 0.55  # seconds from accent to accent: short enough for beats of a raised hand


def perform(style: str, seconds: float, seed: int = 0) -> tuple[list[tuple], list[tuple]]:
    """Accents without a pause: where each hand goes, tick by tick; and what is planned."""
    planner = Planner(STYLES[style], seed=seed)
    accents = [Accent(time, 0.8) for time in np.arange(0.6, seconds, GAP)]
    states, gestures = [], []
    for tick in range(int(10 * seconds)):
        now = tick / 10
        past_accents = [accent for accent in accents if accent.time < now + 1.2]
        new_gestures = planner.decide(
            now, accents=past_accents, phrases=[Phrase(0.2, seconds)], words=(), modifier=EmotionModifier()
        )
        gestures += [(round(g.stroke, 3), g.form, g.hands) for g in new_gestures]
        states += [(now, hand.place, hand.track.target[:3].copy(), hand.gesture_end) for hand in planner.hands]
    return states, gestures


def test_beats_do_not_carry_a_raised_hand_beside_the_hip():
    target, draw = np.zeros(CHANNELS), Random(0)
    target[:3] = 0.2, -0.6, 0.5
    heights = []
    for _ in range(12):
        up, down = draw_beat(draw, 0.25)
        target = target + up + down
        target = target + recoil(up + down, target)
        heights.append(target[1])
    assert heights[0] < -0.6  # it tires
    assert min(heights) >= -0.77
    assert target[2] <= 0.61


@pytest.mark.parametrize("style", ["natural", "lively", "seated"])
def test_no_raised_hand_ends_below_the_belly(style):
    states, gestures = perform(style, 60.0)
    assert sum(form == "beat" for _, form, _ in gestures) > 10
    places = np.array([place for _, where, place, _ in states if where == "up"])
    assert (places[:, 1] < -0.85).mean() < 0.02


@pytest.mark.parametrize("style", ["natural", "calm", "seated"])
def test_no_hand_stays_up_for_long_after_its_last_gesture(style):
    states, _ = perform(style, 120.0)
    assert max(now - gesture_end for now, where, _, gesture_end in states if where == "up") < 8.0


def test_two_styles_with_one_seed_plan_different_gestures():
    (_, one), (_, same), (_, other) = (perform(name, 20.0) for name in ("natural", "natural", "lively"))
    assert one == same
    alike = {(time, form) for time, form, _ in one} & {(time, form) for time, form, _ in other}
    assert len(alike) < 0.3 * len(one)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4, 5, 6])
def test_a_raised_hand_does_not_hide_the_face(seed):
    """Large gestures of an angry speaker pass beside or below the face; a fingertip may brush by."""
    s, speech = humanoid(), Speech.load(example()[0])
    motion = cospeech.load("rules").generate(speech, style="lively", emotion="anger", seed=seed, parts=("body", "hands"))
    points = motion.positions()
    tips = [s.index[f"{side}{part}"] for side in ("left", "right") for part in ("Hand", "MiddleDistal", "IndexDistal")]
    away = points[:, tips] - points[:, [s.index["head"]]]
    hidden = (abs(away[..., 0]) < 0.06) & (away[..., 1] > 0) & (away[..., 1] < 0.2) & (away[..., 2] > 0.03)
    assert not hidden.any()
