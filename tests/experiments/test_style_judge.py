"""The judge of styles is blind to mean pose and amplitude, sees manner, and says what it cannot judge."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.experiments.style_judge import StyleJudge, describe_manner
from cospeech.motion.poses import find_pose
from tests.support.motions import gesturing

NAMES = ("trunk", "head", "left arm", "left hand", "right arm", "right hand")
PARTS = {name: np.arange(3 * k, 3 * k + 3) for k, name in enumerate(NAMES)}


def noise(*hertz: float, seed: int = 0) -> np.ndarray:
    """(120, 18) of sines of random phases, one frequency after the other from column to column."""
    rng = np.random.default_rng(seed)
    rates = np.resize(hertz, 18)
    waves = np.sin(2 * np.pi * (rates * np.arange(120)[:, None] / 15 + rng.uniform(size=18)))
    return waves + rng.normal(0, 0.05, waves.shape)


def moving(hertz: float, seed: int):
    """12 s in which everything swings at one rate."""
    pose, rng = find_pose("expmap-humanoid"), np.random.default_rng(seed)
    phases, size = rng.uniform(0, 0.4, pose.dimensions), rng.uniform(0.05, 0.15)
    rest = pose.encode(gesturing(30, 15.0)).mean(0)
    return pose.decode(rest + size * np.sin(2 * np.pi * (hertz * np.arange(180)[:, None] / 15 + phases)), 15.0)


def test_mean_and_amplitude_are_not_seen():
    window, rng = noise(0.5, 1.0, 2.0), np.random.default_rng(1)
    other = rng.normal(size=18) + window * rng.uniform(0.2, 3, 18)
    descriptions = [describe_manner(poses, PARTS, arms=False) for poses in (window, other)]
    np.testing.assert_allclose(*descriptions, atol=1e-9)


def test_the_share_of_an_arm_is_seen_unless_it_is_left_out():
    window, other = noise(1.0), noise(1.0)
    other[:, PARTS["left arm"]] *= 3
    assert not np.allclose(describe_manner(window, PARTS), describe_manner(other, PARTS))
    assert len(describe_manner(window, PARTS)) == len(describe_manner(window, PARTS, arms=False)) + 1


def test_what_is_still_is_no_manner():
    window = noise(1.0)
    window[:, PARTS["trunk"]] = 3.0
    assert np.isfinite(describe_manner(window, PARTS)).all()


def test_tempo_is_named():
    judge = StyleJudge((style, moving(hertz, 10 * style + k)) for style, hertz in enumerate((0.5, 1.5)) for k in range(4))
    assert [judge.name(moving(hertz, 99)) for hertz in (0.5, 1.5)] == [0, 1]


def test_what_cannot_be_judged():
    judge = StyleJudge((style, moving(hertz, k)) for style, hertz in enumerate((0.5, 1.5)) for k in range(2))
    with pytest.raises(InputError, match=r"a motion of 5\.0 s \(a judge sees 10 s or more\)"):
        judge.name(moving(1.0, 0)[:75])
    for styles in ([0, 0], [0, 2]):
        with pytest.raises(InputError, match="two at least, numbered from 0 on"):
            StyleJudge((style, moving(0.5, k)) for k, style in enumerate(styles))
