"""Stretches of a speech with values of their own, for trained models; and old motion that is kept."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import cospeech
from cospeech import InputError, Motion, Plan, Speech
from cospeech.generate import generate_files
from cospeech.models import Model
from cospeech.rules import RuleBasedModel
from cospeech.runtime.motion_switch import KeptStretches, keep_stretches

EXAMPLE = Path(cospeech.__file__).parent / "assets" / "example" / "example.ogg"
FPS = 30


@cache
def speech() -> Speech:
    return Speech.load(EXAMPLE).window(0, 8)


@cache
def model() -> Model:
    return cospeech.load("mix-stage")


@cache
def takes() -> tuple[Motion, Motion]:
    return model().generate(speech(), seed=0), model().generate(speech(), seed=1)


@cache
def rules_takes() -> tuple[Motion, Motion]:
    return RuleBasedModel().generate(speech(), seed=0), RuleBasedModel().generate(speech(), seed=1)


def differ(a: Motion, b: Motion) -> np.ndarray:
    """(T,) whether a frame differs."""
    distance = np.minimum(np.abs(a.rotations - b.rotations), np.abs(a.rotations + b.rotations))  # q and −q are one rotation
    return distance.max((1, 2)) + np.abs(a.face - b.face).max(1) > 1e-6


def fastest(motion: Motion) -> float:
    """Largest way of a joint from frame to frame, metres."""
    return float(np.linalg.norm(np.diff(motion.positions(), axis=0), axis=-1).max())


@pytest.mark.slow
def test_another_seed_takes_over_and_gives_back_without_a_jump():
    first, second = takes()
    motion = model().generate(speech(), plan=Plan().set(3, 5, seed=1))
    differs = np.flatnonzero(differ(motion, first)) / FPS
    assert differs[0] >= 3 - 1e-6
    assert 5 < differs[-1] < 7.1  # what is left of a transition dies away in two seconds
    assert fastest(motion) < 1.3 * max(fastest(first), fastest(second))
    assert np.abs(motion.rotations[5 * FPS - 1] - second.rotations[5 * FPS - 1]).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("values", [{"intensity": 0.3}, {"emotion": "happiness"}, {"style": "second"}])
def test_a_stretch_has_its_own_values_from_border_to_border(values):
    styles = list(model().styles)
    values = {"style": styles[1]} if "style" in values else values
    differs = np.flatnonzero(differ(model().generate(speech(), plan=Plan().set(3, 5, **values)), takes()[0])) / FPS
    assert 2.4 < differs[0] < 3.3  # a network foresees a style
    assert 4.5 < differs[-1] < 7


@pytest.mark.slow
def test_pieces_of_any_length_give_the_same():
    plan = Plan().set(1, 2, intensity=0.5).set(2, 3, seed=4)
    short = speech().window(0, 4)
    whole = model().generate(short, plan=plan)
    pieces = Motion.concatenate(model().stream(short.chunks(0.17), plan=plan))
    assert np.array_equal(whole.rotations, pieces.rotations)
    assert np.array_equal(whole.face, pieces.face)


@pytest.mark.slow
def test_a_plan_without_a_stretch_is_what_is_generated_without_one():
    assert not differ(model().generate(speech(), plan=Plan()), takes()[0]).any()


def test_a_plan_that_was_played_names_its_style():
    assert model().session(plan=Plan()).plan.style == model().default_style


def test_a_trained_model_plays_no_listed_gestures():
    with pytest.raises(InputError, match=r"gestures\[0\]: a trained model"):
        model().session(plan=Plan().add("big", at=2.0))
    with pytest.raises(InputError, match="style"):
        model().session(plan=Plan().set(1, 2, style="nobody"))


def test_what_is_kept_is_as_it_was_and_the_rest_is_new():
    old, new = rules_takes()
    motion = KeptStretches(old, [(0, 2), (3, 4)], FPS).push(new)
    is_old = ~differ(motion, old)
    assert is_old[: 2 * FPS].all()
    assert is_old[3 * FPS : 4 * FPS].all()
    assert not differ(motion, new)[7 * FPS :].any()
    assert fastest(motion) < 1.5 * max(fastest(old), fastest(new))


def test_kept_stretches_in_pieces():
    old, new = rules_takes()
    whole = KeptStretches(old, [(1, 2)], FPS).push(new)
    pieces = KeptStretches(old, [(1, 2)], FPS)
    motion = Motion.concatenate([pieces.push(new[k : k + 7]) for k in range(0, len(new), 7)])
    assert np.array_equal(motion.rotations, whole.rotations)
    assert np.array_equal(motion.root, whole.root)


@pytest.mark.parametrize("keep", ["", "x", "3:2", "0:99", "1:2,", "-1:2"])
def test_what_cannot_be_kept_is_told(keep):
    with pytest.raises(InputError):
        keep_stretches(keep, rules_takes()[0], FPS)


def test_nothing_to_keep_it_from_is_told():
    with pytest.raises(InputError, match="no motion to keep"):
        keep_stretches("0:1", None, FPS)
    assert keep_stretches("", None, FPS) is None


@pytest.mark.slow
def test_files_keep_and_plan(tmp_path):
    first, second, plan = tmp_path / "a.npz", tmp_path / "b.npz", tmp_path / "plan.json"
    generate_files(EXAMPLE, [tmp_path / "a.bvh"], plan_out=plan)
    generate_files(EXAMPLE, [tmp_path / "b.bvh"], plan=plan)
    assert (tmp_path / "a.bvh").read_bytes() == (tmp_path / "b.bvh").read_bytes()
    generate_files(EXAMPLE, first)  # one path is a list of one
    generate_files(EXAMPLE, [second], seed=5, keep="0:3.2", keep_from=first)
    old, new = Motion.load(first), Motion.load(second)
    assert np.abs(old.rotations[: round(3.2 * FPS)] - new.rotations[: round(3.2 * FPS)]).max() < 1e-5
    with pytest.raises(InputError, match="would overwrite"):
        generate_files(EXAMPLE, [tmp_path / "c.bvh"], plan_out=tmp_path / "c.bvh")


@pytest.mark.parametrize(
    ("style", "message"), [("bogus", "no style is called 'bogus'"), ("seated", "'seated' sits where the plan stands")]
)
def test_an_error_names_the_stretch_whose_style_cannot_be_played(style, message):
    plan = Plan().set(1, 2, style="lively").set(3, 5, style=style)
    with pytest.raises(InputError, match=rf"stretches\[1\]\.style, [\d.]+ to [\d.]+ s: {message}"):
        RuleBasedModel().generate(speech(), plan=plan)
    if style == "bogus":
        with pytest.raises(InputError, match=rf"stretches\[1\]\.style, [\d.]+ to [\d.]+ s: {message}"):
            model().generate(speech(), plan=Plan().set(1, 2, style="ben").set(3, 5, style=style))
