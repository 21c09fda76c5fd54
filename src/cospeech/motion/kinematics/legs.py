"""Hips over planted feet: two-bone inverse kinematics for the legs, standing or seated."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..curves import clip, soft_clip, soft_positive
from ..rotations import Array, cross, euler_to_quat, matrix_to_quat, quat_conjugate, quat_multiply, quat_rotate
from ..skeleton import humanoid
from .body import Body
from .two_bones import place_middle_joint

__all__ = ["BALL", "SEAT", "STANCE", "TOE_OUT", "balance", "carry", "place_feet", "plant", "read_feet", "stand", "weight_shift"]

SEAT = 0.515  # metres from the floor to the hips' joint of a seated body (ours: a chair of 0.43 m)
STANCE = 0.105  # metres from the middle to each ankle (ours: a little wider than the hips)
TOE_OUT = 9.0  # degrees
_ROLLS = np.radians(4.0)  # range of tip, on both sides of a flat foot, within which toes begin to bend (ours)
_LEANS = 0.5  # share of a seated torso's pitch that the pelvis takes (ours: CMU's seated takes have .5 to 1)
_AHEAD = 0.42  # metres that the ankles of a seated body are in front of its hips (ours: shins upright)
_SITTING, _STANDING = 0.62, 0.78  # hips' height in metres up to which a body sits, from which it stands (ours)
_STRAIGHT = 0.9994  # most of the leg's length that is used: knees never lock (ours; ≈ 4° of flexion)
_TILT = 54.0  # degrees of pelvic roll per metre of shift: the free side sinks ([ours]; 47 in motion, 36 of a recorded one)
BALL, _HEEL = 0.125, -0.03  # metres in front of the ankle about which a foot rolls (ours: the mannequin's shoe)
_SPREAD = (BALL - _HEEL) / 2  # metres
_TURNS_OVER = 3.0
"""Radians for each metre of lift: how gently a foot in the air goes from ball to heel (ours, or the knee jerks by 4° a frame).
Its sole comes down by a quarter of the lift at most."""
_SOFT = 0.004  # metres of smoothing of the minimum of both legs' limits
_MOST_COSINE = 0.99999  # ours: cosine of the least angle of the thigh with the line to the ankle; directions stay defined
_BEND_WIDTH = 0.0008  # metres over which a knee begins to bend (ours)
_MOST_SHIFT = 0.64
"""Share of the way from the middle to a foot that hips never exceed. [ours: nine tenths of the time, CMU's standing people are
within .07 to .7 of it (13_01 to 13_26); with hips further out a body falls, or its legs lean side by side]"""
_SIDES = np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])


@lru_cache(1)
def _leg() -> tuple[Array, Array, Array, Array]:
    """Offsets of hip joint, knee, ankle (left leg), and the ankle's place in the T-pose."""
    s = humanoid()
    hip, knee, ankle = (s.offsets[s.index["left" + n]] for n in ("UpperLeg", "LowerLeg", "Foot"))
    return hip, knee, ankle, s.tpose[s.index["leftFoot"]]


def _lengths() -> tuple[float, float]:
    _, knee, ankle, _ = _leg()
    return float(np.linalg.norm(knee)), float(np.linalg.norm(ankle))


def stand(b: Array, seated: bool, rotations: Array | None) -> tuple[Array, Array]:
    """Compute hips and legs, and write the legs into ``rotations`` (N, J, 4), if it is not None.

    Args:
        b: (N, channels) of the body's track, with noise.

    Returns:
        hips' rotation (N, 4) and position (N, 3).
    """
    feet = np.stack([b[:, Body.LEFT_FOOT], b[:, Body.RIGHT_FOOT]], 1)
    lift, tip = b[:, Body.LEFT_LIFT : Body.RIGHT_LIFT + 1], np.radians(b[:, Body.LEFT_TIP : Body.RIGHT_TIP + 1])
    roll = b[:, Body.HIPS_ROLL] + (0.0 if seated else _TILT * weight_shift(b))
    pitch = b[:, Body.HIPS_PITCH] + b[:, Body.PITCH] * (_LEANS if seated else 0.12)
    if seated:  # no forward tilt under a raised thigh: hips bend by 120° at most
        lift_share = clip(lift.max(1) / 0.15, 0.0, 1.0)
        room = 12.0 - 17.0 * lift_share * lift_share * (3 - 2 * lift_share)
        pitch = room - soft_positive(room - pitch, 3.0)
    yaw = b[:, Body.HIPS_YAW] + (0.0 if seated else feet[..., 2].mean(1))
    hips = euler_to_quat(np.radians(np.stack([yaw, pitch, roll], -1)), "YXZ")
    ankles = _ankles(feet, lift, tip)
    if seated:
        ankles = ankles + np.array([0.0, 0.0, _AHEAD])
        root = np.stack([b[:, Body.HIPS_X], SEAT - _sunk(b), b[:, Body.HIPS_Z]], -1)
    else:
        root = np.stack([b[:, Body.HIPS_X], np.zeros(len(b)), b[:, Body.HIPS_Z]], -1)
        root[:, 1] = _height(root, hips, ankles) - _sunk(b)
    if rotations is not None:
        rotations[:, _leg_joints()] = _legs(hips, root, ankles, feet[..., 2], tip)
        rotations[:, _toes()] = _about_x(-_bend_toes(tip))
    return hips, root


