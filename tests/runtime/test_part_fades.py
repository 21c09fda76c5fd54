"""Parts that are switched off and on: no jump where frames are taken back, and no flip of a sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import cospeech
from cospeech.motion.motion import Motion
from cospeech.motion.parts import PARTS
from cospeech.motion.rotations import quat_angle
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.part_fades import PartFades
from tests.support.motions import gesturing


def fade(motion: Motion, switch: int, pieces: int = 7) -> Motion:
    """Frames of which only the face is on from ``switch`` on."""
    fades = PartFades(PARTS, motion.fps)
    stretch = [fades.apply(motion[:switch])]
    fades.set_parts("face")
    stretch += [fades.apply(motion[k : k + pieces]) for k in range(switch, len(motion), pieces)]
    return Motion.concatenate(stretch)


def test_a_part_that_is_off_comes_to_rest_within_half_a_second():
    motion = gesturing(60, 30)
    off = fade(motion, 20)
    np.testing.assert_array_equal(off.rotations[:20], motion.rotations[:20])
    np.testing.assert_allclose(np.abs(off.rotations[35:, humanoid().left_hand, 3]), 1, atol=1e-6)
    np.testing.assert_array_equal(off.face, motion.face)
    np.testing.assert_allclose(fade(motion, 20, 60).rotations, off.rotations, atol=1e-6)  # in pieces of any size


@pytest.mark.parametrize(("first", "switch"), [(32, 30), (20, 20)])
def test_frames_that_are_taken_back_leave_no_jump(first, switch):
    """Parts go on from what was shown, and the switch holds where it was made in frames that are void."""
    motion, fades = gesturing(100, 30), PartFades(PARTS, 30)
    stretch = [fades.apply(motion[:30])]
    fades.set_parts("face")
    stretch.append(fades.apply(motion[30:80]))
    fades.go_back(first)
    again = fades.apply(motion[first:])
    both = Motion.concatenate([Motion.concatenate(stretch)[:first], again])
    np.testing.assert_allclose(both.rotations, fade(motion, switch, 100).rotations, atol=1e-6)


def test_signs_of_rotations_do_not_flip():
    motion, fades = gesturing(90, 30), PartFades(PARTS, 30)
    motion = replace(motion, rotations=-motion.rotations)
    stretch = [fades.apply(motion[:20])]
    for parts, frames in (("face", motion[20:50]), (PARTS, motion[50:])):
        fades.set_parts(parts)
        stretch.append(fades.apply(frames))
    q = np.concatenate([piece.rotations for piece in stretch])
    assert np.einsum("tji,tji->tj", q[1:], q[:-1]).min() > 0


def test_an_interruption_takes_a_fade_back():
    live = cospeech.open_live_session("rules", fps=30)
    stretch = list(live.idle(1))
    live.set_parts("face")
    stretch += live.idle(1)
    live.interrupt(at=31 / 30)
    stretch = [Motion.concatenate(stretch)[:31], *live.idle(0.2)]
    steps = np.degrees(quat_angle(*(Motion.concatenate(stretch).rotations.astype(float)[k] for k in (slice(1, 36), slice(35)))))
    assert steps[30].max() < 2 * steps.max(1)[[29, 31, 32]].max()
