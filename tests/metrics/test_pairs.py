"""Metrics that compare with the recording: PCK, errors, SRGR, mode F1, CCA."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from sklearn.cross_decomposition import CCA
from sklearn.metrics import f1_score

from cospeech.errors import InputError
from cospeech.metrics import Sample, Tools, load_metric
from cospeech.metrics.cca import canonical
from cospeech.metrics.mode_f1 import average_f1, confusion, mode_features, nearest_centre
from cospeech.motion.rotations import axis_angle_to_quat, euler_to_quat, quat_multiply, quat_normalize, rotvec_to_quat

FPS, FRAMES = 30.0, 90
SPEAKERS = ("chemistry", "corden", "lec_cosmic", "maher", "noah", "oliver", "seth", "ytch_prof")
CENTRES = "centers/8_pose_velocity_speed_0_7_8_9_pose_normalize"


def clips(count: int = 4, seed: int = 0) -> list[Sample]:
    """Random walks of 5 joints and 52 key points, rotations, and semantic scores."""
    rng = np.random.default_rng(seed)
    samples = []
    for k in range(count):
        rotations = quat_normalize(rng.normal(size=(1, 5, 4)) + 0.1 * np.cumsum(rng.normal(size=(FRAMES, 5, 4)), 0))
        samples.append(
            Sample(
                f"clip {k}",
                FPS,
                positions=np.cumsum(rng.normal(size=(FRAMES, 5, 3)), 0) * 0.01,
                points=rng.normal(size=(1, 52, 2)) * 200 + np.cumsum(rng.normal(size=(FRAMES, 52, 2)), 0) * 5,
                rotations=rotations,
                semantics=rng.choice([0, 0, 0.5, 1.0], FRAMES),
            )
        )
    return samples


def worse(samples: list[Sample], amount: float) -> list[Sample]:
    """The samples with noise of this size; the noise is the same each time."""
    rng = np.random.default_rng(9)
    result = []
    for s in samples:
        turn = rotvec_to_quat(rng.normal(size=(*s.rotations.shape[:2], 3)) * 0.02 * amount)
        result.append(
            replace(
                s,
                positions=s.positions + rng.normal(size=s.positions.shape) * 0.05 * amount,
                points=s.points + rng.normal(size=s.points.shape) * 80 * amount,
                rotations=quat_multiply(s.rotations, turn),
            )
        )
    return result


TOOLS = Tools(centres=np.random.default_rng(3).normal(size=(8, 240)) * 150)
PERFECT = {
    "pck": 1, "pck_gfge": 1, "pck_2d": 1, "pck_mix_stage": 1, "pck_s2g": 1, "mae": 0, "ape": 0, "acceleration_error": 0,
    "srgr": 1,
    "mode_f1": 1, "mode_f1_published": 1, "cca": 1, "cca_genea": 1, "srgr_beat": None,
}  # fmt: skip


@pytest.mark.parametrize(("name", "perfect"), PERFECT.items())
def test_the_same_is_perfect_and_more_noise_is_worse(name, perfect):
    measure, real = load_metric(name), clips()
    values = [measure(worse(real, amount), real, TOOLS).value for amount in (0, 1, 2, 4)]
    if perfect is not None:
        assert values[0] == pytest.approx(perfect, abs=1e-9)
    signs = -1 if measure.about.better == "higher" else 1
    assert all(signs * a < signs * b for a, b in pairwise(values)), values


@pytest.mark.parametrize("name", sorted(set(PERFECT) - {"pck_mix_stage", "mode_f1_published", "cca"}))
def test_the_order_of_clips_does_not_matter(name):
    measure, real = load_metric(name), clips()
    noisy = worse(real, 2)
    assert measure(noisy[::-1], real, TOOLS).value == pytest.approx(measure(noisy, real, TOOLS).value, rel=1e-9)


@pytest.mark.parametrize("name", PERFECT)
def test_what_does_not_fit_is_refused(name):
    measure, real = load_metric(name), clips()
    short = [
        replace(s, positions=s.positions[:-1], points=s.points[:-1], rotations=s.rotations[:-1], semantics=s.semantics[:-1])
        for s in real
    ]
    with pytest.raises(InputError, match="shape"):
        measure(short, real, TOOLS)
    with pytest.raises(InputError, match="no reference clip"):
        measure([replace(real[0], condition="another")], real, TOOLS)
    with pytest.raises(InputError):
        measure([], real, TOOLS)
    with pytest.raises(InputError, match="needs"):
        measure([Sample("empty", FPS, condition="clip 0")], real, TOOLS)
    with pytest.raises(InputError, match="finite"):
        Sample("nan", FPS, positions=np.full((3, 2, 3), np.nan))


def test_pck_counts_joints_within_ten_centimetres_and_leaves_gifts_out():
    true = np.zeros((10, 4, 3))
    positions = true.copy()
    positions[4:, 1] = (0.0999, 0, 0)
    positions[4:, 2] = (0.1001, 0, 0)
    positions[4:, 3] = (0.3, 0.1, 0)
    real, generated = [Sample("a", FPS, positions=true)], [Sample("a", FPS, positions=positions, seed_frames=4)]
    assert load_metric("pck")(generated, real).value == pytest.approx(1 / 3)
    assert load_metric("pck_gfge")(generated, real).value == pytest.approx((4 * 4 + 6 * 2) / 40)
    elsewhere = [Sample("a", FPS, positions=positions + [5.0, 0, 1], seed_frames=4)]
    assert load_metric("pck")(elsewhere, real).value == pytest.approx(1 / 3)


def test_pck_in_two_dimensions_measures_in_boxes():
    true = np.zeros((1, 52, 2))
    true[0, 1], true[0, 2] = (100, 0), (0, 50)  # the box is 100 wide
    true[0, 7] = (0, -100)  # masked, and yet its height is 150: thresholds 15 and 30 with it, 10 and 20 without
    points = true.copy()
    points[0, 3], points[0, 4], points[0, 5], points[0, 8] = (14, 0), (29, 0), (31, 0), (900, 0)
    real, generated = [Sample("a", 15.0, points=true)], [Sample("a", 15.0, points=points)]
    assert load_metric("pck_2d")(generated, real).value == pytest.approx((46 / 48 + 47 / 48) / 2)
    edge = true.copy()
    edge[0, 3], edge[0, 4] = (20, 0), (20.1, 0)  # Speech2Gesture: box of kept points, ≤
    assert load_metric("pck_s2g")([Sample("a", 15.0, points=edge)], real).value == pytest.approx(47 / 48)


def test_mix_stage_averages_running_means():
    real = clips(3)
    generated = [*real[:1], *worse(real, 9)[1:]]
    forward = load_metric("pck_mix_stage")(generated, real).value
    backward = load_metric("pck_mix_stage")(generated[::-1], real).value
    per = [load_metric("pck_2d")([g], real).value for g in generated]
    assert forward == pytest.approx(np.mean([np.mean(per[: k + 1]) for k in range(3)]))
    assert forward > load_metric("pck_2d")(generated, real).value > backward


def test_errors_have_units():
    true = np.zeros((20, 3, 3))
    positions = true.copy()
    positions[:, 1:] = (0.03, 0.04, 0)
    real, generated = [Sample("a", FPS, positions=true)], [Sample("a", FPS, positions=positions)]
    assert load_metric("ape")(generated, real).value == pytest.approx(0.05)
    assert load_metric("mae")(generated, real).value == pytest.approx(0.07 / 3)
    t = np.arange(20) / FPS
    positions = true.copy()
    positions[:, 1:, 1] = 0.5 * 6.0 * t[:, None] ** 2  # 6 m/s² along one of three axes
    assert load_metric("acceleration_error")([Sample("a", FPS, positions=positions)], real).value == pytest.approx(2.0)


def test_srgr_is_weighted_by_meaning_and_knows_that_angles_wrap():
    true = euler_to_quat(np.radians(np.tile([179.9, 0.0, 0.0], (10, 2, 1))))
    near = euler_to_quat(np.radians(np.tile([-178.1, 0.0, 0.0], (10, 2, 1))))  # 2° away
    weights = np.array([0, 0, 0, 0, 0, 1, 1, 0.5, 0.5, 0])
    real = [Sample("a", FPS, rotations=true, semantics=weights)]
    assert load_metric("srgr")([Sample("a", FPS, rotations=near, semantics=weights)], real).value == pytest.approx(1)
    assert load_metric("srgr_beat")([Sample("a", FPS, rotations=near, semantics=weights)], real).value == 0
    assert load_metric("srgr_beat")(real, real).value == pytest.approx(weights.mean() / 0.165)
    off = true.copy()
    off[5] = quat_multiply(axis_angle_to_quat([0, 1, 0], np.radians(4.1)), true[5])
    off[0] = quat_multiply(axis_angle_to_quat([0, 1, 0], np.radians(90)), true[0])  # means nothing
    assert load_metric("srgr")([Sample("a", FPS, rotations=off, semantics=weights)], real).value == pytest.approx(2 / 3)
    with pytest.raises(InputError, match="semantic score"):
        load_metric("srgr")(real, [Sample("a", FPS, rotations=true, semantics=np.zeros(10))])
    with pytest.raises(InputError, match="semantic scores"):
        load_metric("srgr")(real, [Sample("a", FPS, rotations=true, semantics=weights * 3)])


@pytest.mark.parametrize("name", ["srgr", "srgr_beat"])
def test_joints_that_stand_still_in_all_recordings_do_not_count(name):
    rng = np.random.default_rng(3)
    weights = rng.random(20)

    def sample(seed: int, still: int) -> Sample:
        angles = np.random.default_rng(seed).normal(size=(20, 4, 3)) * 3
        legs = np.broadcast_to(np.array([30.0, 0, 0]), (20, still, 3))
        rotations = euler_to_quat(np.radians(np.concatenate([legs, angles], 1)), "XYZ")
        return Sample("a", FPS, rotations=rotations, semantics=weights)

    bare = load_metric(name)([sample(1, 0)], [sample(0, 0)]).value
    assert load_metric(name)([sample(1, 7)], [sample(0, 7)]).value == pytest.approx(bare)
    assert 0 < bare < load_metric(name)([sample(0, 7)], [sample(0, 7)]).value


def slow_modes(clip_list: list[np.ndarray], centres: np.ndarray, *, across_clips: bool) -> list[int]:
    """Frame by frame and joint by joint, as one would with pencil and paper."""
    names, before = [], None
    keep = [k for k in range(52) if k not in (0, 7, 8, 9)]
    for clip in clip_list:
        before = before if across_clips else None
        for frame in clip:
            x = [frame[k][0] - frame[0][0] for k in keep]
            y = [-(frame[k][1] - frame[0][1]) for k in keep]
            pose = np.array(x + y)
            velocity = pose - before if before is not None else pose * 0
            speed = np.sqrt(velocity[:48] ** 2 + velocity[48:] ** 2)
            whole = np.concatenate([pose, velocity, speed])
            names.append(int(np.argmin([np.sum((whole - centre) ** 2) for centre in centres])))
            before = pose
    return names


def real_poses(shared_folder, speaker: str, seed: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """The speaker's centres, and clips that wander between their poses."""
    h5py = pytest.importorskip("h5py", reason="the real centres are HDF5: pip install 'cospeech[corpora]'")
    with h5py.File(shared_folder / "data/pats_stats" / f"{speaker}.kmeans.h5") as file:
        centres = np.asarray(file[CENTRES])
    rng, walks = np.random.default_rng(seed), []
    for _ in range(3):
        order = rng.integers(0, 8, 5)
        way = np.concatenate([np.linspace(centres[a, :96], centres[b, :96], 12) for a, b in pairwise(order)])
        way = way + rng.normal(size=way.shape) * 12
        points = np.zeros((len(way), 52, 2))
        keep = [k for k in range(52) if k not in (0, 7, 8, 9)]
        points[:, keep] = np.stack([way[:, :48], -way[:, 48:]], -1)
        walks.append(points + rng.normal(size=2) * 300)
    return centres, walks


