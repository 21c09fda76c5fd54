"""Realising: tracks → rotations of all joints at given times.

Everything here is a pure function of time, given the moves planned so far: no filter state, no dependence on the size of
the pieces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..motion.curves import smoothstep, soft_clip, soft_positive
from ..motion.kinematics import arms
from ..motion.kinematics.arm_clearance import push_from_body
from ..motion.kinematics.arms import MIRROR_Q, MIRROR_V
from ..motion.kinematics.body import NECK_SHARE, SPINE, Body
from ..motion.kinematics.body_volume import push_from_thighs
from ..motion.kinematics.hands import Channel
from ..motion.kinematics.legs import balance, stand, weight_shift
from ..motion.noise import smooth_noise
from ..motion.rotations import (
    Array,
    euler_to_quat,
    quat_conjugate,
    quat_identity,
    quat_multiply,
    quat_rotate,
    quat_to_rotvec,
    rotvec_to_quat,
)
from ..motion.skeleton import humanoid
from .arm_frames import ArmFrames, arm_frames, lay_on_lap, offsets
from .hand_noise import add_hand_noise
from .minimum_jerk import MinimumJerkTrack
from .stance import BREATH_PITCH, CONTRAPPOSTO, DRIFT, DRIFT_HZ, PELVIS_SHARE
from .styles import Style

__all__ = ["Pieces", "gaze_only", "realise"]

_ASIDE, _BEFORE, _MOST_TURN = 13.0, 7.0, 10.0
"""Degrees by which the chest turns per arm length that both hands are aside, and that one is before the other, and at most.
[ours: 32°/m and 65°/m explain .79 of the yaw of a recorded speaker's shoulders; strokes and clavicles make the rest of ours]"""
_STABLE = 0.65  # share of the torso's motion that the head does not follow (gaze stabilisation)
_BENDS = (-24.0, 49.0)  # degrees back and forward that a trunk bends, whatever adds up (ours, by the laws of the body)
_MOST_YAW = 25.0  # degrees that a chest turns from the listener, whatever adds up (ours: hands must not come before the face)
_BREATH_LIFT = 2.2  # degrees by which a breath lifts the clavicles (ours: about 1 cm)
_LIFT, _REACH, _DRAW_BACK, _ROLL = 11.0, 7.0, 3.0, 16.0
"""Degrees by which a clavicle rises with a raised arm, comes forward with one that reaches, is drawn back with one that hangs,
and rolls backward about itself as the arm rises. The roll is the largest in people, too (Ludewig et al. 2009). [sizes ours: the
line of a recorded speaker's shoulders follows the hands by 10°/m]"""
_ON_CHAIRS = 0.76  # share of that on a chair, where shoulders would otherwise move only with the hands (ours)
_PALM, _TIP = 0.080, 0.172  # metres from the wrist to the middle of the palm, to the fingertips
_MIDDLE_OF_HAND = 0.6  # share of the way from the wrist to the palm, where two hands are kept apart (ours)
_APART = 0.115  # metres between the palms below which hands make room for each other
_NEARLY = 0.012  # metres over which they begin to part (ours)
_CLEAR = 0.010  # metres of air kept between hand and body


class Pieces(NamedTuple):
    """Rotations, root and gaze of a block of frames."""

    rotations: Array
    root: Array
    gaze: Array
    """(N, 2) planned, relative to the listener: yaw to the left and pitch up, radians; see `cospeech.face.gaze`."""


def realise(
    times: Array,
    body: MinimumJerkTrack,
    hands: list[MinimumJerkTrack] | None,
    style: Style,
    *,
    seed: int,
    size: float,
    tremor: Array,
) -> Pieces:
    """Pose the whole body.

    Args:
        times: (N,) seconds.
        body: track of hips, torso, head, gaze, feet.
        hands: tracks of the left and the right hand; None: only the gaze and the hips' place are made, at a quarter of the
            cost.
        style: of the speaker: size of the noise, stance, whether it sits.
        seed: of the noise.
        size: factor on noise (intensity).
        tremor: (N,) 0 … 1, added fine shaking (fear).
    """
    joint = humanoid().index
    b = body.at(times)
    _add_body_noise(b, times, style, seed, size)
    rotations = quat_identity(len(times), len(humanoid()))
    breath = b[:, Body.BREATH]
    turn = np.radians(style.turn)
    h = None
    if hands is not None:
        h = np.stack([track.at(times) for track in hands], 1)
        add_hand_noise(h, times, seed, size, tremor)
        b[:, Body.YAW] += min(style.torso, 1.0) * (_ON_CHAIRS if style.seated else 1.0) * _turn_to_hands(h)
        b[:, Body.YAW] = soft_clip(b[:, Body.YAW], -_MOST_YAW, _MOST_YAW)
    hips, root = stand(b, style.seated, None if h is None else rotations)
    torso = _euler(b, (Body.YAW, Body.PITCH, Body.ROLL))
    torso = quat_multiply(torso, arms._about(0, np.radians(-BREATH_PITCH) * breath))
    head, gaze = _head(b, torso, turn), _gaze(b)
    facing = np.array([0.0, np.sin(turn / 2), 0.0, np.cos(turn / 2)])
    if h is None:
        return Pieces(rotations, quat_rotate(facing, root), gaze)
    rotations[:, 0] = quat_multiply(facing, hips)
    nod = quat_to_rotvec(quat_multiply(quat_conjugate(torso), head))
    rotations[:, joint["neck"]] = rotvec_to_quat(nod * NECK_SHARE)
    rotations[:, joint["head"]] = rotvec_to_quat(nod * (1 - NECK_SHARE))
    bend = quat_to_rotvec(quat_multiply(quat_conjugate(hips), torso))
    position, world = root, hips
    places = {"hips": (root, hips)}
    for name, share in SPINE:
        local = rotvec_to_quat(bend * share)
        rotations[:, joint[name]] = local
        position = position + quat_rotate(world, offsets()[name])
        world = quat_multiply(world, local)
        places[name] = (position, world)
    neck = position + quat_rotate(world, offsets()["neck"])
    _arms(h, places, neck, b, rotations, style, breath)
    return Pieces(rotations, quat_rotate(facing, root), gaze)


def gaze_only(times: Array, body: MinimumJerkTrack) -> Pieces:
    """The gaze at ``times (N,)`` seconds on a body of no joints, for a face whose head another system turns."""
    root = np.repeat(humanoid().offsets[:1].astype(float), len(times), 0)
    return Pieces(quat_identity(len(times), 0), root, _gaze(body.at(times)))


def _gaze(b: Array) -> Array:
    return np.radians(b[:, [Body.GAZE_YAW, Body.GAZE_UP]])


def _euler(b: Array, columns: tuple[int, int, int]) -> Array:
    """(N, 4) from yaw, pitch, roll columns in degrees."""
    return euler_to_quat(np.radians(b[:, list(columns)]), "YXZ")


def _add_body_noise(b: Array, times: Array, style: Style, seed: int, size: float) -> None:
    """Add sway that never stops, and the chest's share of the turn of the pelvis."""
    n = smooth_noise(seed + 1, 11, times, 0.42, octaves=3, gain=0.55)
    still = 0.6 + 0.4 * min(size, 1.0)
    head, torso, sway = style.head * still, min(style.torso, 1.0) * still * (2.7 if style.seated else 1.0), style.sway * still
    hip_sway = sway * (0.15 if style.seated else 1.0)
    scale = np.array(
        [0.9 * torso, 1.0 * torso, 1.8 * torso, 1.6 * head, 1.5 * head, 2.1 * head, 0.004 * hip_sway, 0.004 * hip_sway]
        + [1.4 * sway, 0.9 * sway, 0.9 * sway]
    )
    b[:, _SWAYING] += n * scale
    b[:, Body.PLACE] += smooth_noise(seed + 6, 2, times, DRIFT_HZ, octaves=1) * (DRIFT * hip_sway)
    if not style.seated:
        b[:, Body.PLACE] = balance(b[:, Body.PLACE], b)
        b[:, Body.ROLL] -= CONTRAPPOSTO * weight_shift(b)
    feet = 0.0 if style.seated else 0.5 * (b[:, Body.LEFT_FOOT.stop - 1] + b[:, Body.RIGHT_FOOT.stop - 1])
    b[:, Body.YAW] += PELVIS_SHARE * (b[:, Body.HIPS_YAW] + feet)
    b[:, Body.PITCH] = soft_clip(b[:, Body.PITCH], *_BENDS)


_SWAYING = [Body.PITCH, Body.ROLL, Body.YAW, Body.HEAD_PITCH, Body.HEAD_ROLL, Body.HEAD_YAW, Body.HIPS_X, Body.HIPS_Z] + [
    Body.HIPS_YAW, Body.HIPS_PITCH, Body.HIPS_ROLL
]  # fmt: skip


def _head(b: Array, torso: Array, turn: float) -> Array:
    """How the head is turned in the world, (N, 4)."""
    b = b.copy()
    b[:, Body.HEAD_YAW] -= 0.62 * np.degrees(turn)
    head = _euler(b, (Body.HEAD_YAW, Body.HEAD_PITCH, Body.HEAD_ROLL))
    base = rotvec_to_quat(quat_to_rotvec(torso) * (1 - _STABLE))
    return quat_multiply(base, head)


# ---------------------------------------------------------------------------------------------------------- arms


def _turn_to_hands(h: Array) -> Array:
    """(N,) degrees by which the chest turns to the left, because of where both hands ``h (N, 2, channels)`` are."""
    aside = (h[:, 0, Channel.OUT] - h[:, 1, Channel.OUT]) / 2
    before = h[:, 1, Channel.FORWARD] - h[:, 0, Channel.FORWARD]
    return soft_clip(_ASIDE * aside + _BEFORE * before, -_MOST_TURN, _MOST_TURN)


def _arms(
    h: Array, places: dict[str, tuple[Array, Array]], neck: Array, b: Array, rotations: Array, style: Style, breath: Array
) -> None:
    frames = arm_frames(places, neck, b, rotations, style)
    o = offsets()
    length = arms.arm_lengths().total
    angles = np.radians(h[..., 4:7])
    angles = np.stack([soft_clip(angles[..., k], low, high) for k, (low, high) in enumerate(_WRIST_LIMITS)], -1)
    _stay_beside_face(h, b[:, Body.YAW])
    place = _bend_elbows(_pass_before_shoulder(h[..., :3]), _ON_THIGHS if style.seated else _LOW) * length
    target = o["leftShoulder"] + o["leftUpperArm"] + quat_rotate(frames.gesture, place) + frames.stay
    height = h[..., Channel.UP]
    if style.seated:
        target = lay_on_lap(target, place, height, frames, style)
    along = _ON_CHAIRS if style.seated else 1.0
    rise = along * smoothstep((height + 1.0) / 1.3)
    lift = (
        np.radians(h[..., Channel.SHRUG])
        + np.radians(b[:, Body.SHOULDERS])[:, None]
        + np.radians(_LIFT) * rise
        + np.radians(_BREATH_LIFT) * breath[:, None]
    )
    reach_out = along * np.radians(_REACH) * smoothstep((h[..., Channel.FORWARD] - 0.05) / 0.75) - np.radians(_DRAW_BACK)
    clavicle = quat_multiply(arms._about(2, lift), arms._about(1, -reach_out))
    roll = along * np.radians(_ROLL) * smoothstep((height + 1.0) / 0.9)
    clavicle = quat_multiply(clavicle, arms._about(0, -roll))
    shoulder = o["leftShoulder"] + quat_rotate(clavicle, np.broadcast_to(o["leftUpperArm"], target.shape))
    swivel = np.radians(h[..., Channel.SWIVEL]) + _lift_elbows(h)
    rel = arms.reach(target - shoulder)
    pronation, wrist = arms.hand_turns(angles)
    hand, points = quat_multiply(pronation, wrist), _hand_points(h)
    for _ in range(2):
        rel = _make_room(rel, shoulder, quat_multiply(arms.solve_arm(rel, swivel)[1], hand), points, frames, style)
    upper, fore = arms.solve_arm(rel, swivel)
    _write_arms(rotations, clavicle, upper, quat_multiply(fore, pronation), wrist, h)


_HIGH, _HIGHER = -0.25, 0.3
"""Arm lengths above the shoulder from which on a hand stays beside the face of a body that turns, and over which this grows.
[ours: a chest that turns by 20° carries a hand sideways by .2 m]"""
_EARLY, _SAFELY = 0.05, 1.2  # sine of the turn over which this sets in; factor for fingertips ahead of the wrist (ours)


def _stay_beside_face(h: Array, yaw: Array) -> None:
    """Move high hands ``h (N, 2, channels)`` outward by as much as the chest's ``yaw (N,)``, degrees, carries them inward."""
    shift = np.sin(np.radians(yaw))[:, None] * (-1.0, 1.0)
    inward = soft_positive(shift, _EARLY)
    high = smoothstep((h[..., Channel.UP] - _HIGH) / _HIGHER)
    h[..., Channel.OUT] += _SAFELY * inward * high * np.maximum(h[..., Channel.FORWARD], 0.0)


_EASY, _MORE = 0.58, 0.32
"""Arm lengths up to which a raised hand goes where it was planned, and by how much it goes further at most. [ours: the raised
hands of a recorded speaker are .59 to .92 arm lengths from the shoulder, 5 to 99 %]"""
_LOW, _ON_THIGHS, _RAISED_BY = -0.94, -0.70, 0.32
"""Arm lengths above the shoulder of an arm that may be straight, of a standing and of a seated body; and up to one that is
raised. [ours]"""


def _bend_elbows(place: Array, low: float) -> Array:
    """Places of hands ``(N, 2, 3)`` from their shoulders, arm lengths, so near that the elbow of a raised arm stays bent.

    ``low`` is the height above the shoulder up to which an arm may be straight.
    """
    far = np.sqrt(np.einsum("nij,nij->ni", place, place))[..., None]
    easy = np.minimum(far, _EASY) + _MORE * np.tanh(np.maximum(far - _EASY, 0.0) / _MORE)
    lift = smoothstep((place[..., 1:2] - low) / _RAISED_BY)
    result: Array = place * (1.0 + lift * (easy / np.maximum(far, 1e-6) - 1.0))
    return result


_NEAR, _SOFT = 0.44, 0.04
"""Arm lengths before its shoulder at which a hand passes it, and over which this sets in. [ours: a path through the shoulder
would throw the hand around it in one frame]"""


def _pass_before_shoulder(place: Array) -> Array:
    """Places of hands ``(N, 2, 3)`` from their shoulders, arm lengths, in front of them where they come near."""
    aside = np.einsum("nij,nij->ni", place[..., :2], place[..., :2])
    front = (_NEAR**2 - aside) / _NEAR
    result: Array = place.copy()
    result[..., 2] += soft_positive(front - place[..., 2], _SOFT)
    return result


_ELBOW, _OUTWARD, _MIDDLE, _WIDTH = np.radians(13.0), np.radians(40.0), 0.15, 0.55
"""Radians by which an elbow leaves its natural place outward where the hand is before its shoulder, and by which this grows and
falls as the hand goes inward and outward; arm lengths outward. [ours: one recorded speaker's elbow rises by 74° for an arm
length inward; `cospeech.motion.kinematics.arms` says where an elbow is by nature]"""


def _lift_elbows(h: Array) -> Array:
    """(N, 2) radians of swivel that follow from where the hands ``h (N, 2, channels)`` are; arms that hang have none."""
    lift = smoothstep((h[..., Channel.UP] + 1.0) / 0.3)
    return lift * (_ELBOW + _OUTWARD * np.tanh((_MIDDLE - h[..., Channel.OUT]) / _WIDTH))


_WRIST_LIMITS = tuple((np.radians(a), np.radians(z)) for a, z in ((-84.0, 84.0), (-66.0, 62.0), (-20.0, 30.0)))
"""Pronation, flexion, deviation: within the active ranges of adults (Boone & Azen 1979)."""


def _hand_points(h: Array) -> Array:
    """(3, N, 2, 3) of palm, fingertips and thumb from the wrist, in the hand's frame."""
    curl = np.radians(h[..., 7:15]).mean(-1)
    points = np.empty((3, *curl.shape, 3))
    points[0] = (_PALM, -0.012, 0.0)
    points[1, ..., 0], points[1, ..., 1] = np.cos(curl) * (_TIP - 0.09) + 0.09, -np.sin(curl) * (_TIP - 0.09) - 0.006
    points[1, ..., 2] = 0.0
    points[2] = (0.085, -0.03, 0.07)
    return points


def _make_room(rel: Array, shoulder: Array, hand: Array, points: Array, frames: ArmFrames, style: Style) -> Array:
    """Move wrists so that wrist, palm and fingertips stay out of torso, head, lap and the other hand.

    Args:
        rel: (N, 2, 3) wrists from the shoulders.
        hand: (N, 2, 4) how the hands are turned.
        points: of `_hand_points`.
    """
    palm, tips, thumb = quat_rotate(hand, points)
    wrist_at = shoulder + rel
    for offset, radius, flat in ((None, 0.036, 0.028), (palm, 0.050, 0.024), (tips, 0.026, 0.010), (thumb, 0.022, 0.010)):
        point = wrist_at if offset is None else wrist_at + offset
        wrist_at = wrist_at + push_from_body(point, radius + _CLEAR, frames.trunk)
        if style.seated:
            wrist_at = wrist_at + _push_from_lap(wrist_at if offset is None else wrist_at + offset, flat, frames)
    point = wrist_at + _MIDDLE_OF_HAND * palm
    apart = point[:, 0] - point[:, 1] * MIRROR_V
    distance = np.sqrt(np.einsum("ni,ni->n", apart, apart))[:, None] + 1e-6
    need = 0.5 * soft_positive(_APART - distance, _NEARLY)
    way = (apart + np.array([0.02, 0.0, 0.0])) / (distance + 0.02)
    wrist_at = wrist_at + np.stack([way, -way * MIRROR_V], 1) * need[:, None]
    return arms.reach(wrist_at - shoulder)


def _push_from_lap(point: Array, radius: float, frames: ArmFrames) -> Array:
    """As `push_from_body`, out of the thighs of a seated body; a palm lies flat on them."""
    level = quat_rotate(frames.to_seat, point) + frames.seat_at + offsets()["t:hips"]
    return quat_rotate(frames.from_seat, push_from_thighs(level, frames.lap, 0.46, radius))


def _write_arms(rotations: Array, clavicle: Array, upper: Array, forearm: Array, wrist: Array, h: Array) -> None:
    joint = humanoid().index
    locals_ = {
        "Shoulder": clavicle,
        "UpperArm": arms.to_parent(clavicle, upper),
        "LowerArm": arms.to_parent(upper, forearm),
        "Hand": wrist,
    }
    for name, q in locals_.items():
        rotations[:, joint["left" + name]] = q[:, 0]
        rotations[:, joint["right" + name]] = q[:, 1] * MIRROR_Q
    fingers = arms.finger_rotations(h)
    left, right = arms.finger_joints()
    rotations[:, left] = fingers[:, 0]
    rotations[:, right] = fingers[:, 1] * MIRROR_Q
