"""Motion: what is refused, and the laws of cutting, joining, resampling and mirroring."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_angle, quat_identity, quat_multiply, rotvec_to_quat
from cospeech.motion.skeleton import find_skeleton
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from cospeech.motion.skeletons.humanoid import MIRROR
from tests.support.motions import gesturing


def equal(a: Motion, b: Motion, tolerance: float = 0.0) -> bool:
    faces = (a.face is None) == (b.face is None) and (a.face is None or np.abs(a.face - b.face).max(initial=0) <= tolerance)
    same_rotations = np.abs(a.rotations - b.rotations).max(initial=0) <= tolerance
    return bool(faces and same_rotations and np.abs(a.root - b.root).max(initial=0) <= tolerance and a.fps == b.fps)


def test_shape_and_values_are_checked():
    good = gesturing(4)
    for change in (
        {"rotations": good.rotations[:3]},
        {"rotations": good.rotations[:, :54]},
        {"root": good.root[:, :2]},
        {"face": good.face[:, :51]},
        {"face": good.face[:2]},
        {"fps": 0.0},
        {"fps": -1.0},
        {"fps": float("nan")},
        {"fps": float("inf")},
        {"start": float("nan")},
        {"start": "1"},
        {"start": None},
        {"start": 10**400},
        {"root": good.root * np.nan},
        {"rotations": good.rotations + np.inf},
        {"face": good.face + np.nan},
        {"skeleton": find_skeleton("mixamo")},
    ):
        with pytest.raises(InputError):
            replace(good, **change)


def test_time():
    motion = gesturing(45)
    assert motion.duration == 1.5
    assert len(motion) == 45
    assert repr(motion) == "Motion(45 frames at 30 fps, 55 joints, with a face)"
    assert repr(motion.skeleton) == "Skeleton('humanoid', 55 joints)"
    assert np.allclose(motion[15:].times, np.arange(15, 45) / 30)
    assert motion[10:20][3:].start == pytest.approx(13 / 30)
    assert motion[-5:].start == pytest.approx(40 / 30)


@pytest.mark.parametrize("fps", [np.float32(29.97), np.int64(30), Fraction(30000, 1001)])
def test_rates_and_times_of_any_kind_of_number_become_floats(tmp_path, fps):
    motion = replace(gesturing(40), fps=fps, start=np.float32(10800))
    assert (type(motion.fps), type(motion.start), motion.times.dtype) == (float, float, float)
    assert motion[7:].start == pytest.approx(10800 + 7 / float(fps), abs=1e-9)  # to the frame, hours later
    assert repr(motion).startswith("Motion(40 frames at ")
    assert len(motion.resample(60)) == np.ceil(40 * 60 / float(fps) - 1e-9)
    motion.save(tmp_path / "a.bvh")
    assert Motion.load(tmp_path / "a.bvh").fps == pytest.approx(float(fps), rel=1e-5)


def test_cut_pieces_join_to_the_whole():
    motion = gesturing(50)
    for cuts in ([25], [1, 2, 3], [10, 10, 49], list(range(1, 50))):
        pieces = [motion[a:b] for a, b in zip([0, *cuts], [*cuts, 50], strict=True)]
        whole = Motion.concatenate(pieces)
        assert equal(whole, motion)
        assert whole.start == motion.start
    with pytest.raises(InputError, match=r"slice of step 1; use resample"):
        motion[::2]
    for index, advice in ((3, "motion[3:4]"), (np.int64(7), "motion[7:8]"), (-1, "motion[-1:]"), ("x", "motion[3:4]")):
        with pytest.raises(InputError, match=rf"is no slice of a motion \(one frame is {re.escape(advice)}\)$"):
            motion[index]
    with pytest.raises(InputError, match=r"counts frames, .*cospeech.motion.edit.cut\(motion, 0.5, None\)"):
        motion[0.5:]


def test_joining_takes_sign_flips_out():
    motion = gesturing(20)
    other = replace(motion[10:], rotations=-motion[10:].rotations)
    whole = Motion.concatenate([motion[:10], other])
    assert np.array_equal(whole.rotations, motion.rotations)


def test_only_like_joins_like():
    motion = gesturing(10)
    for other in (replace(motion, fps=25), replace(motion, face=None), motion.retarget("mixamo")):
        with pytest.raises(InputError):
            Motion.concatenate([motion, other])
    with pytest.raises(InputError):
        Motion.concatenate([])


@pytest.mark.parametrize("fps", [15, 24, 25, 29.97, 60, 120, 7.3])
def test_resampling_keeps_duration_and_ends(fps):
    motion = gesturing(90)
    other = motion.resample(fps)
    assert len(other) == int(np.ceil(3.0 * fps - 1e-9))
    assert abs(other.duration - motion.duration) <= 1 / fps
    assert np.allclose(np.linalg.norm(other.rotations, axis=-1), 1)
    assert equal(replace(other[:1], fps=30), motion[:1], 1e-12)
    assert (np.sum(other.rotations[1:] * other.rotations[:-1], -1) > 0).all()
    assert other.face.min() >= 0


def test_resampling_there_and_back():
    motion = gesturing(90)
    back = motion.resample(60).resample(30)
    assert equal(back, motion, 1e-9)  # every frame of 30 is one of 60
    assert equal(motion.resample(30), motion)
    smooth = motion.resample(120)
    assert np.abs(smooth.resample(30).positions() - motion.positions()).max() < 1e-9


def test_resampling_turns_at_a_constant_rate():
    q = quat_identity(31, 55)
    q[:, 5] = rotvec_to_quat(np.linspace(0, 1, 31)[:, None] * np.array([0, 2.0, 0]))
    faster = Motion(fps=30, rotations=q, root=np.zeros((31, 3))).resample(90)
    steps = quat_angle(faster.rotations[1:88, 5], faster.rotations[:87, 5])
    assert np.allclose(steps, 2.0 / 90, rtol=1e-6)


def test_resampling_keeps_types_and_short_motion():
    small = replace(
        gesturing(3), rotations=gesturing(3).rotations.astype(np.float32), root=gesturing(3).root.astype(np.float32)
    )
    assert small.resample(60).rotations.dtype == np.float32
    assert small.resample(60).root.dtype == np.float32
    assert len(gesturing(1).resample(60)) == 2
    assert len(gesturing(1).resample(1)) == 1
    assert len(gesturing(5)[:0].resample(60)) == 0
    for fps in (0, -5, float("nan"), float("inf")):
        with pytest.raises(InputError):
            gesturing(3).resample(fps)


def test_a_mirror_shows_the_mirror_image():
    motion = gesturing(30)
    other = motion.mirror()
    swap = [motion.skeleton.index[MIRROR.get(n, n)] for n in motion.skeleton.names]
    assert np.allclose(other.positions(), motion.positions()[:, swap] * (-1, 1, 1), atol=1e-12)
    assert equal(other.mirror(), motion)
    for name, k in ARKIT_INDEX.items():
        twin = name.replace("Left", "?").replace("Right", "Left").replace("?", "Right")
        assert np.array_equal(other.face[:, ARKIT_INDEX[twin]], motion.face[:, k])
    with pytest.raises(InputError, match="mixamo"):
        motion.retarget("mixamo").mirror()


def test_operations_commute():
    motion = gesturing(60)
    assert equal(motion.mirror().resample(24), motion.resample(24).mirror(), 1e-9)
    assert equal(motion[10:20].mirror(), motion.mirror()[10:20])


def test_positions_follow_the_root():
    motion = gesturing(5)
    elsewhere = replace(motion, root=motion.root + (1, 2, 3))
    assert np.allclose(elsewhere.positions() - motion.positions(), (1, 2, 3))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_multiply(rotvec_to_quat(np.array([0, np.pi, 0])), rotations[:, 0])
    assert np.allclose(replace(motion, rotations=rotations).positions()[:, 0], motion.root)


def test_files_by_their_suffix(tmp_path):
    gesturing(4).save(tmp_path / "a.BVH")
    assert len(Motion.load(tmp_path / "a.BVH")) == 4
    with pytest.raises(InputError, match="known suffixes"):
        gesturing(4).save(tmp_path / "a.obj")
    with pytest.raises(InputError, match="written but not read"):
        Motion.load(tmp_path / "a.mp4")
