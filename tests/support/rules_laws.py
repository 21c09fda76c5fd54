"""Laws of the body that no generated motion may break, and speech-like sound to generate from.

Everything here is written without the gesturer's own tables: anatomy from the literature (ranges generous, after Kapandji,
*The Physiology of the Joints*, and the AAOS norms), volumes from the mannequin's measures, all in our humanoid's T-pose.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cospeech.motion.motion import Motion
from cospeech.motion.rotations import (
    quat_angle,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    quat_to_euler,
    quat_to_rotvec,
    quat_twist,
)
from cospeech.motion.skeleton import humanoid

__all__ = ["babble", "find_broken_laws", "hand_points", "wrist_distance"]

SKELETON = humanoid()
AT = SKELETON.index
TPOSE = SKELETON.tpose
SIDES = (("left", 1.0), ("right", -1.0))
FINGERS = ("Index", "Middle", "Ring", "Little")
X, Y, Z = np.eye(3)
RATE = 16000


def babble(seed: int, seconds: float | None = None) -> np.ndarray:
    """Speech-like sound at 16 kHz, 3–6 s: phrases of voiced syllables with a wandering pitch, consonant noise, pauses."""
    rng = np.random.default_rng(seed)
    seconds = rng.uniform(3.0, 6.0) if seconds is None else seconds
    count = round(seconds * RATE)
    t = np.arange(count) / RATE
    pitch = rng.uniform(95, 230) * np.exp(0.12 * np.sin(2 * np.pi * rng.uniform(0.3, 0.6) * t + rng.uniform(0, 6)))
    phase = 2 * np.pi * np.cumsum(pitch) / RATE
    formant = rng.uniform(400, 900)
    voice = np.zeros(count)
    for harmonic in range(1, 30):
        voice += np.sin(harmonic * phase) / (1 + np.abs(harmonic * 150 - formant) / 250)
    loudness, hiss = np.zeros(count), np.zeros(count)
    at, stop = rng.uniform(0.05, 0.4), 0.0
    while at < seconds - 0.1:
        if at > stop:  # a new phrase after a pause
            at += rng.uniform(0.25, 0.8)
            stop = at + rng.uniform(0.8, 2.5)
        length = rng.uniform(0.11, 0.28)
        stress = rng.uniform(0.25, 1.0) ** 1.5
        near = _near(at + length / 2, length / 4, count)
        loudness[near] += stress * np.exp(-0.5 * ((t[near] - at - length / 2) / (length / 4)) ** 2)
        near = _near(at, 0.02, count)
        hiss[near] += 0.15 * rng.random() * np.exp(-0.5 * ((t[near] - at) / 0.02) ** 2)
        at += length
    sound = 0.05 * voice * loudness + 0.1 * hiss * rng.normal(size=count) + 1e-4 * rng.normal(size=count)
    return (0.5 * sound / max(np.abs(sound).max(), 1e-6)).astype(np.float32)


def _near(time: float, width: float, count: int) -> slice:
    """The samples beside a time where a bell of this width is more than nothing: it is 0.0 from 38.7 widths on."""
    return slice(max(0, int((time - 39 * width) * RATE)), min(count, int((time + 39 * width) * RATE) + 1))


def local(motion: Motion, name: str) -> np.ndarray:
    return motion.rotations[:, AT[name]].astype(np.float64)


def mirrored(q: np.ndarray, sign: float) -> np.ndarray:
    """The rotation of a right joint as if it were a left one."""
    return q if sign > 0 else q * np.array([1.0, -1.0, -1.0, 1.0])


def degrees(q: np.ndarray, order: str) -> np.ndarray:
    return np.degrees(quat_to_euler(q, order))


def _arm_angles(motion: Motion, side: str, sign: float) -> dict[str, tuple[np.ndarray, float, float]]:
    """Angles of one arm in degrees with the limits of anatomy; a left arm in the T-pose is all zeros."""
    upper, fore, hand = (mirrored(local(motion, side + part), sign) for part in ("UpperArm", "LowerArm", "Hand"))
    clavicle = mirrored(local(motion, side + "Shoulder"), sign)
    bone = quat_rotate(fore, X)  # the forearm in the upper arm's frame; the elbow bends towards +Z
    humerus = quat_rotate(quat_multiply(clavicle, upper), X)  # in the upper chest's frame
    twist = sum(2 * np.degrees(np.arctan2(t[:, 0], t[:, 3])) for t in (quat_twist(fore, X), quat_twist(hand, X)))
    supination = (180 - twist) % 360 - 180  # the T-pose is the middle: thumb on the side to which the elbow bends
    wrist = degrees(hand, "XYZ")
    roll = quat_twist(upper, X)
    return {
        "elbow flexion": (np.degrees(np.arctan2(bone[:, 2], bone[:, 0])), -5, 152),
        "elbow hinge": (np.degrees(np.arcsin(np.clip(bone[:, 1], -1, 1))), -10, 10),
        "supination": (supination, -100, 100),
        "wrist flexion": (-wrist[:, 2], -80, 85),
        "wrist deviation": (wrist[:, 1], -30, 42),
        "upper arm inward": (np.degrees(np.arcsin(np.clip(-humerus[:, 0], -1, 1))), -90, 50),
        "upper arm backward": (np.degrees(np.arcsin(np.clip(-humerus[:, 2], -1, 1))), -90, 65),
        "upper arm roll": (np.degrees(2 * np.arctan2(roll[:, 0], roll[:, 3]) + np.pi) % 360 - 180, -125, 125),
        "clavicle": (np.degrees(np.linalg.norm(quat_to_rotvec(clavicle), axis=-1)), 0, 40),
    }


def _finger_angles(motion: Motion, side: str, sign: float) -> dict[str, tuple[np.ndarray, float, float]]:
    angles = {}
    for finger in FINGERS:
        first, middle, last = (
            degrees(mirrored(local(motion, side + finger + part), sign), "YXZ")
            for part in ("Proximal", "Intermediate", "Distal")
        )
        angles |= {
            f"{finger} knuckle": (-first[:, 2], -35, 97),
            f"{finger} spread": (first[:, 0], -28, 28),
            f"{finger} middle joint": (-middle[:, 2], -8, 112),
            f"{finger} last joint": (-last[:, 2], -12, 88),
            f"{finger} hinges": (np.abs(np.concatenate([first[:, 1], middle[:, :2].ravel(), last[:, :2].ravel()])), 0, 8),
        }
    for part, most in (("Metacarpal", 65), ("Proximal", 72), ("Distal", 92)):
        thumb = local(motion, side + "Thumb" + part)
        angles[f"thumb {part}"] = (np.degrees(np.linalg.norm(quat_to_rotvec(thumb), axis=-1)), 0, most)
    return angles


def _middle_angles(motion: Motion) -> dict[str, tuple[np.ndarray, float, float]]:
    spine = quat_multiply(quat_multiply(local(motion, "spine"), local(motion, "chest")), local(motion, "upperChest"))
    head = degrees(quat_multiply(local(motion, "neck"), local(motion, "head")), "YXZ")
    trunk = degrees(spine, "YXZ")
    return {
        "head yaw": (head[:, 0], -72, 72),
        "head pitch": (head[:, 1], -52, 52),
        "head roll": (head[:, 2], -42, 42),
        "trunk yaw": (trunk[:, 0], -45, 45),
        "trunk pitch": (trunk[:, 1], -25, 50),
        "trunk roll": (trunk[:, 2], -30, 30),
    }


def _leg_angles(motion: Motion, side: str, sign: float) -> dict[str, tuple[np.ndarray, float, float]]:
    knee = degrees(mirrored(local(motion, side + "LowerLeg"), sign), "XYZ")
    hip = degrees(mirrored(local(motion, side + "UpperLeg"), sign), "XYZ")
    foot = np.degrees(np.linalg.norm(quat_to_rotvec(local(motion, side + "Foot")), axis=-1))
    return {
        "knee": (knee[:, 0], -6, 140),
        "knee hinge": (np.abs(knee[:, 1:]).ravel(), 0, 12),
        "hip flexion": (-hip[:, 0], -30, 120),
        "hip abduction": (hip[:, 2], -40, 60),
        "ankle": (foot, 0, 55),
    }


def joint_limit_faults(motion: Motion) -> list[str]:
    """Angles outside anatomy's limits."""
    angles = _middle_angles(motion)
    for side, sign in SIDES:
        for table in (_arm_angles, _finger_angles, _leg_angles):
            angles |= {f"{side} {name}": row for name, row in table(motion, side, sign).items()}
    return [
        f"{name}: {x.min():.1f} … {x.max():.1f}°, allowed {low} … {high}°"
        for name, (x, low, high) in angles.items()
        if x.min() < low or x.max() > high
    ]