@pytest.mark.parametrize("speaker", SPEAKERS)
def test_mode_f1_agrees_with_a_direct_computation_on_the_real_centres(shared_folder, speaker):
    centres, true = real_poses(shared_folder, speaker, 0)
    poses = real_poses(shared_folder, speaker, 1)[1]
    poses = [0.3 * a + 0.7 * b for a, b in zip(poses, true, strict=True)]
    samples = [[Sample(f"{k}", 15.0, points=x) for k, x in enumerate(side)] for side in (poses, true)]
    assert centres.shape == (8, 240)
    assert np.abs(centres[:, 192:]).min() == centres[:, 192:].min() > 0  # speeds are positive, where we take them to be
    values = []
    for name, across_clips in (("mode_f1", False), ("mode_f1_published", True)):
        a, b = (slow_modes(side, centres, across_clips=across_clips) for side in (poses, true))
        value = load_metric(name)(*samples, Tools(centres=centres)).value
        assert value == pytest.approx(f1_score(b, a, average="weighted", labels=range(8), zero_division=0), abs=1e-12)
        assert 0.2 < value < 1
        values.append(value)
        assert load_metric(name)(samples[1], samples[1], Tools(centres=centres)).value == 1
    features = mode_features(true[0])
    assert len(set(nearest_centre(features, centres))) > 1


