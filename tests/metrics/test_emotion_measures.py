"""Emotions measured: macro-F1 against scikit-learn, wrists against geometry, and whether gestures show the emotion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import cospeech
from cospeech.audio.speech import Speech
from cospeech.audio.speech import example as example_files
from cospeech.errors import InputError
from cospeech.metrics.macro_f1 import macro_f1, mean_f1
from cospeech.metrics.wrists import Wrists, against, wrists_of

FOLLOW = {
    "rules": ("distance", ("natural",) * 10),
    "chain-of-generation": ("box", ("ada", "ben", "cleo", "dan", "elif", "femi", "gita", "hugo")),
}
"""Model whose gestures follow its emotion → the measure by which they are wider, and the performers, each with another seed.
Speakers of the chain rest their hands differently when sad: how far from the body differs, not how much room they take."""
AS_WIDE = {("chain-of-generation", "fear")}  # since the weights of 2026-11-28: slower than neutral, but no narrower


def test_macro_f1_is_that_of_scikit_learn():
    judge = pytest.importorskip("sklearn.metrics")
    rng = np.random.default_rng(0)
    for classes in (2, 4, 8):
        true = rng.integers(0, classes, 60)
        guesses = np.where(rng.random(60) < 0.5, true, rng.integers(0, classes, 60))
        clips = [f"c{k // 4}" for k in range(60)]
        score = macro_f1(true, guesses, clips, classes=8)
        there = sorted(set(true.tolist()))
        assert score.value == pytest.approx(judge.f1_score(true, guesses, labels=there, average="macro"), abs=1e-12)
        assert score.interval[0] < score.value < score.interval[1]
        assert score.count == 60


def test_the_interval_is_over_clips():
    """Pieces of a clip are copies: the interval is as wide as that of the clips alone, not narrower."""
    rng = np.random.default_rng(1)
    true, guesses = rng.integers(0, 3, 30), rng.integers(0, 3, 30)
    names = [f"{k:02d}" for k in range(30)]
    alone = macro_f1(true, guesses, names, classes=3)
    copies = macro_f1(np.repeat(true, 10), np.repeat(guesses, 10), list(np.repeat(names, 10)), classes=3)
    assert copies.value == pytest.approx(alone.value)
    assert copies.interval == pytest.approx(alone.interval)
    assert macro_f1([0, 1], [0, 1], ["a", "a"], classes=2).interval is None


def test_always_neutral_does_not_pay():
    true = [0] * 90 + [1] * 5 + [2] * 5
    assert macro_f1(true, [0] * 100, list("ab") * 50, classes=3).value < 0.34
    assert macro_f1(true, true, list("ab") * 50, classes=3).value == 1
    assert np.isnan(mean_f1(np.zeros((3, 3))))


@pytest.mark.parametrize(
    ("true", "guesses", "clips"), [([], [], []), ([0], [0, 1], ["a"]), ([0], [3], ["a"]), ([-1], [0], ["a"])]
)
def test_what_is_no_classification_is_refused(true, guesses, clips):
    with pytest.raises(InputError):
        macro_f1(true, guesses, clips, classes=3)


@pytest.fixture(scope="module")
def speech():
    samples = Speech.load(example_files()[0], transcript=example_files()[1])
    return samples.window(0.0, 15.0)


@pytest.mark.slow
def test_wrists_are_measured_as_they_are(speech):
    motion = cospeech.load("rules").generate(speech, seed=1, fps=30.0)
    own = wrists_of(motion)
    points, index = motion.positions(), motion.skeleton.index
    wrists = points[:, [index["leftHand"], index["rightHand"]]] - points[:, [index["hips"]]]
    assert own.distance == pytest.approx(np.linalg.norm(wrists[..., [0, 2]], axis=-1).mean(), rel=0.02)
    slow = np.linalg.norm(np.diff(wrists, axis=0), axis=-1).mean() * 30
    assert 0.7 * slow < own.speed < 1.02 * slow  # what is faster than 6 Hz is left out
    elsewhere = replace(motion, root=motion.root + [3.0, 0.0, -2.0])
    assert wrists_of(elsewhere).box == pytest.approx(own.box)
    still = motion.resample(30.0)
    frozen = replace(
        still, rotations=np.repeat(still.rotations[:1], len(still), 0), root=np.repeat(still.root[:1], len(still), 0)
    )
    assert wrists_of(frozen).speed < 1e-6


def test_ratios_are_of_pairs():
    plain = [Wrists(0.3, 0.2, s) for s in (0.1, 0.4, 0.9)]
    twice = [Wrists(0.3, 0.2, 2 * w.speed) for w in plain]
    ratios = against(twice, plain)
    assert ratios["speed"].value == pytest.approx(2)
    assert ratios["speed"].interval == pytest.approx((2, 2))  # each is twice its own, however they differ
    assert ratios["distance"].value == pytest.approx(1)
    with pytest.raises(InputError, match="pairs"):
        against(twice[:2], plain)


@pytest.mark.slow
@pytest.mark.parametrize("name", FOLLOW)
def test_gestures_show_the_emotion(name, speech):
    """Happiness is wider and faster than neutral, sadness and fear are narrower and slower, beyond chance; except `AS_WIDE`."""
    model, (width, people) = cospeech.load(name), FOLLOW[name]
    wrists = {
        emotion: [wrists_of(model.generate(speech, emotion=emotion, seed=seed, style=who)) for seed, who in enumerate(people)]
        for emotion in ("neutral", "happiness", "sadness", "fear")
    }
    for emotion, more in (("happiness", True), ("sadness", False), ("fear", False)):
        ratios = against(wrists[emotion], wrists["neutral"])
        for what in ("speed",) if (name, emotion) in AS_WIDE else (width, "speed"):
            low, high = ratios[what].interval
            assert low > 1 if more else high < 1, f"{emotion}: {what} × {ratios[what].value:.2f} ({low:.2f} … {high:.2f})"
