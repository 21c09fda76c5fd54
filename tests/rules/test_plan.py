"""Plans of gestures: written, read back, edited, and played."""

from __future__ import annotations

import json
import random
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import cospeech
from cospeech import InputError, Motion, Plan, Speech
from cospeech.audio.emotions import EMOTIONS, EmotionTrack
from cospeech.errors import CospeechWarning
from cospeech.rules import GenerationOptions, RuleBasedModel
from cospeech.rules.plan_commands import PlanCommands

EXAMPLE = Path(cospeech.__file__).parent / "assets" / "example"
FPS, SECONDS = 30, 12.0
MUTANTS = 500
PLAYS = 20  # of the mutants that are plans: each is generated


@cache
def speech() -> Speech:
    return Speech.load(EXAMPLE / "example.ogg", transcript=EXAMPLE / "example.TextGrid").window(0, SECONDS)


@cache
def plan() -> Plan:
    return RuleBasedModel().plan(speech())


@cache
def usual() -> Motion:
    return RuleBasedModel().generate(speech())


def play(new_plan: Plan) -> Motion:
    return RuleBasedModel().generate(speech(), plan=new_plan)


def same(a: Motion, b: Motion) -> bool:
    return all(np.array_equal(x, y) for x, y in ((a.rotations, b.rotations), (a.root, b.root), (a.face, b.face)))


def wrists(motion: Motion) -> np.ndarray:
    """(T, 2, 3) metres."""
    at = motion.skeleton.index
    return motion.positions()[:, [at["leftHand"], at["rightHand"]]]


def measure_change(motion: Motion) -> np.ndarray:
    """(T,) metres between the wrists of an edited motion and of the usual one."""
    return np.linalg.norm(wrists(motion) - wrists(usual()), axis=-1).max(1)


def at(time: float) -> int:
    return round(time * FPS)


def a_gesture() -> str:
    """Id of a gesture in the middle of the speech that is no superimposed beat."""
    return next(each.id for each in plan().gestures if each.stroke > 5 and each.form != "superimposed-beat")


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"style": "lively", "seed": 3}, {"emotion": "anger", "style": "seated"}])
def test_a_plan_that_is_written_and_read_back_gives_the_same_bytes(tmp_path, options):
    model = RuleBasedModel()
    complete = model.plan(speech(), **options)
    complete.save(tmp_path / "plan.json")
    assert Plan.load(tmp_path / "plan.json") == complete
    assert same(model.generate(speech(), plan=tmp_path / "plan.json"), model.generate(speech(), **options))


def test_a_plan_that_is_written_names_its_style_and_one_that_names_none_plays():
    assert plan().style == "natural"
    GenerationOptions(plan=plan(), style="natural")
    older = plan().model_copy(update={"style": None})
    with pytest.raises(InputError, match="style 'lively' beside a plan that has no style, so the default one"):
        GenerationOptions(plan=older, style="lively")
    assert same(play(older), usual())


def test_a_plan_of_another_speech_is_told_and_what_is_written_can_be_played(tmp_path):
    part, late = speech().window(0, 7.1), [each.id for each in plan().gestures if each.stroke > 8.1]
    assert late
    with pytest.warns(
        CospeechWarning, match="the plan is of a speech of 12 s, and this one has 7.1 s; gestures after"
    ) as record:
        complete = RuleBasedModel().plan(part, plan=plan())
    assert str(record[0].message).endswith(f"the end of the speech are left out: {', '.join(late)}")
    complete.save(tmp_path / "plan.json")
    assert Plan.load(tmp_path / "plan.json") == complete
    with warnings.catch_warnings():
        warnings.simplefilter("error", CospeechWarning)
        RuleBasedModel().plan(part, plan=complete)
    with pytest.warns(CospeechWarning, match="^gestures after the end of the speech are left out: a1$"):
        RuleBasedModel().plan(part, plan=Plan().add("huge", at=9.0))


def test_an_open_plan_is_what_is_generated_without_one():
    assert same(play(Plan()), usual())


def test_a_plan_says_what_the_session_says():
    session = RuleBasedModel().session(GenerationOptions(plan=Plan()))
    list(session.push(speech()))
    list(session.finish())
    strokes = [(round(each.stroke, 4), each.hands) for each in sorted(session.gestures, key=lambda each: each.stroke)]
    assert [(each.stroke, each.hands) for each in session.plan.gestures] == strokes
    assert session.plan.seconds == pytest.approx(SECONDS, abs=0.01)
    assert {word.text for word in session.plan.words} >= {"Yesterday", "tiny"}
    assert len(session.plan.phrases) >= 3
    assert len(session.plan.accents) > 10
    assert len(session.plan.gaze) > 3


