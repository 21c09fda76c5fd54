"""Clavicles that rise with the arm, and fingers that are never still, for arms that another system moves. See `stance_layer`.

Every frame depends on its own row, on its wrists, on its time and on the seed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..motion.curves import smoothstep
from ..motion.kinematics.arms import finger_joints
from ..motion.noise import smooth_noise
from ..motion.rotations import Array, quat_conjugate, quat_multiply
from ..motion.skeleton import humanoid

__all__ = ["move_fingers", "raise_clavicles"]

_LIFT, _REACH, _ROLL, _BREATH_LIFT = np.radians([5.0, 3.5, 14.0, 2.2])
"""Radians by which a clavicle rises with a raised arm, comes forward with one that reaches, rolls back about itself with a
raised arm, and rises with a breath. Ours: less than in the rules (`cospeech.rules.realise`), because the other system's
clavicles move a little too."""
_HANGS, _ABOVE, _AT_HAND, _AWAY = -1.0, 1.3, 0.05, 0.75  # arm lengths: where these begin, and over which distance they grow
_USUAL_UP, _USUAL_FORWARD = -0.6, 0.31  # arm lengths at which a clavicle stays as it is ([ours]: medians of people)
_SHRUGS = np.radians([3.0, 2.3])  # rise and reach of shoulders that are never still ([ours])
_CURL, _APART = np.radians([14.0, 7.5])  # slow bending of all fingers of a hand, and of each for itself ([ours])
_OPENS, _FAST = np.radians(20.0), 1.6  # by how much fingers open in a stroke, at most; arm lengths per second ([ours])
_JOINT_SHARES = np.array([0.8, 1.1, 0.73])  # of it in knuckle, middle and last joint ([ours]; the last follows the middle one)
_LEAST, _MOST = np.radians([[-15.0], [2.0], [0.0]]), np.radians([[88.0], [100.0], [68.0]])
"""(3, 1) bend of those joints at which nothing is added any more; inside the active ranges of adults (Hume et al. 1990)."""
_MOST_TURN, _FREELY = (
    np.radians(38.0),
    np.radians(18.0),
)  # of a clavicle; from there, and so far before, less is added ([ours])


def raise_clavicles(q: Array, wrists: Array, breath: Array, times: Array, seed: int, amount: float) -> None:
    """Turn both clavicles of ``q (n, J, 4)`` with the arms; upper arms keep their direction in the chest's frame.

    Args:
        q: local rotations of our humanoid; written to.
        wrists: (n, 2, 3) left and right wrist from the own shoulder in the chest's frame, arm lengths.
        breath: (n,) 0 … 1.
        times: (n,) seconds.
        seed: of the shrugs.
        amount: factor on all of it.
    """
    joint = humanoid().index
    shrugs = smooth_noise(seed + 24, 4, times, 0.42, octaves=3, gain=0.55)
    for side, name in enumerate(("left", "right")):
        rise = _rise(wrists[:, side, 1]) - _rise(np.array(_USUAL_UP))
        lift = _LIFT * rise + _BREATH_LIFT * breath
        ahead = _REACH * (_reach(wrists[:, side, 2]) - _reach(np.array(_USUAL_FORWARD)))
        lift, ahead = lift + _SHRUGS[0] * shrugs[:, 2 * side], ahead + _SHRUGS[1] * shrugs[:, 2 * side + 1]
        shoulder, upper = joint[name + "Shoulder"], joint[name + "UpperArm"]
        before = q[:, shoulder].copy()
        angle = 2 * np.arccos(np.minimum(np.abs(before[:, 3]), 1.0))
        share = (1.0 - 2.0 * side) * amount * smoothstep((_MOST_TURN - angle) / _FREELY)
        turn = quat_multiply(_about(2, share * lift), _about(1, -share * ahead))
        roll = _about(0, -np.abs(share) * _ROLL * rise)
        q[:, shoulder] = quat_multiply(quat_multiply(turn, before), roll)
        back = quat_multiply(quat_conjugate(q[:, shoulder]), before)
        q[:, upper] = quat_multiply(back, q[:, upper])


def move_fingers(q: Array, speeds: Array, times: Array, seed: int, amount: float) -> None:
    """Bend and open the fingers of ``q (n, J, 4)``; thumbs stay.

    Args:
        q: local rotations of our humanoid; written to.
        speeds: (n, 2) of left and right wrist, arm lengths per second; fingers open in a stroke and close after it.
        times: (n,) seconds.
        seed: of the slow bending.
        amount: factor on all of it.
    """
    noise = smooth_noise(seed + 25, 10, times, 0.5, octaves=2, gain=0.5)
    for side, joints in enumerate(_fingers()):
        opening = _OPENS * np.tanh(np.square(speeds[:, side] / _FAST))
        bend = (_CURL * noise[:, 5 * side] - opening)[:, None] + _APART * noise[:, 5 * side + 1 : 5 * side + 5]
        mirror = 1.0 - 2.0 * side
        more = amount * bend[:, None] * _JOINT_SHARES[:, None]  # (n, 3, 4)
        local = q[:, joints]
        sign = np.where(local[..., 3] < 0, -1.0, 1.0)
        angles = -mirror * 2 * np.arctan2(sign * local[..., 2], sign * local[..., 3])
        room = np.maximum(np.where(more > 0, _MOST - angles, angles - _LEAST), 1e-6)
        more = room * np.tanh(more / room)
        q[:, joints] = quat_multiply(local, _about(2, -mirror * more))


def _rise(up: Array) -> Array:
    return smoothstep((up - _HANGS) / _ABOVE)


def _reach(forward: Array) -> Array:
    return smoothstep((forward - _AT_HAND) / _AWAY)


def _about(axis: int, angle: Array) -> Array:
    q = np.zeros((*angle.shape, 4))
    q[..., axis], q[..., 3] = np.sin(angle / 2), np.cos(angle / 2)
    return q


@lru_cache(1)
def _fingers() -> tuple[Array, Array]:
    """(3, 4) joints of left and right hand: knuckles, middle and last joints of index … little finger."""
    left, right = (np.array(side)[3:].reshape(4, 3).T for side in finger_joints())
    return left, right
