"""Statistics of ratings: known values, the right share of false alarms, and intervals that hold the truth."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("scipy", reason="reports need scipy (the studio extra)")

from cospeech.studio.study.statistics import alpha, estimate, grid

# Krippendorff 2011, "Computing Krippendorff's Alpha-Reliability", section C: four observers, twelve units
RATINGS = """
1 2 3 3 2 1 4 1 2 . . .
1 2 3 3 2 2 4 1 2 5 . 3
. 3 3 3 2 3 4 2 2 5 1 .
1 2 3 3 2 4 4 1 2 5 1 .
"""


def test_alpha_is_that_of_the_paper():
    cells = np.array([[np.nan if x == "." else float(x) for x in line.split()] for line in RATINGS.strip().splitlines()])
    assert alpha(cells) == pytest.approx(0.849, abs=5e-4)
    assert alpha(cells, lambda a, b: (a != b).astype(float)) == pytest.approx(0.743, abs=5e-4)


def test_alpha_of_perfect_agreement_and_of_none():
    values = np.tile(np.arange(1.0, 6.0), 8)
    assert alpha(np.stack([values, values])) == pytest.approx(1)
    draw = np.random.default_rng(0)
    assert abs(alpha(draw.integers(1, 6, (20, 200)).astype(float))) < 0.02
    assert np.isnan(alpha(np.full((2, 4), 3.0)))
    assert np.isnan(alpha(np.array([[1.0, np.nan], [np.nan, 2.0]])))


def draw_ratings(draw: np.random.Generator, effect: float, raters: int = 20, clips: int = 15) -> np.ndarray:
    """Differences to which rater, clip and chance add; a third is missing."""
    cells = effect + draw.normal(0, 0.5, (raters, 1)) + draw.normal(0, 0.5, (1, clips)) + draw.normal(0, 1, (raters, clips))
    cells[draw.random(cells.shape) < 1 / 3] = np.nan
    return cells


def false_alarms(count: int) -> tuple[float, float]:
    """Share of nulls that are called effects, and share of intervals that hold 0."""
    draw = np.random.default_rng(1)
    estimates = [estimate(draw_ratings(draw, 0.0)) for _ in range(count)]
    return float(np.mean([e.p < 0.05 for e in estimates])), float(np.mean([e.low <= 0 <= e.high for e in estimates]))


@pytest.mark.slow
def test_a_null_is_called_an_effect_as_often_as_the_level_says():
    alarms, share_of_intervals = false_alarms(250)
    assert 0.01 < alarms < 0.09
    assert share_of_intervals > 0.9


def test_an_effect_is_found():
    draw = np.random.default_rng(2)
    assert sum(estimate(draw_ratings(draw, 1.0)).p < 0.05 for _ in range(20)) >= 19


def test_raters_with_opinions_of_their_own_widen_the_error():
    draw = np.random.default_rng(3)
    apart = draw.normal(0, 1, (12, 1)) + np.zeros((12, 10))
    assert estimate(apart).error == pytest.approx(apart[:, 0].std(ddof=1) / 12**0.5, rel=0.05)


def test_edges():
    assert np.isnan(estimate(np.full((3, 3), np.nan)).mean)
    lonely = estimate(np.array([[1.0, 2.0, 3.0]]))
    assert lonely.mean == 2
    assert np.isnan(lonely.p)
    assert estimate(np.zeros((4, 4))).p == 1
    assert grid([("r", "c", 1.0), ("r", "c", 3.0), ("s", "d", 5.0)]).tolist()[0][0] == 2