def test_a_live_session_plays_no_plan():
    with pytest.raises(InputError, match="live session plays no plan"):
        cospeech.open_live_session("rules", plan=Plan())


def test_without_a_plan_there_is_none():
    with pytest.raises(InputError, match="without a plan"):
        _ = RuleBasedModel().session().plan


# ---------------------------------------------------------------------------------------------------- edits


def test_a_removed_gesture_is_gone_and_the_rest_stays():
    gesture = plan().find(a_gesture())
    change = measure_change(play(plan().remove(gesture.id)))
    near = np.abs(np.arange(len(change)) / FPS - gesture.stroke) < 2.5
    assert change[at(gesture.stroke) : at(gesture.end)].max() > 0.1
    assert change[~near].max() < 0.01


def test_the_gestures_of_a_stretch_are_removed_and_the_rest_stays():
    new_plan = plan().remove_between(4, 10)
    removals = [each for each in plan().gestures if each not in new_plan.gestures]
    assert {each.id for each in plan().gestures if 4 <= each.stroke < 10} <= {each.id for each in removals}
    assert all(each.form == "superimposed-beat" for each in removals if not 4 <= each.stroke < 10)  # on one that is gone
    assert still_after_gestures(play(new_plan), 4, 10)
    assert measure_change(play(new_plan))[: at(3.0)].max() == 0
    assert PlanCommands(remove=["4:10"]).apply(plan()) == new_plan == PlanCommands(remove=["4:10"]).apply(new_plan)


def test_locked_gestures_of_a_stretch_are_not_removed_with_the_others():
    inside = plan().find(a_gesture())
    locked = plan().lock(inside.stroke - 0.1, inside.stroke + 0.1)
    left = [each.id for each in locked.remove_between(0, 99).gestures]
    assert inside.id in left
    assert len(left) < len(plan().gestures)
    with pytest.raises(InputError, match="is locked"):
        locked.remove_between(inside.stroke - 0.05, inside.stroke)


def test_a_moved_gesture_strokes_at_the_new_time():
    old = plan().find(a_gesture())
    new_plan = plan().move(old.id, old.stroke + 0.4)
    new = new_plan.find(old.id)
    assert (new.stroke - old.stroke, new.end - old.end) == pytest.approx((0.4, 0.4))
    change = measure_change(play(new_plan))
    assert change[at(old.stroke) - 10 : at(old.stroke) + 10].max() > 0.05
    assert change[np.arange(len(change)) / FPS < old.start - 0.1].max() == 0


def test_an_added_gesture_is_seen_at_its_time():
    new_plan = plan().add("big", at=9.0, hands="both")
    pair = wrists(play(new_plan))
    width = np.abs(pair[:, 0, 0] - pair[:, 1, 0])
    assert width[at(9.0) : at(9.5)].max() > width[at(8.7)] + 0.5
    assert measure_change(play(new_plan))[: at(7.9)].max() < 1e-9


def test_a_gesture_is_added_at_a_word():
    word = next(each for each in plan().words if each.text == "Yesterday")
    gesture = plan().add("point_left", word="yesterday").find("a1")
    assert word.start < gesture.stroke < word.end
    assert (gesture.form, gesture.hands, gesture.word) == ("point", "left", "Yesterday")


def test_an_added_gesture_takes_the_place_of_its_neighbours():
    old = plan().find(a_gesture())
    ids = {each.id for each in plan().add("big_both", at=old.stroke + 0.2).gestures}
    assert old.id not in ids
    assert "a1" in ids


@pytest.mark.parametrize("fields", [{"size": 1.6}, {"hold": 2.5}, {"hands": "left"}, {"form": "stop"}, {"seed": 5}])
def test_a_changed_gesture_is_another_there_alone(fields):
    old = plan().find(a_gesture())
    fields = {"hands": "right"} if fields == {"hands": old.hands} else fields
    change = measure_change(play(plan().change(old.id, **fields)))
    time = np.arange(len(change)) / FPS
    assert change[np.abs(time - old.stroke) < 3].max() > 0.01
    assert change[(time < old.start - 0.2) | (time > old.stroke + 5)].max() < 0.05


