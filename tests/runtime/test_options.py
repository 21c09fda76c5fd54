"""Options are checked in one place, whoever is asked; ``name:0.7,other:0.3`` is read by one function."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.generate import check_request, open_live_session
from cospeech.motion.named_numbers import read_named_numbers, read_seconds
from cospeech.motion.parts import PARTS
from cospeech.rules import GenerationOptions, RuleBasedModel
from cospeech.runtime.model import TrainedModel
from tests.support.runtime_bundles import write_small

WRONG = [
    ({"emotion": "hapy"}, "no emotion is called 'hapy' (known: auto, neutral, happiness"),
    ({"face_gain": 3}, "face gain 3"),
    ({"parts": ("feet",)}, "no part is called 'feet' (some of face,body,hands)"),
    ({"parts": ()}, "no part to generate"),
    ({"intensity": 2.1}, "intensity 2.1 is out of range (0 … 2)"),
    ({"intensity": None}, "intensity None is no number (0 … 2)"),
    ({"temperature": float("nan")}, "temperature nan is out of range"),
    ({"fps": 0}, "fps 0 is out of range (1 … 240 frames per second)"),
    ({"fps": "30"}, "fps '30' is no number"),
    ({"seed": 1.5}, "seed 1.5 is no whole number"),
    ({"seed": -1}, "seed -1 is out of range (0 … 9223372036854775807)"),
]


@pytest.mark.parametrize(("options", "message"), WRONG, ids=str)
def test_whoever_is_asked_says_the_same(options, message, tmp_path):
    for ask in (
        lambda: GenerationOptions(**options),
        lambda: RuleBasedModel().session(**options),
        lambda: TrainedModel.open(write_small(tmp_path / "a.cospeech")).session(**options),
        lambda: check_request(RuleBasedModel(), **options),
    ):
        with pytest.raises(InputError) as error:
            ask()
        assert str(error.value).startswith(message)


def test_options_become_what_models_work_with():
    options = GenerationOptions(seed=np.int64(3), takes=2, fps=np.float32(25), intensity=1, parts="face,body,face")
    assert (options.seeds, options.fps, options.parts) == ([3, 4], 25.0, ("face", "body"))
    assert [type(value) for value in (options.seed, options.fps, options.intensity)] == [int, float, float]
    assert GenerationOptions().parts == PARTS
    assert GenerationOptions().track is None
    assert GenerationOptions(emotion="anger").track.at(np.zeros(()))[2] == 1
    with pytest.raises(FrozenInstanceError):
        options.seed = 4


def test_the_last_take_has_a_seed_too():
    assert GenerationOptions(seed=2**63 - 2, takes=2).seeds[-1] == 2**63 - 1
    with pytest.raises(InputError, match="seed"):
        GenerationOptions(seed=2**63 - 1, takes=2)
    with pytest.raises(InputError, match="takes 0"):
        GenerationOptions(takes=0)


def test_a_session_takes_them_whole_or_with_changes():
    options = GenerationOptions(fps=20, parts=("body",))
    assert GenerationOptions.of(options, {}) is options
    session = RuleBasedModel().session(options, seed=7)
    assert (session.fps, session.parts, session.seed) == (20.0, ("body",), 7)
    with pytest.raises(InputError, match="rule-based"):
        RuleBasedModel().session(options, takes=2)


def test_an_option_that_there_is_not_is_told_with_the_nearest_name():
    model = RuleBasedModel()
    for ask in (
        lambda: open_live_session("rules", stile="calm"),
        lambda: model.session(stile="calm"),
        lambda: model.session(GenerationOptions(), stile="calm"),
        lambda: model.generate(Speech(np.zeros(800, np.float32), 16_000), stile="calm"),
        lambda: model.stream([], stile="calm"),
        lambda: model.plan(Speech(np.zeros(800, np.float32), 16_000), stile="calm"),
        lambda: check_request(model, stile="calm"),
    ):
        with pytest.raises(InputError, match=r"no option is called 'stile' .did you mean 'style'. known: style, emotion"):
            ask()


# the grammar ----------------------------------------------------------------------------------------------------------


def parts(text: str, **options):
    return [part[:2] for part in read_named_numbers(text, number="weight", of="style", hint="a number", **options)]


def test_names_and_numbers():
    assert parts("calm:0.7, lively : .3") == [("calm", 0.7), ("lively", 0.3)]
    assert parts("calm") == [("calm", None)]
    assert parts("1.2,jawOpen:8e-1") == [("1.2", None), ("jawOpen", 0.8)]
    assert parts("") == [("", None)]
    assert parts("a,,b") == [("a", None), ("", None), ("b", None)]
    text = " calm : 0.7 "
    assert read_named_numbers(text, number="", of="", hint="")[0].text == "calm : 0.7"


def test_a_colon_of_a_path_is_its_own():
    names = {"is_name": lambda name: name == "ada"}
    assert parts(r"C:\clips\a.bvh:0.5,C:\b.bvh", **names) == [(r"C:\clips\a.bvh", 0.5), (r"C:\b.bvh", None)]
    with pytest.raises(InputError, match=r"weight 'x' of style 'ada' \(a number\)"):
        parts("ada:x", **names)
    with pytest.raises(InputError, match="weight '' of style 'ada'"):
        parts("ada:", **names)


@pytest.mark.parametrize("wrong", [16000, {"seed": 1}, "rules"], ids=str)
def test_what_is_no_options_is_told(wrong, tmp_path):
    for model in (RuleBasedModel(), TrainedModel.open(write_small(tmp_path / "a.cospeech"))):
        with pytest.raises(InputError, match="where options of a session belong"):
            model.session(wrong)


@pytest.mark.parametrize(("text", "seconds"), [
    ("2230", 2230), ("-1", -1), ("37:10", 2230), ("0:37:10.5", 2230.5), ("00:37:10,500", 2230.5), ("2:00:00", 7200),
    ("90:00", 5400), ("37m10s", 2230), ("37m10", 2230), ("1h2m3.5s", 3723.5), ("2h", 7200), ("5m", 300), ("7s", 7), (" 5 ", 5),
])  # fmt: skip
def test_a_time_is_read_as_seconds_as_a_clock_or_with_letters(text, seconds):
    assert read_seconds(text, "no time", "") == seconds


@pytest.mark.parametrize(
    "text", ["", "x", "nan", "inf", "37:", ":10", "37:1", "37:60", "1:2:30", "1:2:3:4", "10s37m", "h", "1m-3s", "-1:10"]
)
def test_what_is_no_time_is_refused(text):
    with pytest.raises(InputError, match="no time"):
        read_seconds(text, "no time", "")
