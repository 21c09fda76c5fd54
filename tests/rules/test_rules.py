"""The rule-based gesturer: its parts one by one, and what a user asks of it."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import combinations
from random import Random

import numpy as np
import pytest

from cospeech import InputError, Motion, Speech, Word, humanoid
from cospeech.audio.event_detection import EventDetector, listen
from cospeech.motion.kinematics.arms import arm_lengths, hand_turns, reach, solve_arm
from cospeech.motion.kinematics.body import Body
from cospeech.motion.kinematics.body_volume import push_from_head, push_from_torso
from cospeech.motion.kinematics.hands import HAND_SHAPES
from cospeech.motion.noise import hash_normal, hash_uniform, smooth_noise
from cospeech.motion.rotations import quat_angle, quat_rotate
from cospeech.rules import EMOTIONS, LOOK_AHEAD, STYLES, RuleBasedModel, Style
from cospeech.rules.emotion_modifiers import MANNERS, blend_modifiers
from cospeech.rules.lexicon import _OTHERS, _OTHERS_FREQUENT, LEXICON, form_for
from cospeech.rules.minimum_jerk import MinimumJerkTrack, minimum_jerk
from cospeech.rules.plan import LEAD
from cospeech.rules.posture import Posture
from cospeech.rules.repertoire import FORMS, LEXICAL_FORMS
from cospeech.rules.rest_poses import RESTS
from cospeech.rules.styles import mix_styles
from tests.support.rules_laws import babble

RATE = 16000


def pulses(seconds: float, at: list[float], *, quiet: float = 0.0, seed: int = 0) -> Speech:
    """Voiced bursts of 0.2 s around the given times over a little room noise."""
    t = np.arange(int(seconds * RATE)) / RATE
    voice = sum(np.sin(2 * np.pi * 140 * k * t) / k for k in range(1, 12))
    loud = sum(np.exp(-0.5 * ((t - moment) / 0.055) ** 2) for moment in at)
    noise = np.random.default_rng(seed).normal(0, 1e-4, len(t))
    return Speech(((0.2 * loud + quiet) * voice + noise).astype(np.float32), RATE)


def rhythm(count: int = 24, gap: float = 0.62, first: float = 0.8) -> list[float]:
    return [first + gap * k for k in range(count)]


class TestNoise:
    def test_it_is_a_function_of_time_alone(self):
        times = np.arange(0, 20, 1 / 30)
        whole = smooth_noise(5, 3, times, 0.4)
        assert np.array_equal(whole[200:231], smooth_noise(5, 3, times[200:231], 0.4))
        assert np.array_equal(whole[::-1], smooth_noise(5, 3, times[::-1], 0.4))

    def test_unit_variance_no_mean_other_seed_other_noise(self):
        times = np.arange(0, 4000, 0.1)
        a, b = smooth_noise(1, 2, times, 0.5), smooth_noise(2, 2, times, 0.5)
        assert np.abs(a.std(0) - 1).max() < 0.08
        assert np.abs(a.mean(0)).max() < 0.08
        assert abs(np.corrcoef(a[:, 0], b[:, 0])[0, 1]) < 0.08
        assert abs(np.corrcoef(a[:, 0], a[:, 1])[0, 1]) < 0.08

    def test_hashes_are_spread_evenly_and_do_not_repeat(self):
        u = hash_uniform(7, 3, np.arange(50_000))
        assert u.min() > 0
        assert u.max() < 1
        assert len(np.unique(u)) == len(u)
        assert np.abs(np.histogram(u, 20, (0, 1))[0] / 2500 - 1).max() < 0.1
        assert abs(hash_normal(7, 3, np.arange(50_000)).std() - 1) < 0.02


class TestTrack:
    def test_a_move_ends_at_its_goal_with_the_minimum_jerk_profile(self):
        track = MinimumJerkTrack(np.array([1.0, -2.0]))
        track.move(1.0, 0.5, np.array([3.0]), [0])
        times = np.array([0.0, 1.0, 1.25, 1.5, 9.0])
        assert np.allclose(track.at(times)[:, 0], [1, 1, 2, 3, 3])
        assert np.allclose(track.at(times)[:, 1], -2)
        speed = np.gradient(track.at(np.linspace(1, 1.5, 2001))[:, 0], 0.5 / 2000)
        assert abs(speed.max() - 1.875 * 2 / 0.5) < 1e-3  # Flash & Hogan: peak = 15/8 of the mean speed

    def test_moves_may_overlap_and_still_reach_the_last_goal(self):
        track = MinimumJerkTrack(np.zeros(1), np.array([0.1]))
        track.move(0.0, 1.0, np.array([5.0]))
        track.move(0.5, 1.0, np.array([-1.0]))
        assert track.at(np.array([10.0]))[0, 0] == pytest.approx(-1.0)
        assert track.target[0] == -1.0

    def test_forgetting_what_is_over_changes_nothing_later(self):
        rng, track = np.random.default_rng(0), MinimumJerkTrack(np.zeros(3), np.array([0, 0.05, 0.1]))
        for k in range(40):
            track.move(k * 0.3, 0.6, rng.normal(size=3))
        later = np.linspace(7, 14, 50)
        before = track.at(later)
        track.forget(6.9)
        assert len(track._deltas) < 25
        assert np.allclose(track.at(later), before, atol=1e-12)

    def test_progress_is_monotonous_from_0_to_1(self):
        s = minimum_jerk(np.linspace(-1, 2, 500))
        assert s[0] == 0
        assert s[-1] == 1
        assert (np.diff(s) >= 0).all()


class TestArms:
    rng = np.random.default_rng(1)
    targets = rng.uniform((-0.15, -0.5, 0.02), (0.35, 0.25, 0.45), (500, 3))

    def test_the_wrist_arrives_where_it_is_sent(self):
        target = reach(self.targets)
        upper, fore = solve_arm(target, self.rng.uniform(-0.6, 0.6, 500))
        u, f = arm_lengths()
        wrist = quat_rotate(upper, np.array([u, 0, 0])) + quat_rotate(fore, np.array([f, 0, 0]))
        assert np.abs(wrist - target).max() < 1e-9

    def test_elbows_bend_the_right_way_only(self):
        upper, fore = solve_arm(reach(self.targets), np.zeros(500))
        bend = quat_rotate(np.array([[0, 0, 0, 1.0]]), np.array([[1.0, 0, 0]]))
        local = quat_rotate(upper * (-1, -1, -1, 1), quat_rotate(fore, bend))
        assert (local[:, 2] >= -1e-9).all()  # towards +Z of the upper arm: flexion, never hyperextension
        assert np.abs(local[:, 1]).max() < 1e-9  # a hinge

    def test_reach_leaves_near_targets_and_shortens_far_ones(self):
        total = arm_lengths().total
        near = np.array([0.1, -0.35, 0.2])
        assert np.linalg.norm(reach(near) - near) < 0.012
        far = reach(np.array([0.0, 0.0, 5.0]))
        assert 0.93 * total < far[2] < total

    def test_pronation_turns_the_palm_down_and_supination_up(self):
        forward = np.array([[0.0, -0.25, 0.30]])
        _, fore = solve_arm(forward, np.zeros(1))
        palm = np.array([0.0, -1.0, 0.0])  # normal of the palm in the T-pose
        heights = []
        for degrees in (85, 0, -85):
            twist, hand = hand_turns(np.radians([[degrees, 0.0, 0.0]]))
            heights.append(quat_rotate(fore, quat_rotate(twist, quat_rotate(hand, palm)))[0, 1])
        assert heights[0] < -0.8
        assert abs(heights[1]) < 0.5
        assert heights[2] > 0.8


class TestVolume:
    def test_points_inside_are_pushed_out_and_far_ones_left_alone(self):
        deep = np.array([[0.05, 1.2, 0.05], [0.0, 1.0, 0.10], [-0.14, 1.3, 0.0]])
        out = deep + push_from_torso(deep, 0.03)
        again = push_from_torso(out, 0.0)
        assert np.abs(again).max() < 0.012
        far = np.array([[0.5, 1.2, 0.4], [0.0, 1.2, 0.6]])
        assert np.abs(push_from_torso(far, 0.03)).max() < 1e-3

    def test_a_hand_in_front_leaves_to_the_front(self):
        push = push_from_torso(np.array([[0.02, 1.2, 0.06]]), 0.03)[0]
        assert push[2] > 0.04
        assert push[1] == 0

    def test_the_head_keeps_hands_off_all_around(self):
        directions = np.random.default_rng(2).normal(size=(100, 3))
        points = 0.05 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        outside = points + push_from_head(points, np.zeros(3), 0.02)
        assert (np.linalg.norm(outside, axis=1) > 0.075).all()


class TestTables:
    def test_every_pose_names_a_known_shape_and_stays_within_reach(self):
        for name, form in {**FORMS, **LEXICAL_FORMS}.items():
            assert len(form.poses) >= 2, name
            assert form.hands in ("one", "both", "any"), name
            for pose in form.poses:
                assert pose.shape in HAND_SHAPES, name
                assert np.linalg.norm(pose[:3]) < 1.12, name
                assert -90 <= pose.pronation <= 90, name
                assert -70 <= pose.flexion <= 60, name

    def test_every_word_has_a_form_and_every_lexical_form_a_word(self):
        assert set(LEXICON.values()) == set(LEXICAL_FORMS)
        assert form_for("“Huge,”") == ("big", 1.0)
        assert form_for("I")[1] < 1

    def test_a_word_calls_for_a_gesture_in_its_own_language_alone(self):
        own = {"de": "riesig! Nichts. ich hallo", "fr": "énorme rien J’ai Bonjour,", "es": "enorme nada yo ¡Hola!"}
        for language, words in own.items():
            forms = [form_for(word, language) for word in words.split()]
            assert [form for form, _ in forms] == ["big", "nothing", "me", "wave"]
            assert forms[2][1] < 1
        other = {
            "de": "will Not her so huge I me",
            "fr": "me or long on no main",
            "es": "me once huge",
            "it": "I me no",
            "ja": "no",
        }
        assert {(w, code): form_for(w, code) for code, words in other.items() for w in words.split() if form_for(w, code)} == {}
        assert {form for sets in _OTHERS.values() for form in sets} <= set(LEXICAL_FORMS)
        for code, sets in _OTHERS.items():
            words = " ".join(sets.values()).split()
            assert len(words) == len(set(words))
            assert set(_OTHERS_FREQUENT[code]) <= set(words)

    def test_styles_refer_to_what_exists(self):
        for name, style in STYLES.items():
            assert set(style.repertoire) <= set(FORMS), name
            assert {style.rest, style.idle} <= set(RESTS), name
        assert len(STYLES) >= 8
        assert tuple(MANNERS) == EMOTIONS == (
            "neutral", "happiness", "anger", "sadness", "contempt", "surprise", "fear", "disgust",
        )  # fmt: skip

    def test_manners_blend_linearly(self):
        half = blend_modifiers(np.array([0.5, 0.5, 0, 0, 0, 0, 0, 0]))
        assert half.amplitude == pytest.approx((MANNERS["neutral"].amplitude + MANNERS["happiness"].amplitude) / 2)

    def test_styles_mix_between_their_parents(self):
        for weight in (0.25, 0.5, 0.75):
            mixture = mix_styles({"calm": 1 - weight, "lively": weight})
            for field in ("rate", "amplitude", "tempo", "height"):
                low, high = sorted((getattr(STYLES["calm"], field), getattr(STYLES["lively"], field)))
                assert low < getattr(mixture, field) < high

    @pytest.mark.parametrize("pair", list(combinations(STYLES, 2)))
    def test_every_number_of_a_mixture_is_the_mean_by_weight(self, pair):
        one, other = (STYLES[name] for name in pair)
        for weight in (0.49, 0.51):
            mixture = mix_styles(dict(zip(pair, (weight, 1 - weight), strict=True)))
            for field in (field.name for field in fields(one) if isinstance(field.default, float)):
                mean = weight * getattr(one, field) + (1 - weight) * getattr(other, field)
                assert getattr(mixture, field) == pytest.approx(mean), field


class TestListening:
    def test_accents_are_heard_where_they_are(self):
        at = rhythm()
        _, accents, _ = listen(pulses(17, at))
        times = np.array([a.time for a in accents])
        assert np.abs(times[:, None] - np.array(at)).min(0).max() < 0.03
        assert len(times) <= len(at) + 1

    def test_silence_and_steady_noise_have_none(self):
        rng = np.random.default_rng(0)
        for samples in (np.zeros(5 * RATE), rng.normal(0, 0.1, 5 * RATE), rng.normal(0, 1e-5, 5 * RATE)):
            _, accents, _ = listen(Speech(samples.astype(np.float32), RATE))
            assert sum(a.strength > 0.3 for a in accents) == 0

    def test_phrases_are_parted_by_pauses(self):
        speech = pulses(9, [0.5, 0.8, 1.1, 1.4, 4.0, 4.3, 4.6, 7.5, 7.8])
        _, _, phrases = listen(speech)
        assert [round(p.start) for p in phrases] == [0, 4, 7]

    def test_loudness_does_not_depend_on_the_gain_of_the_microphone(self):
        speech = pulses(10, rhythm(14))
        loud, _, _ = listen(speech)
        soft, _, _ = listen(Speech(speech.samples * 0.1, RATE))
        assert np.abs(loud.loudness[200:] - soft.loudness[200:]).mean() < 0.06

    @pytest.mark.slow
    def test_memory_stays_bounded(self):
        listener, chunk = EventDetector(), pulses(4, rhythm(5)).samples
        for _ in range(30):
            listener.push(chunk)
        assert len(listener._loudness._rows) < 3000
        assert len(listener.accents) < 60
        assert listener.certain_until > 118


class TestPerformance:
    @pytest.mark.slow
    def test_strokes_come_before_accents_by_the_measured_lead(self):
        session = RuleBasedModel().session(style="restless", emotion="neutral", seed=3)
        at = rhythm()
        list(session.push(pulses(17, at)))
        list(session.finish())
        strokes = np.array([g.stroke for g in session.gestures])
        assert len(strokes) > 8
        distance = (np.array(at) - LEAD)[None] - strokes[:, None]
        assert np.median(np.abs(distance).min(1)) < 0.05

    @pytest.mark.slow
    def test_words_call_for_their_own_gestures_with_a_semantic_score(self):
        at = rhythm(12, 1.2)
        words = [Word(w, t - 0.2, t + 0.25) for w, t in zip(["table", "huge", "stone", "tiny"] * 3, at, strict=True)]
        speech = replace(pulses(16, at), words=tuple(words))
        session = RuleBasedModel().session(emotion="neutral", seed=1)
        list(session.push(speech))
        list(session.finish())
        by_word = {g.word: g for g in session.gestures if g.word}
        assert {"huge", "tiny"} <= set(by_word)
        assert by_word["huge"].form == "big"
        assert by_word["huge"].score >= 0.8
        assert by_word["huge"].hands == "both"
        assert not {"table", "stone"} & set(by_word)

    @pytest.mark.slow
    def test_hands_rest_in_long_pauses(self):
        speech = pulses(16, [0.5, 0.9, 1.3, 1.7, 2.1])
        hands, late = [humanoid().index["leftHand"], humanoid().index["rightHand"]], []
        for seed in range(6):  # while the hands hang, the body goes from leg to leg, at another time with each seed
            places = RuleBasedModel().generate(speech, emotion="neutral", seed=seed).positions()
            wrist = places[:, hands]
            speed = np.linalg.norm(np.diff(wrist - places[:, :1], axis=0), axis=-1).mean(1) * 30  # seen from the hips
            late.append(speed[(9 * 30) :].mean())
            assert speed[: (3 * 30)].max() > 0.4
            assert (wrist[-1, :, 1] < 0.97).all()
        assert np.mean(late) < 0.06

    def test_nothing_jumps_at_the_first_frame(self):
        motion = RuleBasedModel().generate(pulses(4, rhythm(5, 0.6, 0.2)), emotion="anger", seed=4)
        step = quat_angle(motion.rotations[0].astype(float), motion.rotations[1].astype(float))
        assert np.degrees(step.max()) < 25

    @pytest.mark.slow
    @pytest.mark.parametrize("fps", [12.0, 24.0, 29.97, 60.0])
    def test_the_frame_rate_samples_one_and_the_same_performance(self, fps):
        speech = pulses(5, rhythm(6))
        reference = RuleBasedModel().generate(speech, fps=120.0, seed=5)
        motion = RuleBasedModel().generate(speech, fps=fps, seed=5)
        assert len(motion) == speech.frames(fps)
        nearest = np.minimum(np.rint(motion.times * 120).astype(int), len(reference) - 1)
        assert np.abs(motion.positions() - reference.positions()[nearest]).max() < 0.03

    @pytest.mark.slow
    def test_long_pieces_and_short_ones_are_the_same_speech(self):
        speech = pulses(31, rhythm(48))
        whole = Motion.concatenate([m for m in RuleBasedModel().stream([speech], seed=1)])
        parts = Motion.concatenate(list(RuleBasedModel().stream(speech.chunks(seconds=0.21), seed=1)))
        assert np.abs(whole.positions() - parts.positions()).max() < 1e-5
        assert np.abs(whole.face - parts.face).max() < 1e-5

    @pytest.mark.slow
    def test_a_stream_is_never_more_than_its_look_ahead_behind(self):
        given = 0.0
        got = 0.0
        session = RuleBasedModel().session(seed=0)
        for chunk in pulses(8, rhythm(10)).chunks(seconds=0.1):
            given += chunk.seconds
            got += sum(len(m) for m in session.push(chunk)) / 30
            assert got >= given - LOOK_AHEAD - 0.2
            assert got <= given
        assert LOOK_AHEAD < 1.6

    def test_speech_at_another_rate_is_resampled_on_the_way(self):
        speech = pulses(4, rhythm(5))
        import soxr

        other = Speech(soxr.resample(speech.samples, RATE, 24000), 24000)
        a = RuleBasedModel().generate(speech, seed=2)
        b = RuleBasedModel().generate(other, seed=2)
        assert len(a) == len(b)
        assert np.linalg.norm(a.positions() - b.positions(), axis=-1).mean() < 0.02

    def test_parts_that_were_not_asked_for_stay_neutral(self):
        speech, s = pulses(3, rhythm(4)), humanoid()
        face = RuleBasedModel().generate(speech, parts=("face",))
        assert face.face is not None
        still = [k for k in range(len(s)) if "Eye" not in s.names[k]]
        assert np.allclose(face.rotations[:, still], [0, 0, 0, 1])
        body = RuleBasedModel().generate(speech, parts=("body",))
        assert body.face is None
        assert np.allclose(body.rotations[:, [*s.left_hand, *s.right_hand]], [0, 0, 0, 1])
        hands = RuleBasedModel().generate(speech, parts=("hands",))
        assert not np.allclose(hands.rotations[:, s.left_hand], [0, 0, 0, 1])
        for motion in (face, hands):  # nobody who stands stiff slides over the floor
            np.testing.assert_array_equal(motion.root, np.repeat(s.offsets[:1].astype(np.float32), len(motion), 0))

    @pytest.mark.slow
    def test_intensity_scales_movement_down_to_idling(self):
        speech, wrists = pulses(20, rhythm(30)), []
        for intensity in (0.0, 0.5, 1.0, 1.5):
            speeds = []
            for seed in range(4):
                motion = RuleBasedModel().generate(speech, intensity=intensity, emotion="neutral", seed=seed, parts=("body",))
                places = motion.positions()
                hand = places[:, humanoid().index["rightHand"]] - places[:, 0]
                speeds.append(np.linalg.norm(np.diff(hand, axis=0), axis=1).mean() * 30)
            wrists.append(np.mean(speeds))
        assert wrists == sorted(wrists)
        assert wrists[0] < 0.06
        assert wrists[1] < 0.8 * wrists[2]

    @pytest.mark.slow
    def test_the_southpaw_uses_the_left_hand_and_the_default_does_not(self):
        def left_share(style: str) -> float:
            motion = RuleBasedModel().generate(pulses(40, rhythm(60)), style=style, emotion="neutral", seed=0)
            p = motion.positions()
            speed = [
                np.linalg.norm(np.diff(p[:, humanoid().index[n]], axis=0), axis=1).sum() for n in ("leftHand", "rightHand")
            ]
            return speed[0] / sum(speed)

        assert left_share("southpaw") > 0.55
        assert left_share("natural") < 0.55

    def test_a_style_of_ones_own(self):
        style = Style("a statue", rate=0.0, torso=0.0, head=0.0, sway=0.0, steps=0.0)
        motion = RuleBasedModel().generate(babble_speech(), style=style)
        assert np.isfinite(motion.rotations).all()

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"style": "livly"}, "lively"),
            ({"style": "calm:x"}, "weight"),
            ({"style": "calm:-1,lively:0.2"}, "weights"),
            ({"style": "calm:0"}, "weights"),
            ({"style": Motion(30.0, np.zeros((1, 55, 4)) + [0, 0, 0, 1.0], np.zeros((1, 3)))}, "example"),
            ({"emotion": "happy"}, "happiness"),
            ({"intensity": 3}, "intensity"),
            ({"intensity": float("nan")}, "intensity"),
            ({"temperature": -1}, "temperature"),
            ({"fps": 0}, "frames per second"),
            ({"parts": ("feet",)}, "face,body,hands"),
            ({"parts": ()}, "face,body,hands"),
            ({"parts": "face,feet"}, "face,body,hands"),
            ({"intensity": None}, "intensity"),
            ({"fps": "30"}, "frames per second"),
            ({"emotion": None}, "emotion"),
            ({"seed": -1}, "seed"),
            ({"seed": 1.5}, "seed"),
            ({"seed": 2**70}, "seed"),
            ({"style": "talk.bvh"}, "example"),
            ({"style": "calm:1e308,lively:1e308"}, "weights"),
        ],
    )
    def test_bad_options_are_named(self, options, message):
        with pytest.raises(InputError, match=message):
            RuleBasedModel().generate(babble_speech(), **options)

    def test_what_is_not_speech_is_told(self):
        for wrong, hint in (
            ("talk.wav", r"Speech\.load"),
            (None, r"Speech\.load"),
            (np.zeros(10), r"Speech\(samples, 24000\)"),
        ):
            with pytest.raises(InputError, match=hint):
                RuleBasedModel().generate(wrong)
            with pytest.raises(InputError, match=hint):
                list(RuleBasedModel().stream([wrong]))
        with pytest.raises(InputError, match=r"stream\(\[speech\]\)"):
            list(RuleBasedModel().stream(babble_speech()))

    def test_one_session_is_one_speech_at_one_rate(self):
        session = RuleBasedModel().session()
        list(session.push(babble_speech()))
        with pytest.raises(InputError, match="began at 16000 Hz"):
            list(session.push(Speech(np.zeros(100, np.float32), 8000)))
        list(session.finish())
        with pytest.raises(InputError, match="over"):
            list(session.push(babble_speech()))

    def test_no_speech_at_all_is_an_error_and_one_sample_is_a_frame(self):
        with pytest.raises(InputError, match="no speech"):
            list(RuleBasedModel().stream([]))
        assert len(RuleBasedModel().generate(Speech(np.zeros(1, np.float32), RATE))) == 1


def babble_speech() -> Speech:
    return Speech(babble(3), RATE)


class TestPosture:
    @pytest.mark.slow
    def test_steps_lift_one_foot_at_a_time_and_the_weight_is_on_the_other(self):
        style = replace(STYLES["natural"], steps=40.0)
        posture = Posture(style, Random(1), 1.0)
        for tick in range(600):
            posture.decide(tick * 0.1, phrases=[], modifier=MANNERS["neutral"], speaking=False)
        b = posture.track.at(np.arange(0, 60, 1 / 30))
        left, right = b[:, Body.LEFT_LIFT] > 0.01, b[:, Body.RIGHT_LIFT] > 0.01
        assert left.any()
        assert right.any()
        assert not (left & right).any()
        apart = b[:, Body.LEFT_FOOT][:, 0] - b[:, Body.RIGHT_FOOT][:, 0]
        assert apart.min() > 0.12
        assert apart.max() < 0.4