@pytest.mark.slow
def test_a_place_is_where_the_hand_comes():
    old = plan().find(a_gesture())
    low, high = (play(plan().change(old.id, place=(0.3, up, 0.5), hands="right", hold=0.5)) for up in (-0.6, 0.1))
    k = at(old.end)
    assert wrists(high)[k, 1, 1] - wrists(low)[k, 1, 1] > 0.25


def test_another_seed_for_a_stretch_has_smooth_borders_and_leaves_the_rest():
    take = play(plan().reseed(5, 7.5, seed=9))
    change, time = measure_change(take), np.arange(len(usual())) / FPS
    assert change[(time > 5) & (time < 8)].max() > 0.1
    assert change[time < 3.9].max() < 1e-6
    assert change[time > 11].max() < 0.05
    speed = [np.linalg.norm(np.diff(wrists(motion), axis=0), axis=-1).max() * FPS for motion in (take, usual())]
    assert speed[0] < 1.5 * speed[1]


def test_a_stretch_without_its_seed_is_planned_with_that_of_the_plan():
    new_plan = plan().reseed(3, 10, seed=9).clear(0, 12, ["seed"])
    assert [(each.start, each.end, each.seed, each.open) for each in new_plan.stretches] == [(3, 10, None, True)]
    motion, sown = play(new_plan), play(plan().reseed(3, 10, seed=9))
    time, wrist = np.arange(len(motion)) / FPS, np.abs(wrists(motion) - wrists(sown)).max((1, 2))
    assert wrist[(time > 5) & (time < 9)].max() > 0.05, "its gestures are not those of the old seed"
    assert measure_change(motion)[time < 2].max() < 1e-6
    again = RuleBasedModel().plan(speech(), plan=new_plan)
    assert [each.id for each in again.gestures] == [each.id for each in plan().gestures]
    assert [each.id for each in again.gaze] == [each.id for each in plan().gaze]


def test_an_edit_of_one_stretch_leaves_another_that_has_a_seed():
    two = RuleBasedModel().plan(speech(), plan=plan().reseed(2, 4, seed=5).reseed(7, 9, seed=6))
    one = RuleBasedModel().plan(speech(), plan=plan().reseed(7, 9, seed=6))
    late = [each for each in two.gestures if each.id.endswith("-6")]
    assert late == [each for each in one.gestures if each.id.endswith("-6")] != []
    motion, time = play(two), np.arange(len(usual())) / FPS
    for new_plan in (two.reseed(0, 1, seed=8), two.clear(2, 4, ["seed"])):
        gap = np.linalg.norm(wrists(play(new_plan)) - wrists(motion), axis=-1).max(1)
        assert gap[time < 4].max() > 0.05
        assert gap[(time > 7.5) & (time < 8.8)].max() < 0.04  # hands may rest some millimetres away
        assert gap[time > 9.2].max() < 1e-3


def test_a_gesture_on_the_first_syllable_may_stroke_before_the_speech_begins(tmp_path):
    early = plan().gestures[0].model_copy(update={"stroke": -0.023, "start": -0.4, "end": 0.4})
    first = plan().model_copy(update={"gestures": (early, *plan().gestures[1:])})
    first.save(tmp_path / "plan.json")
    assert Plan.load(tmp_path / "plan.json").gestures[0].stroke == -0.023
    assert first.add("huge", at=6.0).gestures[0] == early


@pytest.mark.parametrize("times", [(-1.0, 0.0, 2.0), (-2.0, -1.0, 2.0), (-1.0, 2.0, 3.0), (0.0, 1.0, 2.0), (-3.0, -2.0, -1.0)])
def test_a_plan_has_an_emotion_track_from_0_on(times):
    track = EmotionTrack(np.array(times), np.eye(8)[[0, 1, 2]])
    later = np.linspace(0, 4, 41)
    np.testing.assert_allclose(Plan.of(GenerationOptions(emotion=track)).moods.at(later), track.at(later), atol=1e-9)


@pytest.mark.parametrize("start", [3.0, 3.1, 3.2, 3.3, 3.4, 3.5])
def test_a_voice_that_is_followed_from_a_time_on_plays_the_same_from_pieces(monkeypatch, start):
    angry = np.array([0.4 if name == "neutral" else 0.6 if name == "anger" else 0.0 for name in EMOTIONS])
    monkeypatch.setattr("cospeech.audio.voice_emotion.ConfidentEmotion._weigh", lambda _: angry)
    options = {"plan": Plan(emotion="happiness").set(start, 7, emotion="auto"), "parts": "face"}
    short = speech().window(0, 6)
    whole = RuleBasedModel().generate(short, **options)
    pieces = Motion.concatenate(list(RuleBasedModel().stream(short.chunks(0.1), **options)))
    np.testing.assert_array_equal(whole.face, pieces.face)