def balance(place: Array, b: Array) -> Array:
    """Limit the hips of a standing body to a place between the feet; beside them, a person would fall.

    Args:
        place: (N, 2) wanted place of the hips, x and z in metres.
        b: (N, channels) of the body's track.

    Returns:
        (N, 2); as ``place``, but along the line between the feet.
    """
    left, right = b[:, Body.LEFT_FOOT][:, :2], b[:, Body.RIGHT_FOOT][:, :2]
    half = (left - right) / 2
    share = np.einsum("ni,ni->n", place - (left + right) / 2, half) / np.maximum(np.einsum("ni,ni->n", half, half), 1e-4)
    return place + (soft_clip(share, -_MOST_SHIFT, _MOST_SHIFT) - share)[:, None] * half


def _sunk(b: Array) -> Array:
    """(N,) metres by which bent knees lower the hips: never negative, or feet would leave the floor."""
    return soft_positive(b[:, Body.SINK], _BEND_WIDTH)


def weight_shift(b: Array) -> Array:
    """(N,) metres by which the hips are to the left of the middle between the feet."""
    return b[:, Body.HIPS_X] - 0.5 * (b[:, Body.LEFT_FOOT.start] + b[:, Body.RIGHT_FOOT.start])


def _ankles(feet: Array, lift: Array, tip: Array) -> Array:
    """(N, 2, 3) ankles of feet that are lifted, and rolled about ball or heel, which do not move.

    Args:
        feet: (N, 2, 3) x and z of the ankle of the flat foot, yaw in degrees.
        lift, tip: (N, 2) metres, radians.
    """
    flat = _leg()[3]
    turn, pivot, edge = np.radians(feet[..., 2]), np.where(tip > 0, BALL, _HEEL), np.sin(tip)
    ahead = pivot + flat[1] * edge - pivot * np.cos(tip)
    soft = _TURNS_OVER * np.maximum(lift, 0.0)
    rise = (BALL + _HEEL) / 2 * edge + _SPREAD * (np.sqrt(edge * edge + soft * soft) - soft)
    height = flat[1] * np.cos(tip) + rise + lift
    return np.stack([feet[..., 0] + np.sin(turn) * ahead, height, feet[..., 1] + flat[2] + np.cos(turn) * ahead], -1)


def _height(root: Array, hips: Array, ankles: Array) -> Array:
    """The greatest height of the hips that both legs allow, smoothed; a lifted foot does not pull the hips down."""
    limit = _STRAIGHT * sum(_lengths())
    joints = quat_rotate(hips[:, None], _leg()[0] * _SIDES)
    flat = (root[:, None] + joints - ankles)[..., [0, 2]]
    reach = np.sqrt(np.maximum(limit**2 - (flat**2).sum(-1), 0.04))
    a, c = (ankles[..., 1] + reach - joints[..., 1]).T
    return -_SOFT * np.logaddexp(-a / _SOFT, -c / _SOFT)


