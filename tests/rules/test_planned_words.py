"""A plan alone gives the same performance: its words are those of a speech that has none."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import soundfile

import cospeech
from cospeech import InputError, Motion, Plan, Speech
from cospeech.audio.speech import Word
from cospeech.errors import CospeechWarning
from cospeech.generate import generate_files
from cospeech.rules import RuleBasedModel
from cospeech.rules.plan_commands import PlanCommands

EXAMPLE = Path(cospeech.__file__).parent / "assets" / "example"
SRT = "1\n00:00:00,200 --> 00:00:02,600\nYesterday I saw a tiny dog there\n\n2\n00:00:03,100 --> 00:00:04,900\nit was huge\n"


@cache
def speech() -> Speech:
    """A speech that begins in the middle of a word, so that this word begins before 0."""
    return Speech.load(EXAMPLE / "example.ogg", transcript=EXAMPLE / "example.TextGrid").window(0.9, 7)


@cache
def plan() -> Plan:
    return RuleBasedModel().plan(speech())


@cache
def usual() -> Motion:
    return RuleBasedModel().generate(speech())


def without_words() -> Speech:
    return replace(speech(), words=None)


def same(a: Motion, b: Motion) -> bool:
    return all(np.array_equal(x, y) for x, y in ((a.rotations, b.rotations), (a.root, b.root), (a.face, b.face)))


@pytest.fixture
def talk(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    samples, rate = soundfile.read(EXAMPLE / "example.ogg", dtype="float32")
    soundfile.write("talk.wav", samples[: 5 * rate], rate)
    Path("talk.srt").write_text(SRT, encoding="utf-8")
    return tmp_path


def test_words_of_the_plan_are_played_to_a_speech_without_words(tmp_path):
    assert plan().words[0].start < 0 < plan().words[0].end
    assert not same(RuleBasedModel().generate(without_words()), usual())  # words matter here
    plan().save(tmp_path / "plan.json")
    read = Plan.load(tmp_path / "plan.json")
    with warnings.catch_warnings():
        warnings.simplefilter("error", CospeechWarning)
        assert same(RuleBasedModel().generate(without_words(), plan=read), usual())
        assert RuleBasedModel().plan(without_words(), plan=read) == plan()


@pytest.mark.parametrize("seconds", [0.07, 0.35, 3.0])
def test_a_stream_without_words_has_those_of_the_plan_too(seconds):
    assert same(Motion.concatenate(RuleBasedModel().stream(without_words().chunks(seconds), plan=plan())), usual())


def test_words_that_are_given_win_and_a_note_says_so():
    other = replace(speech(), words=tuple(replace(word, text="mum") for word in speech().words))
    with pytest.warns(CospeechWarning, match="^the words of the speech are not those of the plan, and are played"):
        motion = RuleBasedModel().generate(other, plan=plan())
    assert not same(motion, usual())
    with pytest.warns(CospeechWarning):
        assert {word.text for word in RuleBasedModel().plan(other, plan=plan()).words} == {"mum"}
    silent = replace(speech(), words=())  # a transcript that says: nothing
    with pytest.warns(CospeechWarning, match="the words of the speech"):
        assert RuleBasedModel().plan(silent, plan=plan()).words == ()


def test_words_whose_times_were_rounded_are_the_same_words():
    new_plan = plan().with_words(Word(w.text, round(w.start, 4), round(w.end, 4)) for w in plan().speech_words)
    with warnings.catch_warnings():
        warnings.simplefilter("error", CospeechWarning)
        assert same(RuleBasedModel().generate(speech(), plan=new_plan), usual())


def test_a_word_of_a_plan_does_not_end_before_it_starts(tmp_path):
    words = [{"text": "a", "start": 0.1, "end": 0.2}, {"text": "b", "start": 2.0, "end": 1.0}]
    (tmp_path / "plan.json").write_text(json.dumps({"cospeech_plan": 1, "words": words}))
    with pytest.raises(InputError, match=r"words\[1\].end: 1 is before the start at 2"):
        Plan.load(tmp_path / "plan.json")


def test_a_plan_file_alone_gives_the_same_files(talk):
    outputs = ("bvh", "json", "png")
    generate_files("talk.wav", [f"a.{suffix}" for suffix in outputs], transcript="talk.srt", plan_out="a-plan.json")
    generate_files("talk.wav", [f"b.{suffix}" for suffix in outputs], plan="a-plan.json", plan_out="b-plan.json")
    for a, b in [(f"a.{suffix}", f"b.{suffix}") for suffix in outputs] + [("a-plan.json", "b-plan.json")]:
        assert Path(a).read_bytes() == Path(b).read_bytes(), a
    assert len(Plan.load("b-plan.json").words) == 10
    assert '"language"' not in Path("a-plan.json").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(("given", "language", "source"), [("", "de", "found"), ("en", "en", "given"), ("nl", "nl", "given")])
def test_the_language_of_words_is_found_or_given_and_the_plan_keeps_it(talk, given, language, source):
    Path("talk.txt").write_text("Das will sie am Mittwoch nicht wieder abgeben", "utf-8")
    result = generate_files("talk.wav", "a.csv", parts=["face"], transcript="talk.txt", plan_out="plan.json", language=given)
    assert (result.language, result.language_source) == (language, source)
    words = Plan.load("plan.json").speech_words
    assert {word.language for word in words} == {"" if language == "en" else language}
    again = generate_files("talk.wav", "b.csv", parts=["face"], plan="plan.json")
    assert again.language == language
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


@pytest.mark.slow
def test_a_transcript_of_chinese_signs_changes_no_lips_and_a_note_says_so(talk):
    Path("talk.txt").write_text("晚上好我的爸爸妈妈", "utf-8")
    with pytest.warns(CospeechWarning, match="the spelling of Chinese does not tell"):
        result = generate_files("talk.wav", "a.csv", parts=["face"], transcript="talk.txt")
    assert result.language == "zh"
    generate_files("talk.wav", "b.csv", parts=["face"])
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_an_edit_on_a_word_takes_the_transcript_that_is_given(talk):
    generate_files("talk.wav", ["a.bvh"], transcript="talk.srt", plan_out="plan.json")
    Path("other.srt").write_text(SRT.replace("tiny", "cat"), encoding="utf-8")
    edits = PlanCommands(gesture=["point_left@word:cat"])
    with pytest.warns(CospeechWarning, match="the words of the speech"):
        generate_files(
            "talk.wav", ["b.bvh"], transcript="other.srt", plan="plan.json", plan_edits=edits, plan_out="b.json"
        )  # fmt: skip
    assert "cat" in {word.text for word in Plan.load("b.json").words}


@pytest.mark.slow
def test_trained_models_play_the_words_of_a_plan_too():
    model = cospeech.load("mix-stage")
    of_stretch = Plan().set(2, 3, intensity=0.5)
    session = model.session(plan=of_stretch)
    motion = Motion.concatenate([*session.push(speech()), *session.finish()])
    assert session.plan.words == plan().words
    assert same(model.generate(without_words(), plan=session.plan), motion)
    assert not np.array_equal(model.generate(without_words(), plan=of_stretch).face, motion.face)
    assert same(Motion.concatenate(model.stream(without_words().chunks(0.3), plan=session.plan)), motion)