@pytest.mark.parametrize("values", [{"style": "lively"}, {"intensity": 0.2}, {"emotion": "anger"}])
def test_a_stretch_has_its_own_style_intensity_and_emotion(values):
    motion = play(plan().set(4, 8, **values))
    time = np.arange(len(usual())) / FPS
    face = np.abs(motion.face - usual().face).max(1)
    change = np.maximum(measure_change(motion), face)
    assert change[(time > 4) & (time < 8.5)].max() > 0.02
    assert change[time < 3.5].max() < 1e-6


def still_after_gestures(motion: Motion, start: float, end: float) -> bool:
    """Whether the hands hang or lie still from some time after ``start`` on: breathing and weight alone move them."""
    times = np.arange(len(motion)) / FPS
    speed = np.linalg.norm(np.diff(wrists(motion), axis=0), axis=-1).max(1) * FPS
    return bool(speed[(times[1:] > start + 2) & (times[1:] < end - 1)].max() < 0.25)


@pytest.mark.parametrize("is_listed", [False, True])
def test_a_stretch_without_intensity_has_no_gestures(is_listed):
    assert not still_after_gestures(usual(), 4, 10)
    model, new_plan = RuleBasedModel(), (plan() if is_listed else Plan()).set(4, 10, intensity=0)
    assert still_after_gestures(play(new_plan), 4, 10)
    there = [each for each in model.plan(speech(), plan=new_plan).gestures if 4 <= each.stroke < 10]
    assert bool(there) == is_listed  # what was listed comes back with `clear`
    after = [each.stroke for each in model.plan(speech(), plan=new_plan).gestures if each.stroke > 10]
    assert after == [each.stroke for each in plan().gestures if each.stroke > 10]


def test_a_gesture_that_is_asked_for_in_a_stretch_without_intensity_is_told_of():
    with pytest.warns(CospeechWarning, match="'a1' at 7 s is left out: its stretch has intensity 0"):
        play(Plan().set(4, 10, intensity=0).add("huge", at=7.0))


@pytest.mark.parametrize("values", [{"style": "lively"}, {"intensity": 1.6}, {"emotion": "sadness"}])
def test_what_is_heard_in_the_voice_is_played_after_a_stretch_as_without_it(monkeypatch, values):
    calm = usual().face
    angry = np.array([0.4 if name == "neutral" else 0.6 if name == "anger" else 0.0 for name in EMOTIONS])
    monkeypatch.setattr("cospeech.audio.voice_emotion.ConfidentEmotion._weigh", lambda _: angry)
    own = RuleBasedModel().plan(speech())
    before, after = play(own), play(own.set(3, 5, **values))
    assert np.abs(before.face - calm).max() > 0.2  # it is played
    gap = np.linalg.norm(wrists(before) - wrists(after), axis=-1).max(1)
    assert gap[at(3.2) : at(5)].max() > 0.03
    assert gap[at(8.3) :].max() < 0.02
    assert np.abs(before.face - after.face)[at(8) :].max() < 0.05


def test_a_stretch_has_the_values_of_the_plan_again():
    new_plan = plan().set(2, 6, emotion="anger", style="lively").set(4, 8, intensity=0.5)
    cleared_plan = new_plan.clear(3, 5, ["emotion"])
    assert [(each.start, each.end, each.style, each.emotion, each.intensity) for each in cleared_plan.stretches] == [
        (2, 3, "lively", "anger", None), (3, 4, "lively", None, None), (4, 5, "lively", None, 0.5),
        (5, 6, "lively", "anger", 0.5), (6, 8, None, None, 0.5),
    ]  # fmt: skip
    assert new_plan.clear(0, 9) == plan()
    assert new_plan.lock(2, 4).clear(0, 9, ["emotion"]).stretches[0].emotion == "anger"
    anew = plan().reseed(2, 4, seed=9)
    assert anew.clear(0, 9) == anew, "a seed is no value: the stretch stays open"
    stretches = anew.lock(3, 4).clear(0, 9, ["seed"]).stretches
    assert [(each.start, each.end, each.seed, each.open) for each in stretches] == [(2, 3, None, True), (3, 4, 9, True)]
    assert new_plan.clear(0, 9, ["seed"]) == new_plan
    with pytest.raises(InputError, match="no value 'moods' to clear"):
        new_plan.clear(0, 9, ["moods"])
    with pytest.raises(InputError, match="not after"):
        new_plan.clear(5, 5)
    with pytest.raises(InputError, match="locked"):
        new_plan.lock(2, 4).clear(2.5, 3)


