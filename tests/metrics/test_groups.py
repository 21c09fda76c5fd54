"""Windows of a recording, and takes of a speech, are drawn together: cutting or repeating clips does not narrow an interval."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.experiments.tables.verdicts import compare
from cospeech.metrics import FeatureNet, Sample, Tools, load_metric
from cospeech.metrics.interval import bootstrap, mean_score

FPS, CLIPS, FRAMES = 30.0, 12, 68
PAIRED = ("mae", "ape", "acceleration_error", "pck", "pck_gfge")
ALONE = ("jerk", "acceleration", "jerk_genea", "hellinger_speed", "w1_speed", "l1_div", "diversity_mix_stage")
NET = FeatureNet("deviations", lambda windows: windows.std(1), 34, 34)


def sample(name: str, seed: int, noise: float = 0.0) -> Sample:
    """A clip whose joints swing by an amount of its own."""
    rng = np.random.default_rng(seed)
    swing = rng.uniform(0.02, 0.3) * np.sin(np.arange(FRAMES)[:, None, None] / 5 + rng.normal(size=(4, 3)))
    positions = (
        rng.normal(size=(4, 3)) * 0.01 + swing + np.random.default_rng(seed + 1000).normal(0, 0.05 + noise, (FRAMES, 4, 3))
    )
    return Sample(name, FPS, positions=positions)


GENERATED = [sample(str(k), 50 + k, 0.02) for k in range(CLIPS)]
REFERENCE = [sample(str(k), k) for k in range(CLIPS)]


def cut(samples: list[Sample]) -> list[Sample]:
    """Each clip as two windows of the same group."""
    return [
        replace(each, name=f"{each.name}.{k}", condition=f"{each.name}.{k}", group=each.name,
                positions=each.positions[34 * k : 34 * k + 34])
        for each in samples
        for k in range(2)
    ]  # fmt: skip


def deviation(score) -> float:
    return float(np.std(score.draws))


@pytest.mark.parametrize("name", [*PAIRED, *ALONE, "fgd", "diversity", "cca"])
def test_takes_that_are_alike_do_not_narrow_the_interval(name):
    tools = Tools(features=NET)
    once, thrice = (load_metric(name)(GENERATED * times, REFERENCE, tools) for times in (1, 3))
    assert thrice.value == pytest.approx(once.value, rel=0.05)
    assert deviation(thrice) == pytest.approx(deviation(once), rel=0.05)


@pytest.mark.parametrize("name", ["mae", "ape", "pck", "fgd", "w1_speed"])
def test_windows_do_not_narrow_the_interval(name):
    tools = Tools(features=NET)
    whole = load_metric(name)(GENERATED, REFERENCE, tools)
    windows = load_metric(name)(cut(GENERATED), cut(REFERENCE), tools)
    assert deviation(windows) == pytest.approx(deviation(whole), rel=0.2)
    loose = [replace(each, group=each.name) for each in cut(GENERATED)]
    if name != "fgd":
        assert deviation(load_metric(name)(loose, cut(REFERENCE), tools)) < 0.85 * deviation(whole)


def test_no_effect_is_found_in_one_case_of_twenty_though_clips_are_windows():
    """60 clips of 10 windows that are alike, five seeds, and no difference between the systems."""
    rng, hits = np.random.default_rng(0), 0
    groups = [str(k) for k in range(60) for _ in range(10)]
    for _ in range(300):
        clips = rng.normal(size=(2, 60)).repeat(10, axis=1)
        rows = [
            [mean_score([*(own + rng.normal(0, 0.1, 600))], groups=groups) for _ in range(5)] for own in clips
        ]  # fmt: skip
        cells = [[{"value": score.value, "draws": score.draws} for score in row] for row in rows]
        hits += compare(*cells).differs < 0.05
    assert hits <= 30


def test_groups_are_drawn_whole():
    draws: list[np.ndarray] = []
    bootstrap(lambda clips: float(draws.append(clips) or 0), ["a", "b", "a", "c"], draws=50)
    for clips in draws:
        assert (clips == 0).sum() == (clips == 2).sum()
    assert bootstrap(lambda clips: 0.0, ["a", "a"], draws=5).interval is None


def test_cca_fits_no_take_of_the_recordings_that_it_judges():
    """Two takes of motion that has nothing to do with the recordings; each is like the other."""
    rng = np.random.default_rng(0)
    walks = [np.cumsum(rng.normal(size=(FRAMES, 4, 3)), 0) for _ in range(2 * 8)]
    truth = [Sample(str(k), FPS, positions=walks[k]) for k in range(8)]
    takes = [Sample(f"{k}.{t}", FPS, positions=walks[8 + k], condition=str(k)) for k in range(8) for t in range(2)]
    metric = load_metric("cca")
    assert metric(takes, truth).value == pytest.approx(metric(takes[::2], truth).value, abs=1e-6)


@pytest.mark.parametrize("name", ["pck_mix_stage", "pck_2d", "mode_f1", "mode_f1_published"])
def test_metrics_of_key_points_draw_clips(name):
    rng = np.random.default_rng(0)

    def points(k: int, size: float) -> Sample:
        return Sample(f"{k}", 15.0, points=rng.normal(0, size, (20, 52, 2)).cumsum(0), group=str(k // 2))

    reference = [points(k, 3.0) for k in range(12)]
    generated = [
        replace(each, points=each.points + rng.normal(0, 5.0 + k, each.points.shape)) for k, each in enumerate(reference)
    ]
    tools = Tools(centres=rng.normal(size=(4, 240)))
    score = load_metric(name)(generated, reference, tools)
    assert len(score.draws) == 200
    assert score.interval[0] <= score.value <= score.interval[1]
    single = load_metric(name)([replace(each, group="one") for each in generated], reference, tools)
    assert single.value == pytest.approx(score.value)
    assert single.draws == ()
