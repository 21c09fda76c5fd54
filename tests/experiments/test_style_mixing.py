"""Mixtures of styles: what is measured is right, and what ships moves from one parent to the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech import models
from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.corpora.attributes import Attributes
from cospeech.errors import InputError
from cospeech.experiments.figures.curves import PlottedCurve, draw_curves
from cospeech.experiments.style_mixing import MEASURES, Mixing, draw_mixing, fall_back, measure_mixing
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import humanoid

pytestmark = pytest.mark.slow

FPS = 30.0
SPEECH = Speech(np.zeros(12 * 16000, np.float32), 16000)
PARENTS = {"slow": (0.5, 0.5, 0.0), "quick": (1.0, 0.0, 0.5)}  # strokes' frequency in Hz, swing of the right and the left arm
FOLDER = models.SHIPPED
BUNDLE = FOLDER / f"mix-stage{models.BUNDLE}"
PAIRS = {"rate": ("ada", "femi"), "amplitude": ("elif", "gita"), "right_share": ("dan", "femi")}
"""Measure → speakers that differ much in it, of the synthetic corpus that the shipped bundle is trained on."""
RULES = {("storyteller", "reserved"): ("rate", "amplitude"), ("lecturer", "southpaw"): ("right_share",)}
FALLS = 0.25  # of the parents' difference; one speech of 19 s is a noisier measure than that for which `TOLERANCE` was chosen


def swinging(hertz: float, right: float, left: float, seconds: float, phase: float = 0.0) -> Motion:
    """Upper arms that swing sideways as sines; radians."""
    body, frames = humanoid(), round(seconds * FPS)
    rotations = np.zeros((frames, len(body), 4), np.float32)
    rotations[..., 3] = 1
    sine = np.sin(2 * np.pi * hertz * np.arange(frames) / FPS + phase)
    for name, swing in (("rightUpperArm", right), ("leftUpperArm", left)):
        rotations[:, body.index[name], 2] = np.sin(swing * sine / 2)
        rotations[:, body.index[name], 3] = np.cos(swing * sine / 2)
    root = np.repeat(body.offsets[:1], frames, 0).astype(np.float32)
    return Motion(FPS, rotations, root)


class Fake:
    """Plays motion between its two parents; ``bend`` maps the weight of the second one to its share."""

    takes_at_once = 1

    def __init__(self, bend=lambda w: w) -> None:
        self.bend, self.calls = bend, []

    def generate(self, speech: Speech, *, style: str, seed: int, parts: tuple[str, ...]) -> Motion:
        shares = {name: float(weight) for name, _, weight in (part.partition(":") for part in style.split(","))}
        self.calls.append((style, seed))
        assert sum(shares.values()) == pytest.approx(1)
        assert "face" not in parts
        w = self.bend(shares["quick"])
        numbers = [(1 - w) * a + w * b for a, b in zip(PARENTS["slow"], PARENTS["quick"], strict=True)]
        return swinging(*numbers, float(speech.duration), phase=seed)


def test_mixtures_are_played_and_measured():
    fake = Fake()
    mixing = measure_mixing(fake, [SPEECH, SPEECH], ("slow", "quick"), takes=2, seed=3)
    assert [style for style, _ in fake.calls[::4]] == [
        "slow:1,quick:0", "slow:0.75,quick:0.25", "slow:0.5,quick:0.5", "slow:0.25,quick:0.75", "slow:0,quick:1",
    ]  # fmt: skip
    assert [seed for _, seed in fake.calls[:4]] == [3, 4, 3, 4]
    hertz = 0.5 + 0.5 * np.array(mixing.weights)
    np.testing.assert_allclose(mixing.means("rate"), 120 * hertz, atol=10)  # twice per period; one at the edge is 5 a minute
    np.testing.assert_allclose(mixing.means("right_share"), 1 - np.array(mixing.weights), atol=0.05)
    arm = np.linalg.norm(np.diff(humanoid().tpose[[humanoid().index[n] for n in ("rightUpperArm", "rightHand")]], axis=0))
    width = np.linalg.norm(np.diff(humanoid().tpose[[humanoid().index[n] for n in ("rightUpperArm", "leftUpperArm")]], axis=0))
    swings = 0.5 * np.stack([1 - np.array(mixing.weights), np.array(mixing.weights)])
    expected = arm / width * np.sqrt(np.square(swings).mean(0) / 2)  # of both wrists; a sine's mean square is a half
    np.testing.assert_allclose(mixing.means("amplitude"), expected, rtol=0.08)
    assert mixing.monotone("rate")
    assert mixing.monotone("right_share")
    assert mixing.contrast("right_share") > 10
    assert mixing.values("rate").shape == (5, 4)


def test_a_system_that_overshoots_is_found_out():
    mixing = measure_mixing(Fake(lambda w: min(1.0, 4 * w) if w < 1 else 0.5), [SPEECH], ("slow", "quick"), takes=1)
    assert not mixing.monotone("rate")
    assert not mixing.monotone("right_share")
    assert fall_back(mixing.means("right_share").tolist()) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize(
    ("way", "back"),
    [([0, 1, 2], 0), ([2, 1, 0], 0), ([0, 0, 1], 0), ([0, 2, 1], 1), ([0, -1, 2], 0.5), ([5, 5.5, 4], 0.5), ([3, 3, 3], 0)],
)
def test_falling_back(way, back):
    assert fall_back(way) == pytest.approx(back)
    assert fall_back([7 - 3 * v for v in way]) == pytest.approx(back)


def test_any_detour_between_equal_parents_falls_back_without_limit():
    assert fall_back([1, 2, 1]) > 1e6


@pytest.mark.parametrize("weights", [(0, 1, 0.5), (0.1, 1), (0, 0.9), (0, 0, 1), (1,)])
def test_weights_go_from_one_to_the_other(weights):
    with pytest.raises(InputError, match="rise from 0 to 1"):
        measure_mixing(Fake(), [SPEECH], ("slow", "quick"), weights=weights)
    with pytest.raises(InputError):
        measure_mixing(Fake(), [], ("slow", "quick"))


def test_pictures_show_curves_and_heat_maps():
    mixing = measure_mixing(Fake(), [SPEECH], ("slow", "quick"), takes=2)
    picture = draw_mixing([mixing], title="swinging")
    both = draw_mixing([mixing, mixing], title="swinging")
    assert both.shape[0] > 1.8 * picture.shape[0]
    assert both.shape[1:] == picture.shape[1:]
    own = Attributes(rate=60, amplitude=0.3, right_share=1.0, orientation=0, seated=0)
    with_recordings = draw_mixing([mixing], title="swinging", recordings={"slow": own, "quick": replace(own, right_share=0)})
    assert (with_recordings != picture).any()
    with pytest.raises(InputError):
        draw_mixing([], title="nothing")


def test_ticks_are_round_and_take_all_in():
    for low, high in ((41.7, 45.6), (0.0, 1.0), (-3.0, 1250.0), (0.342, 0.3421)):
        curve = PlottedCurve("a", "b", None, np.arange(3.0), np.array([low, high, low]), np.zeros(3), ("l", "r"))
        ticks = curve.ticks
        assert ticks[0] <= low
        assert ticks[-1] >= high
        assert 2 <= len(ticks) <= 7
        mantissa = (ticks[1] - ticks[0]) / 10 ** np.floor(np.log10(ticks[1] - ticks[0]) + 1e-9)
        assert min(abs(mantissa - k) for k in (1, 2, 5)) < 1e-6
    wide = PlottedCurve("a", "b", None, np.arange(3.0), np.array([0.0, 2, 9]), np.full(3, 1.0), ("l", "r"))
    assert wide.ticks[0] == 0  # an interval reaches below what can be, the axis does not
    with pytest.raises(InputError):
        draw_curves([], 600)
    with pytest.raises(InputError):
        PlottedCurve("a", "b", None, np.arange(3.0), np.array([1, np.nan, 2]), np.zeros(3), ("l", "r"))


@pytest.mark.parametrize(("pair", "measures"), RULES.items())
def test_the_rules_styles_mix_monotonically(pair, measures):
    takes = 16  # with six, chance alone moves the means by a third
    mixing = measure_mixing(models.load("rules"), [Speech.load(EXAMPLE)], pair, takes=takes)
    for measure in measures:
        assert mixing.contrast(measure) > 2
        assert mixing.monotone(measure, FALLS), mixing.means(measure)


def test_takes_at_once_are_those_of_the_seeds():
    flow = FOLDER / f"stylised-flow{models.BUNDLE}"
    if not flow.is_file():
        pytest.skip("stylised-flow does not ship yet")
    model, speech = models.load("stylised-flow"), Speech.load(EXAMPLE).window(0, 3)
    mixing = measure_mixing(model, [speech], ("cleo", "dan"), weights=(0, 1), takes=2, seed=5)
    alone = model.generate(speech, style="dan", seed=6, parts=("body", "hands"))
    np.testing.assert_array_equal(mixing.motions[1][1].rotations, alone.rotations)
    assert [len(row) for row in mixing.motions] == [2, 2]


@pytest.fixture(scope="module")
def mixings() -> dict[tuple[str, str], Mixing]:
    """Pair → the mixtures that the shipped Mix-StAGE plays to the example speech."""
    if not BUNDLE.is_file():
        pytest.skip(f"{BUNDLE.name} does not ship yet")
    model, speech = models.load("mix-stage"), Speech.load(EXAMPLE)
    return {pair: measure_mixing(model, [speech], pair, takes=4) for pair in dict.fromkeys(PAIRS.values())}


@pytest.mark.parametrize("measure", MEASURES)
def test_what_ships_mixes_monotonically(mixings, measure):
    mixing = mixings[PAIRS[measure]]
    assert mixing.contrast(measure) > 2, "these parents are alike"
    assert mixing.monotone(measure, FALLS), mixing.means(measure)