def test_a_plan_that_is_made_by_hand_says_what_is_wrong():
    with pytest.raises(InputError, match=r"^seed: -1 is too small \(from 0 on\)$"):
        Plan(seed=-1)
    with pytest.raises(InputError, match=r"^sead: is no field of a plan"):
        Plan(sead=3)


def test_locked_stretches_stay():
    locked = plan().lock(4, 6)
    inside = next(each for each in plan().gestures if 4 <= each.stroke < 6)
    for edit in (lambda: locked.remove(inside.id), lambda: locked.move(inside.id, 8.0), lambda: locked.add("big", at=5.0)):
        with pytest.raises(InputError, match="locked"):
            edit()
    again = locked.reseed(0, 12)
    assert [each for each in again.gestures if 4 <= each.stroke < 6] == [
        each for each in plan().gestures if 4 <= each.stroke < 6
    ]
    assert [(each.start, each.end) for each in again.stretches] == [(0, 4), (6, 12)]
    with pytest.raises(InputError, match="locked"):
        locked.reseed(4.5, 5)
    assert locked.unlock().remove(inside.id)


def test_a_gesture_that_reaches_into_a_lock_is_locked():
    first = plan().find(a_gesture())
    for low, high in ((first.begins - 0.2, first.begins + 0.05), (first.end - 0.05, first.end + 0.1)):
        locked = plan().lock(max(low, 0), high)
        message = rf"gesture '{first.id}', .* reaches into a locked stretch, .* \(the lock is the entry locked\[0\] of the plan"
        for edit in (lambda p: p.remove(first.id), lambda p: p.move(first.id, 11.0), lambda p: p.change(first.id, size=1.5)):
            with pytest.raises(InputError, match=message):
                edit(locked)
        assert first in locked.reseed(0, 12).gestures


def test_a_gesture_with_a_locked_beat_on_it_is_locked():
    beat = {"id": "b", "form": "superimposed-beat", "stroke": 4.0, "start": 3.7, "end": 4.2, "hands": "left"}
    host = {"id": "g", "form": "push", "stroke": 2.0, "start": 1.4, "end": 2.3, "hold": 0.4, "hands": "both"}
    locked = Plan(gestures=[host, beat], open=False).lock(4, 6)
    assert {each.id for each in locked.reseed(0, 9).gestures} == {"g", "b"}
    with pytest.raises(InputError, match=r"gesture 'g', 1.4 to 4.2 s, reaches into a locked stretch, 4 to 6 s"):
        locked.remove("g")
    assert Plan(gestures=[host, beat], open=False).remove("g").gestures == ()


def test_a_gesture_that_takes_the_hands_ends_a_hold():
    before = {"id": "g", "form": "push", "stroke": 2.0, "start": 1.4, "end": 2.3, "hold": 3.0, "hands": "left"}
    after = {"id": "h", "form": "push", "stroke": 3.5, "start": 3.0, "end": 3.8, "hold": 0.5, "hands": "both"}
    locked = Plan(gestures=[before, after], open=False).lock(3.0, 4.3)
    assert locked.remove("g").gestures == locked.gestures[1:]
    with pytest.raises(InputError, match="locked"):
        Plan(gestures=[before, {**after, "hands": "right"}], open=False).lock(3.0, 4.3).remove("g")


def test_an_added_gesture_keeps_out_of_a_lock():
    locked = Plan().lock(2, 4)
    assert locked.add("big", at=4.6).gestures[0].start == 4
    assert locked.add("big", at=5.5).gestures[0].start is None
    for time in (1.9, 3.0, 4.2):
        with pytest.raises(InputError, match=r"gesture 'a1', .* reaches into a locked stretch, 2 to 4 s"):
            locked.add("big", at=time)


