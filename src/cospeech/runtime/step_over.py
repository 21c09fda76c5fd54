"""Feet that go from one stance to another: one after the other they are lifted, so that none slides."""

from __future__ import annotations

import numpy as np

from ..motion.curves import smoothstep
from ..motion.kinematics.legs import place_feet, read_feet
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_slerp
from ..rules.minimum_jerk import minimum_jerk

__all__ = ["StepOver", "decay", "run_out"]

_SWINGS = (0.2, 0.8)
"""Seconds at which the first and the second foot leave the floor [ours: one after the other]."""
_SWING = 0.55  # s that a foot is in the air [ours: a little longer than in `cospeech.rules.stance`, or the knee jerks]
_OFF = 0.15  # share of the swing in which the foot leaves the floor, and in which it comes down [ours]
_LIFT, _SHUFFLE, _NEAR = 0.035, 0.008, 0.015  # m of lift, and of a foot that goes less than the last [ours]
_SINK = 0.03  # m that the hips sink while the feet go [ours: soft knees, which bend gently when a foot leaves the floor]
_STILL = 1e-3  # m, m/s: less is rounding [ours]
_LAND = 0.35  # s in which a foot that was in the air comes down where it was [ours]
_ROLL = 0.2  # s at least in which a foot that rolls comes to be flat [ours]
_OVER = (1.4, 2.0)  # s in which the legs become those of the new stance, to the bit [ours: both feet stand there by then]
_RUN_OUT = 0.35  # s in which the speed of hips and feet dies away [ours: about a stroke]


class StepOver:
    """Steps from the feet that were shown to those of the frames that come next.

    Args:
        last: the last two frames that were shown, or the last one.
    """

    def __init__(self, last: Motion) -> None:
        feet = read_feet(last.rotations.astype(float), last.root.astype(float))
        self._feet = feet[-1]
        self._moving = (feet[-1] - feet[-2]) * last.fps if len(feet) > 1 else np.zeros_like(feet[-1])
        hips = last.root[-1, [0, 2]]
        far = np.linalg.norm(self._feet[:, :2] - hips, axis=-1)  # the foot that carries less goes first
        self._begin = np.array(_SWINGS if far[0] >= far[1] else _SWINGS[::-1])
        self._height: Array | None = None

    def apply(self, times: Array, motion: Motion, rotations: Array, root: Array) -> Array:
        """Write legs into ``rotations`` (n, J, 4), whose hips and place ``root`` (n, 3) are on their way.

        Args:
            times: (n,) seconds since the last frame that was shown.
            motion: the same frames of the new source.

        Returns:
            (n, 3) the place of the hips, lowered where a leg would not reach.
        """
        new = read_feet(motion.rotations.astype(float), motion.root.astype(float))
        if self._height is None:
            way = np.linalg.norm(new[0, :, :2] - self._feet[:, :2], axis=-1)
            self._height = np.where(way < _NEAR, _SHUFFLE, _LIFT)
        old = self._feet + run_out(times)[:, None, None] * self._moving
        old[..., 3:] = self._land(times)
        u = np.clip((times[:, None] - self._begin) / _SWING, 0, 1)
        share = (1 - decay((u - _OFF) / (1 - 2 * _OFF)))[..., None]  # it travels while it is off the floor
        feet = old + share * (new - old)
        feet[..., 3] += self._height * _hump(u)  # gently off the floor: a straight knee bends at once
        sink = _SINK * _hump(np.clip(times / _OVER[0], 0, 1))
        joints, legs, place = place_feet(rotations[:, 0], root, feet, 1 - decay(times / _LAND), sink)
        blend = smoothstep(np.clip((times - _OVER[0]) / (_OVER[1] - _OVER[0]), 0, 1))[:, None]
        rotations[:, joints] = quat_slerp(legs, motion.rotations[:, joints].astype(float), blend)
        return place + blend * (root - place)

    def _land(self, times: Array) -> Array:
        """(n, 2, 2) lift and tip of feet that were in the air: they come down where they were, and never below the floor."""
        lift, speed = self._feet[:, 3:], self._moving[:, 3:]
        falls = (speed * np.sign(lift) < -_STILL) & (abs(lift) > _STILL)
        soonest = 3 * abs(lift) / np.where(falls, abs(speed), 1.0)  # a longer cubic would pass 0
        seconds = np.where(falls, np.clip(soonest, (1e-3, _ROLL), _LAND), _LAND)
        u = np.clip(times[:, None, None] / seconds, 0, 1)
        return lift * (1 - u * u * (3 - 2 * u)) + speed * seconds * u * (1 - u) ** 2  # type: ignore[no-any-return]


def _hump(u: Array) -> Array:
    """From 0 at 0 over 1 at 0.5 to 0 at 1, at rest at both ends."""
    return 64 * (u * (1 - u)) ** 3


def decay(u: Array) -> Array:
    """From 1 at 0 to 0 at 1, at rest at both ends: a minimum-jerk reach (Flash & Hogan 1985)."""
    return 1 - minimum_jerk(u)


def run_out(times: Array) -> Array:
    """Seconds of travel at the first speed: slope 1 at 0, back at 0 and at rest after `_RUN_OUT` (Bollo 2018)."""
    u = np.clip(times / _RUN_OUT, 0, 1)
    return _RUN_OUT * u * (1 - u * u * (6 - 8 * u + 3 * u * u))  # type: ignore[no-any-return]