SPEED_CAPS = {  # rad/s of one joint; after the fastest movements reported for unloaded limbs, ours rounded
    **dict.fromkeys([s + f for s, _ in SIDES for f in ("Thumb", *FINGERS)], 25.0),
    **dict.fromkeys(["leftHand", "rightHand"], 20.0),
    **dict.fromkeys(["leftLowerArm", "rightLowerArm"], 18.0),
    **dict.fromkeys(["leftUpperArm", "rightUpperArm"], 14.0),
    **dict.fromkeys(["leftShoulder", "rightShoulder"], 5.0),
    **dict.fromkeys(["head", "neck"], 8.0),
    **dict.fromkeys(["jaw"], 12.0),
    **dict.fromkeys(["spine", "chest", "upperChest", "hips"], 3.0),
    **dict.fromkeys([s + p for s, _ in SIDES for p in ("UpperLeg", "LowerLeg", "Foot", "Toes")], 10.0),
    **dict.fromkeys(["leftEye", "rightEye"], 16.0),  # saccades: 900°/s at most
}


def speed_faults(motion: Motion) -> list[str]:
    """Joints that turn faster than a body can."""
    if len(motion) < 2:
        return []
    speeds = quat_angle(motion.rotations[:-1].astype(float), motion.rotations[1:].astype(float)).max(0) * motion.fps
    faults = []
    for name, speed in zip(SKELETON.names, speeds, strict=True):
        cap = next(c for prefix, c in sorted(SPEED_CAPS.items(), key=lambda item: -len(item[0])) if name.startswith(prefix))
        if speed > cap:
            faults.append(f"{name} turns at {speed:.1f} rad/s, at most {cap}")
    return faults