def _legs(hips: Array, root: Array, ankles: Array, yaw: Array, tip: Array) -> Array:
    """Two-bone inverse kinematics of both legs: (N, 2, 3, 4) local rotations of upper legs, lower legs, feet.

    Args:
        hips, root: (N, 4) rotation and (N, 3) position of the hips.
        ankles: (N, 2, 3) where the left and the right ankle are.
        yaw, tip: (N, 2) turn of the feet to the left, in degrees, and their roll over the balls, in radians.
    """
    rel = ankles - (root[:, None] + quat_rotate(hips[:, None], _leg()[0] * _SIDES))
    d = np.maximum(np.sqrt(np.einsum("nsi,nsi->ns", rel, rel)), 1e-6)
    along = rel / d[..., None]
    turn = np.radians(yaw)
    pole = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], -1)
    pole = pole - np.einsum("nsi,nsi->ns", pole, along)[..., None] * along
    pole /= np.maximum(np.sqrt(np.einsum("nsi,nsi->ns", pole, pole))[..., None], 1e-9)
    knee = place_middle_joint(along, d, pole, _lengths(), _MOST_COSINE)
    hinge = cross(-along, pole)  # to the left
    bones = _bones(np.stack([knee, rel - knee], 2), hinge[:, :, None])
    world = np.concatenate([bones, euler_to_quat(np.stack([turn, tip], -1), "YX")[:, :, None]], 2)
    above = np.concatenate([np.broadcast_to(hips[:, None, None], (*hips.shape[:1], 2, 1, 4)), bones], 2)
    return quat_multiply(quat_conjugate(above), world)


def _bones(directions: Array, hinge: Array) -> Array:
    """World rotations with which thigh and shin lie along ``directions (N, 2, 2, 3)``, with the x-axis on ``hinge``."""
    down = -directions / np.sqrt(np.einsum("nsbi,nsbi->nsb", directions, directions))[..., None]
    hinge = np.broadcast_to(hinge, down.shape)
    q = matrix_to_quat(np.stack([hinge, down, cross(hinge, down)], -1))
    return quat_multiply(q, _tilts())


@lru_cache(1)
def _tilts() -> Array:
    """(2, 4) corrections, because the rest offsets of knee and ankle do not point straight down."""
    tilt = np.array([np.arctan2(rest[2], -rest[1]) / 2 for rest in _leg()[1:3]])
    return np.stack([np.sin(tilt), 0 * tilt, 0 * tilt, np.cos(tilt)], -1)


def carry(hips: Array, place: Array, b: Array) -> tuple[Array, Array, Array]:
    """Compute legs for given rotations of the hips, over the feet of a body's track.

    Args:
        hips: (N, 4) rotations of the hips.
        place: (N, 3) of the hips' joint, metres; its height is not used.
        b: (N, channels) of the track: feet, lifts, tips and how far the hips sink.

    Returns:
        The eight joints, their local rotations (N, 8, 4), and the height (N,) of the hips.
    """
    feet = np.stack([b[:, Body.LEFT_FOOT], b[:, Body.RIGHT_FOOT]], 1)
    lift, tip = b[:, Body.LEFT_LIFT : Body.RIGHT_LIFT + 1], np.radians(b[:, Body.LEFT_TIP : Body.RIGHT_TIP + 1])
    ankles = _ankles(feet, lift, tip)
    root = place.copy()
    root[:, 1] = _height(place, hips, ankles) - _sunk(b)
    legs = _legs(hips, root, ankles, feet[..., 2], tip).reshape(-1, 6, 4)
    joints = np.concatenate([_leg_joints().ravel(), _toes()])
    return joints, np.concatenate([legs, _about_x(-_bend_toes(tip))], 1), root[:, 1]


def read_feet(rotations: Array, root: Array) -> Array:
    """Places of the feet of a motion: the inverse of `place_feet`.

    Args:
        rotations, root: (N, J, 4) local rotations of our humanoid, (N, 3) metres.

    Returns:
        (N, 2, 5) of the left and the right foot: x and z of the ankle of the flat foot in metres, yaw in degrees, lift in
        metres, and roll over its ball in radians.
    """
    bones = rotations[:, _leg_joints()]
    world, ankle = rotations[:, :1], root[:, None] + quat_rotate(rotations[:, :1], _leg()[0] * _SIDES)
    for k, bone in enumerate((_leg()[1], _leg()[2])):
        world = quat_multiply(world, bones[:, :, k])
        ankle = ankle + quat_rotate(world, bone * _SIDES)
    toes = quat_rotate(quat_multiply(world, bones[:, :, 2]), np.array([0.0, 0.0, 1.0]))
    turn, tip = np.arctan2(toes[..., 0], toes[..., 2]), -np.arcsin(clip(toes[..., 1], -1.0, 1.0))
    away = _ankles(np.stack([0 * turn, 0 * turn, np.degrees(turn)], -1), 0 * tip, tip)
    flat = ankle - away
    return np.stack([flat[..., 0], flat[..., 2], np.degrees(turn), _read_lift(flat[..., 1], np.sin(tip)), tip], -1)


