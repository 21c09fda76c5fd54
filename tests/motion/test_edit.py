"""Cut, join, loop and another face: exact lengths, no jumps, and what lies outside of a blend stays as it was."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.motion.edit import cut, join, loop, replace_face
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_angle
from cospeech.motion.skeleton import find_skeleton
from tests.support.motions import gesturing

MOTION = gesturing(90)


def steps(motion: Motion) -> np.ndarray:
    """(T − 1,) the largest turn of a joint from frame to frame, radians."""
    return quat_angle(motion.rotations[1:].astype(float), motion.rotations[:-1].astype(float)).max(1)


@pytest.mark.parametrize(
    ("start", "end", "frames"), [(None, None, (0, 90)), (1.0, None, (30, 90)), (None, 1.0, (0, 30)), (0.5, 2.0, (15, 60))]
)
def test_cut(start, end, frames):
    part = cut(MOTION, start, end)
    np.testing.assert_array_equal(part.rotations, MOTION.rotations[slice(*frames)])
    np.testing.assert_array_equal(part.face, MOTION.face[slice(*frames)])


@pytest.mark.parametrize(("start", "end"), [(2.0, 1.0), (3.0, None), (None, 0.0), (-1.0, 2.0), (1.0, 1.0)])
def test_cuts_without_a_frame(start, end):
    with pytest.raises(InputError, match=r"the motion lasts from 0 to 3 s"):
        cut(MOTION, start, end)


def test_joined_clips_go_on_without_a_jump():
    other = MOTION.mirror()
    elsewhere = replace(other, root=other.root + np.float32([0.3, 0, 0.1]))
    plain, joint_motion = Motion.concatenate([MOTION, elsewhere]), join([MOTION, elsewhere], blend=0.5)
    assert len(joint_motion) == 180
    assert steps(plain)[89] > 0.3  # there is something to blend
    assert steps(joint_motion).max() < 1.5 * max(steps(MOTION).max(), steps(other).max()) + 0.05
    assert np.linalg.norm(np.diff(joint_motion.root, axis=0), axis=1).max() < 0.05
    np.testing.assert_array_equal(joint_motion.rotations[:90], MOTION.rotations)
    np.testing.assert_allclose(np.abs((joint_motion.rotations[106:] * elsewhere.rotations[16:]).sum(-1)), 1, atol=1e-5)
    np.testing.assert_allclose(joint_motion.root[106:], elsewhere.root[16:], atol=1e-6)
    assert np.abs(np.diff(joint_motion.face, axis=0)).max() < np.abs(np.diff(plain.face, axis=0)).max() + 1e-6


def test_a_clip_that_is_cut_and_joined_again_is_as_it_was():
    motion = join([MOTION[:40], MOTION[40:]])
    assert np.abs(motion.positions() - MOTION.positions()).max() < 0.01  # an extrapolated step is no step that was recorded
    ways = np.linalg.norm(np.diff(motion.positions(), axis=0), axis=-1).max(1)
    assert ways[39] > 0.5 * min(ways[38], ways[40])  # no pose is shown twice


def test_without_a_time_long_ways_take_longer():
    far = replace(MOTION, root=MOTION.root + np.float32([0.4, 0, 0]))
    motion = join([MOTION, far])
    assert np.linalg.norm(np.diff(motion.root, axis=0), axis=1).max() * 30 < 0.3
    drift = np.linspace(0, 0.3, len(MOTION), dtype=np.float32)[:, None] * np.float32([1, 0, 0])
    around = loop(replace(MOTION, root=MOTION.root + drift))
    steps_of_hips = np.linalg.norm(np.diff(np.concatenate([around.root, around.root[:1]]), axis=0), axis=1)
    assert steps_of_hips.max() * 30 < 0.6


def test_clips_of_other_rates_take_the_first_ones_and_clips_without_a_face_are_neutral():
    motion = join([MOTION, replace(gesturing(50, 25.0), face=None)])
    assert (motion.fps, len(motion)) == (30, 150)
    np.testing.assert_array_equal(motion.face[:90], MOTION.face)
    assert not motion.face[-10:].any()
    assert join([replace(MOTION, face=None), replace(MOTION, face=None)]).face is None
    assert len(join([MOTION, MOTION[:0], MOTION])) == 2 * len(MOTION)
    assert len(join([MOTION[:0], MOTION])) == len(MOTION)
    with pytest.raises(InputError, match="different skeletons"):
        join([MOTION, MOTION.retarget(find_skeleton("mixamo"))])
    with pytest.raises(InputError, match="no motion"):
        join([])
    with pytest.raises(InputError, match="no motion"):
        join([MOTION[:0]])
    with pytest.raises(InputError, match="no frames"):
        replace_face(MOTION, MOTION[:0])


@pytest.mark.parametrize("blend", [-1, 11, float("nan")])
def test_a_blend_lasts_from_none_to_ten_seconds(blend):
    for act in (partial(join, [MOTION, MOTION]), partial(loop, MOTION)):
        with pytest.raises(InputError, match=r"blend .*0 … 10 seconds"):
            act(blend=blend)


def test_a_loop_ends_where_it_begins():
    short = MOTION[:70]
    cycle = loop(short, blend=0.5)
    before, after = Motion.concatenate([short, short]), Motion.concatenate([cycle, cycle])
    assert steps(before)[69] > 0.1
    assert steps(after).max() < 1.5 * steps(short).max() + 0.05
    np.testing.assert_array_equal(cycle.rotations[:50], short.rotations[:50])
    np.testing.assert_array_equal(cycle.root[:50], short.root[:50])
    with pytest.raises(InputError, match="1 frame cannot be looped"):
        loop(MOTION[:1])


def test_eyes_do_not_half_shut_before_a_blink_that_ends_a_loop():
    face = np.zeros((90, 52), np.float32)
    face[-4:, 0] = (0.97, 0.96, 0.54, 0.09)  # a step further the lid would be open, not wider than open
    cycle = loop(replace(MOTION, face=face))
    np.testing.assert_allclose(cycle.face[:, 0], face[:, 0], atol=1e-6)


def test_the_face_of_another():
    other = replace(gesturing(40, 60.0), face=np.linspace(0, 1, 40)[:, None].repeat(52, 1).astype(np.float32))
    motion = replace_face(MOTION, other)
    np.testing.assert_array_equal(motion.rotations, MOTION.rotations)
    assert motion.face.shape == (90, 52)
    assert motion.face[0, 0] == 0
    assert (np.diff(motion.face[19:32, 0]) < 0).all()  # it is over, and comes to rest
    assert motion.face[20, 0] > 0.85
    assert motion.face[31:].max() == 0
    with pytest.raises(InputError, match="no face"):
        replace_face(MOTION, replace(MOTION, face=None))
