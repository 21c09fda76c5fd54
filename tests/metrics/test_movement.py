"""Movement statistics: known motions give known numbers, laws hold, and a real speaker lies inside the ranges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.metrics import REFERENCE, ReferenceRow, Track, movement_statistics
from cospeech.metrics.movement import mean_rows, window_statistics
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, euler_to_quat, quat_identity, quat_rotate
from cospeech.motion.skeleton import humanoid

FPS = 30.0
TIMES = np.arange(1800) / FPS  # two windows
ONE = np.ones_like(TIMES)


def track(*, left=None, right=None, lean=None) -> Track:
    """A body facing +Z whose wrists move by ``left`` and ``right (T, 3)`` from in front of the belly."""
    shoulders = np.array([[0.18, 0.5, 0.0], [-0.18, 0.5, 0.0]])
    wrists = np.array([[0.2, 0.2, 0.3], [-0.2, 0.2, 0.3]])
    hips = np.tile([0.0, 0.9, 0.0], (len(TIMES), 1))
    moves = np.stack([np.zeros((len(TIMES), 3)) if m is None else m for m in (left, right)], 1)
    wrists = wrists + moves
    elbows = (wrists + shoulders) / 2 + [0.0, -0.05, -0.1]
    return Track(
        FPS, hips, np.broadcast_to(shoulders, wrists.shape) + hips[:, None], elbows + hips[:, None], wrists + hips[:, None]
    )


def sine(axis: int, size: float, hertz: float, phase: float = 0.0) -> np.ndarray:
    move = np.zeros((len(TIMES), 3))
    move[:, axis] = size * np.sin(2 * np.pi * hertz * TIMES + phase)
    return move


def talker(seed: int = 0, seconds: float = 60.0) -> Motion:
    """Smooth random motion of all joints of our humanoid, feet standing."""
    rng = np.random.default_rng(seed)
    frames, skeleton = round(seconds * FPS), humanoid()
    k = np.exp(-0.5 * (np.arange(-15, 16) / 5.0) ** 2)
    noise = rng.normal(size=(frames + 30, len(skeleton), 3))
    smooth = np.apply_along_axis(lambda x: np.convolve(x, k / np.linalg.norm(k), "valid"), 0, noise)
    smooth[:, list(skeleton.lower_body)] = 0
    return Motion(FPS, euler_to_quat(0.15 * smooth), np.tile(skeleton.offsets[0], (frames, 1)))


def test_every_row_of_the_reference_is_measured():
    rows = movement_statistics(talker())
    assert list(rows) == list(REFERENCE)
    assert all(np.isfinite(list(rows.values())))


def test_reference_is_in_order():
    assert all(row.low <= row.mean <= row.high for row in REFERENCE.values())
    assert len(REFERENCE) == 86
    assert not ReferenceRow(1, 0, 2).holds(np.nan)


def test_sine_speeds_are_those_of_calculus():
    size, hertz = 0.15, 0.8
    rows = movement_statistics(track(left=sine(1, size, hertz), right=sine(1, size, hertz)))
    top = 2 * np.pi * hertz * size
    # |cos| of a uniform phase: its median is sin(π/4)
    assert rows["wrist speed 50 %, m/s"] == pytest.approx(top * np.sin(np.pi / 4), rel=0.02)
    assert rows["wrist speed 99 %, m/s"] == pytest.approx(top, rel=0.02)
    assert rows["acceleration 99 %, m/s²"] == pytest.approx(top * 2 * np.pi * hertz, rel=0.03)
    assert rows["jerk 99 %, m/s³"] == pytest.approx(top * (2 * np.pi * hertz) ** 2, rel=0.04)
    assert rows["strokes per min, left"] == pytest.approx(2 * hertz * 60, abs=2)
    assert rows["stroke duration 50 %, s"] == pytest.approx(0.5 / hertz, abs=1 / FPS)
    assert rows["median stroke peak, m/s"] == pytest.approx(top, rel=0.03)
    assert rows["left–right speed correlation"] == pytest.approx(1)
    assert rows["right share of speed"] == pytest.approx(0.5)
    assert rows["SD of height / arm"] > 5 * rows["SD of lateral / arm"]
    assert rows["velocity power in the strongest 0.3 Hz"] > 0.95


def test_jerk_of_a_stroke_is_that_of_half_a_sine():
    """Half a period of v = V sin(ωt): T³/V² ∫ (ω² V sin)² dt = π⁴/2 · (T/π)·ω·… = π⁴ / 2."""
    rows = movement_statistics(track(left=sine(1, 0.25, 0.6), right=sine(1, 0.25, 0.6)))
    assert rows["log dimensionless jerk per stroke"] == pytest.approx(-np.log(np.pi**4 / 2), abs=0.06)


def test_a_still_body_rests_and_nothing_is_infinite():
    rows = movement_statistics(track())
    assert rows["both at rest"] == 1
    assert rows["strokes per min and hand"] == 0
    assert "stroke duration 50 %, s" not in rows
    assert all(np.isfinite(list(rows.values())))


def test_place_of_the_hands():
    rows = movement_statistics(track(left=np.outer(ONE, [-0.25, 0.0, 0.0]), right=np.outer(ONE, [0, 0.4, 0])))
    assert rows["share beyond the midline"] == 0.5  # the left hand
    assert rows["share of time: above shoulder"] == 0.5  # the right one
    assert rows["share of time: hip to chest"] == 0.5
    assert rows["share of time: wrist below hip"] == rows["share of time: chest to shoulder"] == 0


def test_heading_and_place_in_the_world_do_not_matter():
    one = track(left=sine(1, 0.15, 0.8), right=sine(2, 0.1, 1.1))
    turn = axis_angle_to_quat([0.0, 1.0, 0.0], 2.0)
    walk = np.stack([0.3 * TIMES, 0 * TIMES, -0.1 * TIMES], -1)
    parts = {n: quat_rotate(turn, getattr(one, n)) for n in ("hips", "shoulders", "elbows", "wrists")}
    two = Track(FPS, **{n: p + (walk if n == "hips" else walk[:, None]) for n, p in parts.items()})
    a, b = movement_statistics(one), movement_statistics(two)
    same = [name for name in a if not name.startswith(("hip ", "sway "))]  # this torso is rigid: no sway
    assert [a[n] for n in same] == pytest.approx([b[n] for n in same], rel=1e-6, abs=1e-9)
    assert b["hip path (1 Hz), m/min"] == pytest.approx(60 * np.hypot(0.3, 0.1), rel=0.02)


@pytest.mark.slow
def test_mirroring_exchanges_the_hands():
    a, b = (movement_statistics(m) for m in (talker(3), talker(3).mirror()))
    assert b["left 90 %"] == pytest.approx(a["right 90 %"], rel=1e-6)
    assert b["elbow flexion right 50 %, deg"] == pytest.approx(a["elbow flexion left 50 %, deg"], rel=1e-6)
    assert b["right share of speed"] == pytest.approx(1 - a["right share of speed"], rel=1e-6)
    assert b["head yaw SD, deg"] == pytest.approx(a["head yaw SD, deg"], rel=1e-6)
    assert b["torso roll SD, deg"] == pytest.approx(a["torso roll SD, deg"], rel=1e-6)


def test_jitter_shows():
    rng = np.random.default_rng(0)
    clean = track(left=sine(1, 0.15, 0.8), right=sine(1, 0.15, 0.8))
    shaken = replace(clean, wrists=clean.wrists + rng.normal(scale=0.005, size=clean.wrists.shape))
    rows = movement_statistics(shaken)
    for name in ("jerk 50 %, m/s³", "velocity power above 4 Hz", "position power above 4 Hz"):
        assert rows[name] > REFERENCE[name].high


def test_head_and_fingers():
    skeleton = humanoid()
    rotations = quat_identity(len(TIMES), len(skeleton))
    angle = np.radians(10) * np.sin(2 * np.pi * 0.5 * TIMES)
    rotations[:, skeleton.index["head"]] = axis_angle_to_quat([1.0, 0.0, 0.0], angle)
    rotations[:, skeleton.index["leftIndexProximal"]] = axis_angle_to_quat([0.0, 0.0, 1.0], -3 * angle)
    rows = movement_statistics(Motion(FPS, rotations, np.tile(skeleton.offsets[0], (len(TIMES), 1))))
    assert rows["nods per min"] == pytest.approx(30, abs=1)
    assert rows["head pitch SD, deg"] == pytest.approx(10 / np.sqrt(2), rel=0.01)
    assert rows["head yaw SD, deg"] == pytest.approx(0, abs=1e-6)
    assert rows["head speed 99 %, deg/s"] == pytest.approx(10 * np.pi, rel=0.01)
    assert rows["finger joint 5–95 %, largest, deg"] == pytest.approx(60 * np.sin(np.pi * 0.45), rel=0.02)
    assert rows["finger joint 5–95 %, median joint, deg"] == pytest.approx(0, abs=1e-6)


def test_steps_are_counted_and_standing_feet_are_not():
    clean = track()
    feet = np.tile(np.array([[0.09, 0.08, 0.0], [-0.09, 0.08, 0.0]]), (len(TIMES), 1, 1))
    feet[900:910, 0, 0] += np.linspace(0, 0.12, 10)  # one step of 12 cm in a third of a second
    feet[910:, 0, 0] += 0.12
    rows = movement_statistics(replace(clean, feet=feet))
    assert rows["steps per min (peaks > 0.3 m/s)"] == pytest.approx(1)
    assert rows["foot speed 50 %, m/s"] == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
def test_another_rate_gives_the_same_numbers():
    motion = talker(5)
    a, b = movement_statistics(motion), movement_statistics(motion.resample(60))
    assert [b[n] for n in a] == pytest.approx([a[n] for n in a], rel=0.05, abs=0.05)


@pytest.mark.slow
def test_windows():
    motion = talker(1, 75)
    windows = window_statistics(motion)
    assert len(windows) == 2
    assert movement_statistics(motion) == mean_rows(windows)
    assert len(window_statistics(motion[:200])) == 1


@pytest.mark.parametrize(
    "spoil",
    [
        lambda motion: motion[:20],
        lambda motion: replace(track(), fps=25.0),
        lambda motion: replace(motion, skeleton=replace(motion.skeleton, kind="mixamo")),
    ],
    ids=["short", "rate", "skeleton"],
)
def test_bad_input(spoil):
    wrong = spoil(talker(0, 4))
    with pytest.raises(InputError):
        movement_statistics(wrong)


def test_a_real_speaker_is_inside(shared_folder):
    """The one real take at hand is one of those that the ranges come from."""
    take = np.load(shared_folder / "data/reference_motion/003_Neutral_2.npy", allow_pickle=False)[::2, :, :3]
    real = Track(FPS, take[:, 0], take[:, [6, 3]], take[:, [7, 4]], take[:, [8, 5]])
    windows = window_statistics(real)
    assert len(windows) == 4
    rows = mean_rows(windows)
    assert len(rows) == 69  # all but head, fingers and feet
    assert [name for name, value in rows.items() if not REFERENCE[name].holds(value)] == []
    cells = [(REFERENCE[name], value) for window in windows for name, value in window.items()]
    assert sum(row.holds(value) for row, value in cells) >= len(cells) - 4
    assert all(row.low - 0.015 * abs(row.low) <= value <= row.high + 0.015 * abs(row.high) for row, value in cells)