def test_the_jump_between_clips_is_in_the_published_form_only():
    here, there = np.zeros((3, 52, 2)), np.zeros((3, 52, 2))
    there[:, 1:, 0] = 400.0
    centres = np.zeros((3, 240))
    centres[1:, :48] = 400  # there,
    centres[1, 96:144], centres[1, 192:] = 400, 400  # and with a jump
    real = [Sample("a", 15.0, points=here), Sample("b", 15.0, points=there)]
    wrong = [Sample("a", 15.0, points=there), Sample("b", 15.0, points=there)]
    tools = Tools(centres=centres)
    # modes 0 0 0 2 2 2 against 2 2 2 2 2 2, and as published 0 0 0 1 2 2 against 2 2 2 2 2 2
    assert load_metric("mode_f1")(wrong, real, tools).value == pytest.approx(1 / 3)
    assert load_metric("mode_f1_published")(wrong, real, tools).value == pytest.approx(1 / 6)


def test_f1_of_counts_is_that_of_scikit_learn():
    rng = np.random.default_rng(0)
    for _ in range(20):
        true, guesses = rng.integers(0, 5, (2, 60))
        guesses[rng.random(60) < 0.2] = 6
        expected = f1_score(true, guesses, average="weighted", labels=range(8), zero_division=0)
        assert average_f1(confusion(true, guesses, 8)) == pytest.approx(expected, abs=1e-12)


