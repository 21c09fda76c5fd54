"""Metrics of a set of motions: diversity, multimodality, clusters, inception score, speeds, jerk."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.spatial.distance import jensenshannon
from scipy.stats import entropy, wasserstein_distance
from sklearn.metrics import calinski_harabasz_score, silhouette_score

from cospeech.errors import InputError
from cospeech.metrics import METRICS, FeatureNet, Sample, Tools, load_metric
from cospeech.metrics.clustering import calinski_harabasz, silhouette_coefficient
from cospeech.metrics.diversity import mean_pair_distance
from cospeech.metrics.genea import hellinger
from cospeech.metrics.inception_score import score_of_classes
from cospeech.metrics.metric import BETTER
from cospeech.metrics.movement import Track
from cospeech.metrics.wasserstein import distance, rates

FPS = 30.0
NET = FeatureNet("means", lambda w: w.mean(1), 34, 17)


def clips(count: int = 6, size: float = 1.0, seed: int = 0, frames: int = 300) -> list[Sample]:
    """Smooth random motion of 4 joints and 6 key points around a common pose, of ``size``."""
    rng, t = np.random.default_rng(seed), np.arange(frames) / FPS
    samples = []
    for k in range(count):
        waves = np.sin(2 * np.pi * rng.uniform(0.2, 1.5, (1, 4, 3)) * t[:, None, None] + rng.uniform(0, 6, (1, 4, 3)))
        waves[:, 0] = 0
        rest = np.arange(12).reshape(1, 4, 3) * 0.1
        points = np.repeat((rest + 0.1 * size * waves)[..., :2] * 300, 2, 1)[:, :6]
        samples.append(Sample(f"{k}", FPS, positions=rest + 0.1 * size * waves, points=points, label="ab"[k % 2]))
    return samples


def test_every_metric_says_what_it_needs_and_refuses_nothing_at_all():
    fields = {*Sample.__dataclass_fields__, *Tools.__dataclass_fields__}
    for name in METRICS:
        about = load_metric(name).about
        assert about.better in BETTER
        assert about.needs
        assert {part for need in about.needs for part in need.split("|")} <= fields, name
        with pytest.raises(InputError):
            load_metric(name)([], [])
        with pytest.raises(InputError, match="needs"):
            load_metric(name)([Sample("empty", FPS)], [Sample("empty", FPS)])
    with pytest.raises(InputError, match="did you mean 'fgd'"):
        load_metric("fdg")


IN_FRAMES = (
    "fgd", "fgd_published", "diversity", "diversity_gfge", "multimodality", "multimodality_ha2g", "chi", "silhouette",
    "chi_gfge", "silhouette_gfge", "inception_score", "inception_score_published", "w1_speed_mix_stage",
)  # fmt: skip
IN_SECONDS = (
    "fid_poses", "diversity_mix_stage", "l1_div", "w1_speed", "w1_acceleration", "jerk", "acceleration", "hellinger_speed",
)  # fmt: skip
CLASSES = FeatureNet("halves", lambda w: np.full((len(w), 2), 0.5), 34, 17)
ALL_TOOLS = Tools(features=NET, classifier=CLASSES, embedding=lambda x: x[:, :2])


@pytest.mark.parametrize("name", IN_FRAMES)
def test_what_counts_in_frames_refuses_clips_of_another_rate(name):
    slow = [replace(sample, fps=15.0) for sample in clips()]
    with pytest.raises(InputError, match=r"has 15 frames per second, the clip .* 30 \(.*resample"):
        load_metric(name)(slow, clips(), ALL_TOOLS)
    with pytest.raises(InputError, match="frames per second"):
        load_metric(name)([*clips()[:3], *slow[3:]], (), ALL_TOOLS)


@pytest.mark.parametrize("name", IN_SECONDS)
def test_what_counts_in_seconds_or_poses_takes_clips_of_any_rate(name):
    assert np.isfinite(load_metric(name)([replace(sample, fps=15.0) for sample in clips()], clips(), ALL_TOOLS).value)


@pytest.mark.parametrize(
    "name", sorted({*IN_FRAMES, "fid_poses", "diversity_mix_stage"} - {"multimodality", "w1_speed_mix_stage"})
)
def test_clips_of_other_joints_are_refused(name):
    fewer = [replace(sample, positions=sample.positions[:, :3], points=None) for sample in clips()]
    with pytest.raises(InputError, match=r"positions of '0' have shape \(300, 3, 3\), the clip .* \(300, 4, 3\)"):
        load_metric(name)(fewer, clips(), ALL_TOOLS)


def test_mean_distance_of_pairs_is_that_of_all_pairs():
    rows = np.random.default_rng(0).normal(size=(23, 7))
    slow = np.mean([np.abs(a - b).mean() for a, b in combinations(rows, 2)])
    assert mean_pair_distance(rows) == pytest.approx(slow, rel=1e-12)
    assert mean_pair_distance(rows[::-1]) == pytest.approx(slow, rel=1e-12)
    with pytest.raises(InputError):
        mean_pair_distance(rows[:1])


def test_a_clip_that_is_drawn_twice_does_not_make_diversity_smaller():
    """White noise has the same diversity however it is drawn: the interval is narrow, and around it."""
    draw = np.random.default_rng(4)
    noise = [replace(sample, positions=draw.normal(size=sample.positions.shape)) for sample in clips()]
    score = load_metric("diversity")(noise, (), ALL_TOOLS)
    low, high = score.interval
    assert low < score.value < high
    assert np.mean(score.draws) == pytest.approx(score.value, rel=0.005)


@pytest.mark.parametrize("name", ["diversity", "l1_div", "diversity_mix_stage"])
def test_diversity_grows_with_extent_and_does_not_know_order(name):
    measure, real = load_metric(name), clips()
    values = [measure(clips(size=size), real).value for size in (0.0, 0.5, 1.0, 2.0)]
    assert values[0] == pytest.approx(0, abs=1e-9) or name == "diversity_mix_stage"
    assert all(a < b for a, b in pairwise(values))
    assert measure(real[::-1], real).value == pytest.approx(measure(real, real).value)
    flat = [replace(s, positions=None) for s in real]
    assert measure(flat, flat).value > 0  # key points do too


def test_diversity_is_in_millimetres():
    still = [Sample(f"{k}", FPS, positions=np.tile([[0.0, 0, 0], [k * 0.01, 0, 0]], (34, 1, 1))) for k in range(2)]
    assert load_metric("diversity")(still).value == pytest.approx(10 / 3)  # one of three coordinates
    moving = np.zeros((10, 2, 3))
    moving[::2, 1, 0] = 0.02
    assert load_metric("l1_div")([Sample("a", FPS, positions=moving)]).value == pytest.approx(10 / 3)


def test_published_diversity_depends_on_order_and_drops_the_last_batch():
    rng = np.random.default_rng(0)
    far = [Sample(f"{k}", FPS, positions=np.concatenate([np.zeros((34, 1, 3)), np.full((34, 1, 3), v)], 1))
           for k, v in enumerate(rng.permutation(np.repeat([0.0, 1.0], 60)))]  # fmt: skip
    sorted_ones = sorted(far, key=lambda s: s.positions[0, 1, 0])
    measure = load_metric("diversity_gfge")
    assert measure(far).value > 1.3 * measure(sorted_ones).value
    assert measure(far).count == 2  # 120 windows: two batches of 50
    with pytest.raises(InputError, match="50"):
        measure(far[:49])


def test_l1_div_of_beat_is_a_sum_of_degrees():
    angles = np.zeros((40, 3, 3))
    angles[::2, 1, 0] = np.radians(20)
    from cospeech.motion.rotations import euler_to_quat

    assert load_metric("l1_div_beat")([Sample("a", FPS, rotations=euler_to_quat(angles))]).value == pytest.approx(10)
    turn = np.radians(np.linspace(170, 190, 21))[:, None, None] * [1, 0, 0]
    assert load_metric("l1_div_beat")([Sample("a", FPS, rotations=euler_to_quat(turn))]).value == pytest.approx(110 / 21)


def test_multimodality_compares_takes_of_one_speech_only():
    base = clips(2)
    takes = [replace(s, name=f"{s.name}.{k}", condition=s.name, positions=s.positions + np.array([0, 0, 0.01 * k])
                     * (np.arange(4) > 0)[:, None]) for s in base for k in range(3)]  # fmt: skip
    score = load_metric("multimodality")(takes)
    assert score.value == pytest.approx((10 + 20 + 10) / 3)
    assert load_metric("multimodality")(takes[::-1]).value == pytest.approx(score.value)
    same = [replace(s, name=f"{s.name}.{k}", condition=s.name) for s in base for k in range(2)]
    assert load_metric("multimodality")(same).value == 0
    assert load_metric("multimodality_ha2g")(same, (), Tools(features=NET)).value > 0  # speech against speech counts there
    with pytest.raises(InputError, match="two takes"):
        load_metric("multimodality")(base)
    with pytest.raises(InputError, match="shapes"):
        load_metric("multimodality")([takes[0], replace(takes[1], positions=takes[1].positions[:-1], points=None)])


def test_clustering_indices_are_those_of_scikit_learn():
    rng = np.random.default_rng(0)
    for groups, count in ((2, 30), (5, 700), (3, 12)):
        labels = rng.integers(0, groups, count)
        points = rng.normal(size=(count, 6)) + labels[:, None] * rng.uniform(0, 1.5)
        names = np.array(["x", "y", "z", "u", "v"])[labels]
        assert calinski_harabasz(points, names) == pytest.approx(calinski_harabasz_score(points, labels), rel=1e-9)
        assert silhouette_coefficient(points, names) == pytest.approx(silhouette_score(points, labels), abs=1e-6)
    for bad in (np.zeros(12), np.arange(12)):
        with pytest.raises(InputError):
            silhouette_coefficient(np.ones((12, 2)), bad)


def test_clusters_of_speakers_count_and_found_clusters_always_look_good():
    tools = Tools(features=NET, embedding=lambda x: x[:, [3, 4]])
    alike = clips(8)
    apart = [replace(s, positions=s.positions + (s.label == "b") * 0.3 * (np.arange(4) > 0)[:, None]) for s in alike]
    for name in ("chi", "silhouette"):
        values = [load_metric(name)(samples, (), tools).value for samples in (alike, apart)]
        assert values[1] > 5 * abs(values[0])
        assert load_metric(name)(apart[::-1], (), tools).value == pytest.approx(values[1])
    assert load_metric("silhouette")(alike, (), tools).value < 0.05
    assert load_metric("silhouette_gfge")(alike, (), tools).value > 0.25  # of speakers that do not differ at all
    assert load_metric("chi_gfge")(alike, (), tools).value > 5 * load_metric("chi")(alike, (), tools).value
    with pytest.raises(InputError, match="embedding"):
        load_metric("chi_gfge")(alike, (), Tools(features=NET))


def test_inception_score_is_between_one_and_the_number_of_classes():
    sure = np.eye(4)[np.arange(40) % 4]
    assert score_of_classes(sure) == pytest.approx(4)
    assert score_of_classes(sure, 1e-6) == pytest.approx(4, rel=1e-4)
    assert score_of_classes(np.full((40, 4), 0.25)) == pytest.approx(1)
    assert score_of_classes(np.eye(4)[np.zeros(40, int)]) == pytest.approx(1)
    classes = np.random.default_rng(0).dirichlet(np.ones(4), 50)
    expected = np.exp(np.mean([entropy(p, classes.mean(0)) for p in classes]))
    assert score_of_classes(classes) == pytest.approx(expected)
    assert score_of_classes(classes, 1e-6) == pytest.approx(expected, rel=1e-4)
    for bad in (np.ones((4, 3)), np.array([[1.5, -0.5]]), np.zeros((0, 3))):
        with pytest.raises(InputError):
            score_of_classes(bad)


def test_inception_score_falls_with_confusion():
    def classify(windows):
        height = windows[:, :, 4].mean(1) * 20
        return np.stack([np.exp(height), np.exp(-height)], 1) / (np.exp(height) + np.exp(-height))[:, None]

    clear = [replace(s, positions=s.positions - s.positions.mean(0) + (s.label == "a") * np.array([0, 1, 0])
                    * (np.arange(4) == 2)[:, None] - 0.5 * np.array([0, 1, 0]) * (np.arange(4) == 2)[:, None])
            for s in clips(12)]  # fmt: skip
    tools = Tools(classifier=FeatureNet("height", classify, 34, 34))
    flat = [replace(s, positions=s.positions * 0.02) for s in clear]
    for name in ("inception_score", "inception_score_published"):
        good, poor = (load_metric(name)(m, (), tools).value for m in (clear, flat))
        assert 2 >= good > 1.8 > 1.1 > poor >= 1 - 1e-9
    low, high = load_metric("inception_score")(clear, (), tools).interval
    assert low <= load_metric("inception_score")(clear, (), tools).value <= high
    whole = load_metric("inception_score_published")
    assert whole(clear[::-1], (), tools).value == pytest.approx(whole(clear, (), tools).value)


def test_rates_have_units():
    t = np.arange(31) / FPS
    positions = np.zeros((31, 2, 3))
    positions[:, 1, 0] = 0.5 * 4.0 * t**2
    sample = Sample("a", FPS, positions=positions)
    np.testing.assert_allclose(rates(sample, 2), 4.0)
    np.testing.assert_allclose(rates(sample, 1)[:, 0], 4.0 * (t[1:] + t[:-1]) / 2)
    assert load_metric("acceleration")([sample]).value == pytest.approx(4.0)
    assert load_metric("jerk")([sample]).value == pytest.approx(0, abs=1e-6)
    with pytest.raises(InputError, match="frames"):
        rates(replace(sample, positions=positions[:2]), 2)


def test_jerk_is_per_second_and_genea_takes_every_rate_for_thirty():
    t = np.arange(0, 2, 1 / 60)
    positions = np.zeros((len(t), 2, 3))
    positions[:, 1, 1] = t**3
    fast, slow = (Sample("a", fps, positions=positions[:: int(60 / fps)]) for fps in (60.0, 30.0))
    assert load_metric("jerk")([fast]).value == pytest.approx(6.0)
    assert load_metric("jerk")([slow]).value == pytest.approx(6.0)
    assert load_metric("jerk_genea")([slow]).value == pytest.approx(6.0)
    assert load_metric("jerk_genea")([fast]).value == pytest.approx(6.0 / 8)


def test_wasserstein_is_that_of_scipy_and_of_a_shift():
    a, b = np.random.default_rng(0).gamma(2, size=(2, 500))
    assert distance(a, b) == pytest.approx(wasserstein_distance(a, b))
    assert distance(a, a + 0.7) == pytest.approx(0.7)


@pytest.mark.parametrize(
    "name", ["w1_speed", "w1_acceleration", "hellinger_speed", "hellinger_speed_genea", "w1_speed_mix_stage"]
)
def test_distances_of_speeds_are_zero_for_the_same_and_grow(name):
    measure, real = load_metric(name), clips()
    values = [measure(clips(size=size), real).value for size in (1.0, 1.2, 1.6, 2.5)]
    assert values[0] == pytest.approx(0, abs=1e-7)
    assert all(a < b for a, b in pairwise(values))
    assert measure(clips(size=1.6)[::-1], real[::-1]).value == pytest.approx(values[2])
    score = measure(clips(size=1.6), real)
    if score.interval:
        assert score.interval[0] <= score.value <= score.interval[1]
    still = [replace(real[0], positions=real[0].positions[:1], points=real[0].points[:1])]
    if name == "w1_speed_mix_stage":
        assert measure(still, real).value == 1000  # as coded
    else:
        with pytest.raises(InputError):
            measure(still, real)


def test_hellinger_is_bounded_symmetric_and_genea_does_not_see_haste():
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, 50, (2, 20))
    assert hellinger(a, b) == pytest.approx(hellinger(b * 3, a * 7))
    assert hellinger(a, a) == 0  # no error of rounding, which looks like a distance in a table
    p, q = a / a.sum(), b / b.sum()
    assert hellinger(a, b) == pytest.approx(np.sqrt(np.sum((np.sqrt(p) - np.sqrt(q)) ** 2) / 2))
    assert hellinger(a, b) <= np.sqrt(2 * np.log(2)) * jensenshannon(p, q) * 1.5
    real = clips(size=0.3)
    bursts = []
    for s in real:
        jump = np.zeros(len(s.positions))
        jump[::10] = 3.0  # 90 m/s, now and then
        bursts.append(replace(s, positions=s.positions + jump[:, None, None] * (np.arange(4) > 0)[:, None]))
    of_speed, of_genea = (load_metric(n)(bursts, real).value for n in ("hellinger_speed", "hellinger_speed_genea"))
    assert of_genea < 0.05 < 0.2 < of_speed


def test_movement_is_the_share_of_rows_in_range():
    rng = np.random.default_rng(0)
    frames = 900
    hips = np.tile([0.0, 0.9, 0.0], (frames, 1))
    shoulders = np.tile(np.array([[0.18, 1.4, 0.0], [-0.18, 1.4, 0.0]]), (frames, 1, 1))
    wrists = np.tile(np.array([[0.2, 1.1, 0.3], [-0.2, 1.1, 0.3]]), (frames, 1, 1)) + rng.normal(size=(frames, 2, 3)) * 0.1
    noise = Sample("noise", FPS, positions=wrists, track=Track(FPS, hips, shoulders, (shoulders + wrists) / 2, wrists))
    assert 0 <= load_metric("movement")([noise]).value < 0.6
    part = {name: getattr(noise.track, name)[:60] for name in ("hips", "shoulders", "elbows", "wrists")}
    with pytest.raises(InputError, match="3 s"):
        load_metric("movement")([replace(noise, track=Track(FPS, **part))])