def _read_lift(height: Array, edge: Array) -> Array:
    """Lift in metres of feet whose ankles are ``height`` above those of feet on the floor: the inverse of `_ankles`."""
    share, over = _SPREAD * _TURNS_OVER, height + _SPREAD * abs(edge)
    a, b, c = 1 - 2 * share, over * (1 - share), over * over - (_SPREAD * edge) ** 2
    lift = (b - np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
    return np.where(height > 0, lift, height)  # type: ignore[no-any-return]


def place_feet(hips: Array, place: Array, feet: Array, soft: Array, sink: Array) -> tuple[Array, Array, Array]:
    """Compute legs for given hips and feet.

    Args:
        hips, place: (N, 4) rotations and (N, 3) places of the hips, metres; they are lowered if a leg cannot reach its foot.
        feet: (N, 2, 5) as of `read_feet`.
        soft: (N,) 0 … 1: how early the hips begin to sink before a leg is stretched, so that no knee snaps.
        sink: (N,) metres by which the hips sink further, so that a knee is bent before its foot leaves the floor.

    Returns:
        The eight joints, their local rotations (N, 8, 4), and the place (N, 3).
    """
    lift, tip = feet[..., 3], feet[..., 4]
    ankles = _ankles(feet[..., :3], lift, tip)
    place = place.copy()
    width = np.maximum(_SOFT * soft, 1e-9)
    place[:, 1] = -width * np.logaddexp(-place[:, 1] / width, -_height(place, hips, ankles) / width) - sink
    legs = _legs(hips, place, ankles, feet[..., 2], tip).reshape(-1, 6, 4)
    joints = np.concatenate([_leg_joints().ravel(), _toes()])
    return joints, np.concatenate([legs, _about_x(-_bend_toes(tip))], 1), place


def _bend_toes(tip: Array) -> Array:
    """Radians by which toes bend, so that they lie flat while the heel is up. They begin gently: 1 degree under a flat foot."""
    rolling = clip((tip + _ROLLS) / (2 * _ROLLS), 0.0, 1.0)
    return _ROLLS * rolling * rolling + np.maximum(tip - _ROLLS, 0.0)  # type: ignore[no-any-return]


def _about_x(angle: Array) -> Array:
    zero = np.zeros_like(angle)
    return np.stack([np.sin(angle / 2), zero, zero, np.cos(angle / 2)], -1)


@lru_cache(1)
def _toes() -> list[int]:
    return [humanoid().index[side + "Toes"] for side in ("left", "right")]


@lru_cache(1)
def _leg_joints() -> Array:
    """(2, 3) joints of `_legs`."""
    return np.array([[humanoid().index[side + n] for n in ("UpperLeg", "LowerLeg", "Foot")] for side in ("left", "right")])


def plant(hips: Array, place: Array) -> tuple[Array, Array, Array]:
    """Compute legs for hips alone: both feet stay in the rest stance. Low hips sit, with the ankles in front of them.

    Every frame depends on its own row only. Between `_STANDING` and `_SITTING` the ankles glide from under the hips to the
    front, so that nothing jumps.

    Args:
        hips: (N, 4) rotations of the hips.
        place: (N, 3) of the hips' joint, metres; it is lowered if the legs cannot reach the floor.

    Returns:
        The six joints, their local rotations (N, 6, 4), and the place (N, 3).
    """
    u = clip((_STANDING - place[:, 1]) / (_STANDING - _SITTING), 0, 1)
    ankles = np.empty((len(place), 2, 3))
    ankles[:] = _SIDES * STANCE
    ankles[..., 1] = _leg()[3][1]
    ankles[..., 2] = (_leg()[3][2] + _AHEAD * u * u * (3 - 2 * u))[:, None]
    place = place.copy()
    place[:, 1] = np.minimum(place[:, 1], _height(place, hips, ankles))
    yaw = np.broadcast_to(TOE_OUT * _SIDES[:, 0], ankles.shape[:2])
    return _leg_joints().ravel(), _legs(hips, place, ankles, yaw, np.zeros(ankles.shape[:2])).reshape(-1, 6, 4), place