@pytest.mark.slow
@pytest.mark.parametrize("is_listed", [True, False])
def test_what_is_planned_anew_keeps_out_of_a_lock(is_listed):
    low, high = 4.0, 8.0
    new_plan = (plan() if is_listed else Plan()).lock(low, high).reseed(0, 12)
    complete = RuleBasedModel().plan(speech(), plan=new_plan)

    def inside(candidate: Plan) -> list[str]:
        return [each.id for each in candidate.gestures if each.begins < high and each.over > low]

    assert inside(complete) == inside(plan())
    assert any("-" in each.id for each in complete.gestures)
    assert same(play(complete), play(new_plan))
    border = slice(at(high - 1), at(high))
    assert measure_change(play(new_plan))[border].max() < 0.02


@pytest.mark.slow
def test_what_is_played_becomes_a_plan_that_plays_the_same():
    for new_plan in (Plan().add("big", at=4.0), plan().reseed(5, 8), plan().remove(a_gesture()).add("stop_right", at=9.0)):
        complete = RuleBasedModel().plan(speech(), plan=new_plan)
        assert not complete.open
        assert same(play(complete), play(new_plan))


def test_a_gesture_without_room_is_told_of():
    with pytest.warns(CospeechWarning, match="'a1' at 5.05 s is left out"):
        play(Plan().add("big", at=5.05, start=5.0))


def test_edits_leave_the_plan_as_it_was():
    before = plan().to_json()
    plan().remove(a_gesture()).add("big", at=2.0).reseed(3, 4).lock(1, 2)
    assert plan().to_json() == before


def test_commands_are_edits():
    edits = PlanCommands(
        lock=["0:0.4"], remove=[a_gesture()], move=["@1.8@2.0"], stretch=["8:9:style=calm:0.5,lively:0.5,intensity=1.2"],
        reseed=["9:10:4"], gesture=["huge@6", "point_left@word:tiny"],
    )  # fmt: skip
    new_plan = edits.apply(plan())
    assert a_gesture() not in {each.id for each in new_plan.gestures}
    assert [(each.style, each.seed) for each in new_plan.stretches] == [("calm:0.5,lively:0.5", None), (None, 4)]
    assert {each.form for each in new_plan.gestures if each.id.startswith("a")} == {"big", "point"}


@pytest.mark.parametrize(
    "commands",
    [
        {"gesture": ["huge"]}, {"gesture": ["@2"]}, {"gesture": ["qqq@2"]}, {"gesture": ["huge@x"]},
        {"gesture": ["huge@word:qqq"]},
        {"gesture": ["huge@nan"]}, {"move": ["g0"]}, {"remove": ["g99"]}, {"reseed": ["3"]}, {"reseed": ["5:3"]},
        {"reseed": ["3:5:x"]}, {"stretch": ["3:5:colour=red"]}, {"stretch": ["3:5:emotion=glee"]}, {"lock": [":"]},
    ],
)  # fmt: skip
def test_commands_that_cannot_be_understood_are_told(commands):
    with pytest.raises(InputError):
        PlanCommands(**commands).apply(plan())


@pytest.mark.parametrize(
    ("commands", "message"),
    [
        ({"gesture": ["huge@30"]}, r"--gesture huge@30: 30 is after the end of the speech \(12 s\)"),
        ({"remove": ["@30"]}, r"--remove @30: 30 is after the end of the speech \(12 s\)"),
        ({"gesture": ["huge@-1"]}, r"--gesture huge@-1: -1 is before the speech"),
        ({"move": ["g1@30"]}, r"--move g1@30: 30 is after the end"),
        ({"move": ["g1@-2"]}, r"--move g1@-2: -2 is before the speech"),
        ({"reseed": ["20:30"]}, r"--reseed 20:30: 20 is after the end"),
        ({"stretch": ["20:30:style=lively"]}, r"--stretch 20:30:style=lively: 20 is after the end"),
        ({"lock": ["20:30"]}, r"--lock 20:30: 20 is after the end"),
        ({"remove": ["20:30"]}, r"--remove 20:30: 20 is after the end"),
        ({"remove": ["5:3"]}, r"--remove 5:3: '5:3' is no stretch of time"),
        ({"remove": ["3:5:x"]}, r"--remove 3:5:x: '3:5:x' is no stretch of time"),
        ({"remove": ["g99"]}, r"--remove g99: no gesture of the plan is called 'g99'"),
        ({"gesture": ["huge@word:tiny:2"]}, r"there is no word 'tiny:2': 'tiny' is said once \(tiny\)"),
        ({"gesture": ["huge@word:i:9"]}, r"there is no word 'i:9': 'i' is said 3 times \(i:1 … i:3\)"),
    ],
)
def test_a_command_that_cannot_be_done_names_its_option(commands, message):
    with pytest.raises(InputError, match=message):
        PlanCommands(**commands).apply(plan())