def test_mode_f1_wants_the_points_of_pats():
    with pytest.raises(InputError, match="52"):
        mode_features(np.zeros((4, 49, 2)))
    with pytest.raises(InputError, match="centres"):
        load_metric("mode_f1")(clips(), clips())
    with pytest.raises(InputError, match="240"):
        load_metric("mode_f1")(clips(), clips(), Tools(centres=np.zeros((8, 200))))


def test_canonical_correlation_is_that_of_scikit_learn():
    rng = np.random.default_rng(0)
    common = rng.normal(size=(300, 1))
    a = rng.normal(size=(300, 4)) + common * [1, 0, 2, 0]
    b = rng.normal(size=(300, 3)) + common * [0, 1, 0]
    value, wa, wb = canonical(a, b)
    x, y = CCA(n_components=1, max_iter=5000, tol=1e-10).fit_transform(a, b)
    assert value == pytest.approx(np.corrcoef(x[:, 0], y[:, 0])[0, 1], abs=1e-6)
    assert value == pytest.approx(np.corrcoef(a @ wa, b @ wb)[0, 1], abs=1e-9)
    with pytest.raises(InputError):
        canonical(a, np.ones((300, 2)))


def test_noise_correlates_in_the_published_cca_only():
    rng = np.random.default_rng(0)
    noise = [replace(s, positions=rng.normal(size=s.positions.shape)) for s in clips(6)]
    wide = [replace(s, positions=np.concatenate([s.positions] + [rng.normal(size=s.positions.shape)] * 3, 1)) for s in clips(6)]
    noisy = [replace(s, positions=rng.normal(size=s.positions.shape)) for s in wide]
    assert load_metric("cca_genea")(noisy, wide).value > 0.3
    score = load_metric("cca")(noisy, wide)
    assert abs(score.value) < 0.15
    still = [replace(s, positions=np.ones(s.positions.shape)) for s in noise]
    assert load_metric("cca")(still, clips(6)).value == 0


@pytest.mark.parametrize("name", PERFECT)
def test_clips_of_another_rate_are_refused(name):
    measure, real = load_metric(name), clips()
    with pytest.raises(InputError, match=r"'clip 0' has 15 frames per second, the clip .* 30 \(.*resample"):
        measure([replace(s, fps=15.0) for s in real], real, TOOLS)
    score = measure([replace(s, fps=1 / 0.033333) for s in real], real, TOOLS)  # what a file says of 30
    assert score.value == pytest.approx(measure(real, real, TOOLS).value, abs=1e-9)