@lru_cache(1)
def hand_points() -> tuple[tuple[int, ...], tuple[tuple[int, tuple[float, float, float]], ...]]:
    """Joints of both hands (wrists, knuckles, finger joints), and (joint, offset) of the finger tips."""
    hands = [AT["leftHand"], AT["rightHand"], *SKELETON.left_hand, *SKELETON.right_hand]
    tips = [(AT[name], tuple(end)) for name, end in SKELETON.ends.items() if name.endswith("Distal")]
    return tuple(hands), tuple(tips)


# Height, half width, half depth in the T-pose (metres), by the bone that carries the section.
TORSO = np.array([(0.95, 0.175, 0.125), (1.06, 0.145, 0.105), (1.22, 0.160, 0.115), (1.33, 0.165, 0.110), (1.40, 0.125, 0.085)])
TORSO_Z = -0.008  # the sections' centre
CARRIERS = (("hips", 0.88, 1.04), ("spine", 1.04, 1.155), ("chest", 1.155, 1.28), ("upperChest", 1.28, 1.40))
HEAD_CENTRE, HEAD_RADII = np.array([0.0, 0.085, 0.012]), np.array([0.080, 0.125, 0.100])
_RING = np.linspace(0, 2 * np.pi, 96, endpoint=False)


def torso_depth(points: np.ndarray, positions: np.ndarray, world: np.ndarray) -> np.ndarray:
    """How deep ``points (T, N, 3)`` lie inside the torso in metres; 0 outside."""
    depth = np.zeros(points.shape[:-1])
    for bone, low, high in CARRIERS:
        k = AT[bone]
        home = quat_rotate(quat_conjugate(world[:, k])[:, None], points - positions[:, k, None]) + TPOSE[k]
        width, thick = (np.interp(home[..., 1], TORSO[:, 0], TORSO[:, column]) for column in (1, 2))
        x, z = home[..., 0], home[..., 2] - TORSO_Z
        inside = (home[..., 1] >= low) & (home[..., 1] < high) & ((x / width) ** 2 + (z / thick) ** 2 < 1)
        a, b, px, pz = width[inside], thick[inside], x[inside], z[inside]
        ring = np.hypot(a[:, None] * np.cos(_RING) - px[:, None], b[:, None] * np.sin(_RING) - pz[:, None])
        depth[inside] = np.maximum(depth[inside], ring.min(-1) if len(ring) else 0)
    return depth


def head_depth(points: np.ndarray, positions: np.ndarray, world: np.ndarray) -> np.ndarray:
    """How deep points lie inside the head's ellipsoid (along the ray from its centre), metres."""
    k = AT["head"]
    points_in_head = quat_rotate(quat_conjugate(world[:, k])[:, None], points - positions[:, k, None]) - HEAD_CENTRE
    norm = np.linalg.norm(points_in_head / HEAD_RADII, axis=-1)
    distance = np.linalg.norm(points_in_head, axis=-1)
    return np.where(norm < 1, distance * (1 / np.maximum(norm, 1e-6) - 1), 0.0)