@pytest.mark.parametrize(
    ("minutes", "seconds"),
    [
        ({"gesture": ["huge@1:02.5"], "move": ["g1@1m1s"]}, {"gesture": ["huge@62.5"], "move": ["g1@61"]}),
        ({"remove": ["@1:02", "0m1s:0m3s"]}, {"remove": ["@62", "1:3"]}),
        ({"reseed": ["1m:1m5s:7"], "lock": ["1m6s:1m8s"]}, {"reseed": ["60:65:7"], "lock": ["66:68"]}),
    ],
)
def test_times_of_edits_may_have_minutes(minutes, seconds):
    long = Plan(seconds=80.0, open=False).add("beat", at=2.0).add("big", at=62.2).add("beat", at=72.0)
    first = long.gestures[0].id
    commands = [
        PlanCommands(**{name: [text.replace("g1", first) for text in texts] for name, texts in edits.items()})
        for edits in (minutes, seconds)
    ]
    assert commands[0].apply(long) == commands[1].apply(long) != long


def test_an_unknown_gesture_of_a_long_plan_is_told_in_a_line_that_can_be_read():
    many = Plan().model_copy(
        update={"gestures": tuple(plan().gestures[0].model_copy(update={"id": f"g{k}"}) for k in range(3000))}
    )
    with pytest.raises(InputError) as error:
        many.find("g2999x")
    assert error.value.hint == "did you mean 'g2999'? known: g0 … g2999; @37:10 is the one nearest to this time"


def test_words_that_have_a_form_are_suggested_and_listed():
    with pytest.raises(InputError) as error:
        Plan().add("hug", at=2.4)
    assert error.value.hint.startswith("did you mean 'huge'? known: beat, ")
    forms, words = error.value.hint.removeprefix("did you mean 'huge'? known: ").split("; words that have a form: ")
    for name in [*forms.split(", "), *words.split(" ")]:  # the list is whole, and each of it can be added
        assert Plan().add(name, at=2.4).gestures
    assert "superimposed-beat" in forms
    assert {"huge", "hello", "grow"} <= {*words.split(" ")}


def test_the_length_of_the_sound_counts_before_that_of_the_plan():
    with pytest.raises(InputError, match=r"--gesture huge@9: 9 is after the end of the speech \(7.1 s\)"):
        PlanCommands(gesture=["huge@9"]).apply(plan(), 7.1)


@pytest.mark.parametrize(
    ("commands", "message"),
    [
        (
            {"gesture": ["huge@6", "huge@6.3"]},
            "--gesture huge@6 is left out: --gesture huge@6.3 needs the same hand less than 0.6 s away",
        ),
        ({"move": ["g1@6"], "reseed": ["5:7"]}, "--move g1@6 is left out: --reseed 5:7 plans this stretch anew"),
    ],
)
def test_a_command_that_a_later_one_undoes_is_told(commands, message):
    with pytest.warns(CospeechWarning) as record:
        PlanCommands(**commands).apply(Plan(seconds=SECONDS).add("stop", at=2.0).change("a1", id="g1"))
    assert [str(each.message) for each in record] == [message]


@pytest.mark.parametrize("option", [{"seed": 4}, {"style": "lively"}, {"intensity": 0.5}, {"takes": 2}])
def test_options_beside_a_plan_that_say_something_else_are_refused(option):
    with pytest.raises(InputError, match="plan"):
        GenerationOptions(plan=plan(), **option)


# ---------------------------------------------------------------------------------------------------- files


