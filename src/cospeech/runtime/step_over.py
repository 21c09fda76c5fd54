"""Feet that go from one stance to another: one after the other they are lifted, so that none slides."""

from __future__ import annotations

import numpy as np

from ..motion.curves import smoothstep
from ..motion.kinematics.legs import place_feet, read_feet
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_slerp

__all__ = ["StepOver", "decay", "run_out"]

_SWINGS = (
    0.2,
    0.75,
)  # s at which the first and the second foot leave the floor [ours, as the steps of `cospeech.rules.stance`]
_SWING = 0.45  # s that a foot is in the air [ours, as there]
_LIFT, _SHUFFLE, _NEAR = 0.035, 0.008, 0.015  # m of lift, and of a foot that goes less than the last [ours]
_LAND = 0.35  # s in which a foot that was in the air comes down where it was [ours]
_OVER = (1.4, 2.0)  # s in which the legs become those of the new stance, to the bit [ours: both feet stand there by then]
RUN_OUT = 0.35  # s in which the speed that a joint has dies away [ours: about a stroke]


class StepOver:
    """Steps from the feet that were shown to those of the frames that come next.

    Args:
        shown: the last two frames that were shown, or the last one.
    """

    def __init__(self, shown: Motion) -> None:
        feet = read_feet(shown.rotations.astype(float), shown.root.astype(float))
        self._feet = feet[-1]
        self._moving = (feet[-1] - feet[-2]) * shown.fps if len(feet) > 1 else np.zeros_like(feet[-1])
        hips = shown.root[-1, [0, 2]]
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
        old[..., 3:] = np.maximum(old[..., 3:], [0.0, -0.2]) * decay(times / _LAND)[:, None, None]
        u = np.clip((times[:, None] - self._begin) / _SWING, 0, 1)
        share = (1 - decay(u))[..., None]
        feet = old + share * (new - old)
        feet[..., 3] += self._height * np.sin(np.pi * u) ** 2
        joints, legs, place = place_feet(rotations[:, 0], root, feet)
        left = smoothstep(np.clip((times - _OVER[0]) / (_OVER[1] - _OVER[0]), 0, 1))[:, None]
        rotations[:, joints] = quat_slerp(legs, motion.rotations[:, joints].astype(float), left)
        return place + left * (root - place)


def decay(u: Array) -> Array:
    """From 1 at 0 to 0 at 1, at rest at both ends: a minimum-jerk reach (Flash & Hogan 1985)."""
    u = np.clip(u, 0, 1)
    return 1 - u**3 * (10 - 15 * u + 6 * u * u)  # type: ignore[no-any-return]


def run_out(times: Array) -> Array:
    """Seconds of travel at the first speed: slope 1 at 0, back at 0 and at rest after `RUN_OUT` (Bollo 2018)."""
    u = np.clip(times / RUN_OUT, 0, 1)
    return RUN_OUT * u * (1 - u * u * (6 - 8 * u + 3 * u * u))  # type: ignore[no-any-return]