def collision_faults(motion: Motion) -> list[str]:
    """Hands inside torso or head by more than 1 cm, or in one another."""
    positions, world = SKELETON.forward(motion.rotations, motion.root)
    joints, tips = hand_points()
    ends = [positions[:, k] + quat_rotate(world[:, k], np.array(offset)) for k, offset in tips]
    points = np.concatenate([positions[:, list(joints)], np.stack(ends, 1)], 1)
    names = [SKELETON.names[k] for k in joints] + [f"tip of {SKELETON.names[k]}" for k, _ in tips]
    faults = []
    for what, depth in (("torso", torso_depth), ("head", head_depth)):
        inside = depth(points, positions, world)
        frame, joint = np.unravel_index(np.argmax(inside), inside.shape)
        if inside[frame, joint] > 0.01:
            faults.append(f"{names[joint]} is {inside[frame, joint] * 100:.1f} cm inside the {what} at frame {frame}")
    palms = [(positions[:, AT[s + "Hand"]] + positions[:, AT[s + "MiddleProximal"]]) / 2 for s, _ in SIDES]
    apart = np.linalg.norm(palms[0] - palms[1], axis=-1)
    if apart.min() < 0.04:
        faults.append(f"palms are {apart.min() * 100:.1f} cm apart at frame {apart.argmin()}")
    return faults


ANKLE = TPOSE[AT["leftFoot"], 1]
SOLE = np.array([[0.0, -ANKLE, -0.03], [0.0, -ANKLE, 0.125]])  # below heel and ball, from the ankle in the foot's frame
GROUND = 0.003  # metres: a sole point lower than this stands on the ground


def feet_faults(motion: Motion, *, stand: bool) -> list[str]:
    """Soles under the ground, feet that slide, a body in the air; a seated body's hips that move."""
    positions, world = SKELETON.forward(motion.rotations, motion.root)
    faults, contacts = [], []
    for side, _ in SIDES:
        k = AT[side + "Foot"]
        sole = positions[:, k, None] + quat_rotate(world[:, k, None], SOLE)
        down = sole[..., 1] < GROUND
        contacts.append(down.any(-1))
        slide = np.linalg.norm(np.diff(sole[..., [0, 2]], axis=0), axis=-1) * motion.fps * (down[1:] & down[:-1])
        if sole[..., 1].min() < -0.005:
            faults.append(f"{side} sole is {-sole[..., 1].min() * 100:.2f} cm under the ground")
        if len(slide) and slide.max() >= 0.01:
            frame = np.argmax(slide.max(-1))
            faults.append(f"{side} foot slides at {slide.max() * 100:.1f} cm/s at frame {frame}")
    if stand and not np.logical_or(*contacts).all():
        faults.append(f"both feet are in the air at frame {np.argmin(np.logical_or(*contacts))}")
    hips = positions[:, AT["hips"]]
    if not stand and len(hips) and np.ptp(hips, axis=0).max() > 0.03:
        faults.append(f"hips of a seated body move by {np.ptp(hips, axis=0).max() * 100:.1f} cm")
    return faults


def number_faults(motion: Motion) -> list[str]:
    """Values that are no rotations, positions or weights."""
    rotations, faults = motion.rotations.astype(np.float64), []
    if not all(np.isfinite(x).all() for x in (rotations, motion.root, motion.face)):
        faults.append("not finite")
    if np.abs(np.linalg.norm(rotations, axis=-1) - 1).max() > 1e-4:
        faults.append("quaternions are not of unit length")
    if len(rotations) > 1 and np.einsum("tji,tji->tj", rotations[1:], rotations[:-1]).min() < 0:
        faults.append("quaternions flip their sign")
    if motion.face.min() < 0 or motion.face.max() > 1:
        faults.append(f"face weights {motion.face.min():.3f} … {motion.face.max():.3f}")
    return faults


def find_broken_laws(motion: Motion, *, stand: bool) -> list[str]:
    """One line for every law that the motion breaks; empty for a good one. ``stand``: on its feet, not seated."""
    return [
        *number_faults(motion),
        *joint_limit_faults(motion),
        *speed_faults(motion),
        *collision_faults(motion),
        *feet_faults(motion, stand=stand),
    ]


def wrist_distance(a: Motion, b: Motion) -> float:
    """Mean distance of the wrists of two motions, metres."""
    wrists = [AT["leftHand"], AT["rightHand"]]
    return float(np.linalg.norm(a.positions()[:, wrists] - b.positions()[:, wrists], axis=-1).mean())