@pytest.mark.parametrize(
    ("entry", "value", "message"),
    [
        (("gestures", 3, "stroke"), "soon", r"gestures\[3\]\.stroke: 'soon'"),
        (("gestures", 2, "stroke"), -1, r"gestures\[2\]\.stroke: -1 is too small"),
        (("gestures", 1, "form"), "hugee", r"gestures\[1\]\.form: no form of gesture is called 'hugee'"),
        (("gestures", 1, "form"), "huge", r"gestures\[1\]\.form: no form .* 'huge' \(this word has the form 'big'\)"),
        (("gestures", 1, "start"), 99.0, r"gestures\[1\]\.stroke: .* is not after the start at 99"),
        (("gestures", 1, "id"), "g0", r"gestures\[1\]\.id: 'g0' is that of gestures\[0\]"),
        (("gestures", 1, "place"), [0, 9, 0], r"gestures\[1\]\.place: up 9 is out of reach"),
        (("gestures", 0, "colour"), "red", r"gestures\[0\]\.colour: is no field"),
        (("gaze", 2, "yaw"), True, r"gaze\[2\]\.yaw: True"),
        (("stretches",), [{"from": 3, "to": 2}], r"stretches\[0\]: to 2 is not after from 3"),
        (
            ("stretches",),
            [{"from": 1, "to": 3}, {"from": 2, "to": 4}],
            r"stretches\[1\]\.from: it begins inside stretches\[0\]",
        ),
        (("emotion",), "glee", "emotion: no emotion is called 'glee'"),
        (("emotion",), [{"time": 1, "weights": {"glee": 1}}], r"emotion\[0\]\.weights: no emotion is called 'glee'"),
        (("seed",), 1.5, "seed: 1.5"),
        (("cospeech_plan",), 2, "cospeech_plan is 2"),
    ],
)
def test_errors_name_the_entry(tmp_path, entry, value, message):
    data = json.loads(plan().to_json())
    *way, last = entry
    place = data
    for key in way:
        place = place[key]
    place[last] = value
    (tmp_path / "plan.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"'.*plan\.json': " + message):
        Plan.load(tmp_path / "plan.json")


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"cospeech_plan": NaN}', "[" * 5000, "\xff", '{"gestures": []}'])
def test_what_is_no_plan_is_told(tmp_path, text):
    (tmp_path / "plan.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="plan"):
        Plan.load(tmp_path / "plan.json")


WILD = [None, True, -1, 0, 0.5, 3, 1e9, -1e308, 1e308, "", "x", "auto", "left", "g1", [], [1, 2, 3], {}, {"time": 1}, "\u0000"]


def mutate(data: object, draw: random.Random) -> None:
    """Change one value, remove one, or add one, anywhere."""
    place, key = None, None
    while isinstance(data, dict | list) and data and (place is None or draw.random() < 0.75):
        place, key = data, draw.choice(list(data)) if isinstance(data, dict) else draw.randrange(len(data))
        data = data[key]
    kind = draw.random()
    if kind < 0.15:
        del place[key]
    elif kind < 0.25 and isinstance(place, list):
        place.insert(key, draw.choice([*WILD, place[key]]))
    elif isinstance(data, float) and kind < 0.7:
        place[key] = draw.choice([data + draw.gauss(0, 1), data * draw.choice([0, -1, 10]), round(data)])
    else:
        place[key] = draw.choice(WILD)


@pytest.mark.slow
def test_a_mutated_plan_is_an_error_that_names_the_entry_or_a_result(tmp_path):
    draw, path, plays, messages = random.Random(0), tmp_path / "plan.json", 0, list[str]()
    part = speech().window(0, 4)
    keys = set(json.loads(plan().to_json())) | {"gestures", "gaze", "stretches", "locked", "no style"}
    for _ in range(MUTANTS):
        data = json.loads(plan().reseed(5, 6).lock(1, 2).to_json())
        for _ in range(draw.randint(1, 3)):
            mutate(data, draw)
        path.write_text(json.dumps(data))
        try:
            mutant = Plan.load(path)
            plays += 1
            if plays <= PLAYS:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", CospeechWarning)
                    RuleBasedModel().generate(part, plan=mutant)
        except InputError as error:
            messages.append(str(error))
    assert [text for text in messages if not any(key in text for key in keys)] == []
    assert min(plays, len(messages)) > MUTANTS // 20


@pytest.mark.parametrize("number", ["inf", "nan", "second"])
def test_a_number_that_is_none_is_refused(number):
    plan = Plan(words=[{"text": "there", "start": 1.0, "end": 1.4}]).add("huge", at=2.0)
    with pytest.raises(InputError, match=f"'{number}' is not which of them"):
        plan.add("huge", word=f"there:{number}")
    with pytest.raises(InputError, match=f"'{number}' is not a time"):
        plan.find(f"@{number}")


@pytest.mark.parametrize("wrong", [1.2, None, 3])
def test_a_gesture_is_named_by_text(wrong):
    with pytest.raises(InputError, match=r"is no id of a gesture .*@2\.4"):
        Plan(seed=1).add("big", at=1.0).remove(wrong)


def test_a_value_that_is_no_plan_is_told():
    with pytest.raises(InputError, match="int where a plan belongs"):
        cospeech.load("rules").generate(speech(), plan=3)
