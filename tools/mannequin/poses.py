"""Poses for which the mannequin's weights are made: of the rules on the example speech, and of joints at their ends."""

from __future__ import annotations

import numpy as np

import cospeech
from cospeech.cli.demo import EXAMPLE, EXAMPLE_WORDS
from cospeech.motion.rotations import Array, axis_angle_to_quat, quat_identity, quat_multiply
from cospeech.motion.skeleton import humanoid

__all__ = ["GESTURING", "build_leg_poses", "build_poses"]

GESTURING = 41  # the first pose of `build_poses` that is of a gesture
_STYLES = {"natural": 8, "lively": 12, "seated": 6}  # frames of each; ours
_TURNS = (  # of neck and head about x, then y, then z, radians; ours
    (0.5, 0.0, 0.0),
    (-0.45, 0.0, 0.0),
    (0.0, 0.7, 0.0),
    (0.0, -0.7, 0.0),
    (0.0, 0.0, 0.4),
    (0.0, 0.0, -0.4),
    (0.3, 0.5, 0.2),
    (0.3, -0.5, -0.2),
)
_FAN = {"Index": -0.2, "Ring": 0.3, "Little": 0.6}  # of spread fingers about y, radians; ours
_BENT = 0.75  # of the bend of the outermost pose; ours
_THUMB = ((0.5, 0, 0), (-0.5, 0, 0), (0, 0.6, 0), (0, -0.6, 0), (0, 0, 0.5), (0, 0, -0.5))  # of its root, radians; ours
_WRIST = ((0.7, 0, 0), (-0.7, 0, 0), (0, 0.4, 0), (0, -0.4, 0), (0, 0, 0.8), (0, 0, -0.8))  # radians; ours
_LEGS = (  # radians: hip bent forward, knee bent, leg spread, leg turned outward; sitting, squatting, steps; ours
    (1.5, 1.5, 0.1, 0.0),
    (1.5, 1.3, 0.3, 0.2),
    (1.8, 2.0, 0.0, 0.0),
    (1.0, 1.2, 0.1, 0.0),
    (0.6, 0.9, 0.0, 0.0),
    (2.0, 2.4, 0.1, 0.0),
    (1.2, 0.4, 0.0, 0.0),
    (0.2, 1.2, 0.0, 0.0),
    (-0.3, 0.3, 0.0, 0.0),
    (0.0, 0.0, 0.5, 0.0),
    (1.5, 1.6, -0.25, 0.0),
    (0.4, 0.4, -0.2, 0.4),
    (0.4, 0.4, 0.2, -0.4),
)
_SITTING = 0.6  # of the spine's bend where both legs are bent, radians; ours
_SPINE = ((0.6, 0, 0), (1.0, 0, 0), (-0.3, 0, 0), (0, 0.4, 0), (0, -0.4, 0), (0, 0, 0.3), (0, 0, -0.3))  # radians; ours


def build_poses() -> Array:
    """(P, J, 4) local rotations of the humanoid: `GESTURING` of joints at their ends, then gestures and their mirrors."""
    speech = cospeech.Speech.load(EXAMPLE, transcript=EXAMPLE_WORDS)
    poses = _end_poses()
    for style, count in _STYLES.items():
        motion = cospeech.load("rules").generate(speech, style=style, seed=3)
        for frame in np.linspace(0, len(motion) - 1, count).round().astype(int):
            one = motion[frame : frame + 1]
            poses += [one.rotations[0], one.mirror().rotations[0]]
    return np.stack(poses).astype(float)


def _end_poses() -> list[Array]:
    """Heads turned and bent, fists, spread fingers, thumbs and wrists, on the T-pose."""
    found = []
    for turn in _TURNS:
        found += [_pose(neck=turn, head=turn), _pose(head=turn), _pose(head=tuple(2 * angle for angle in turn))]
    fist = [(1.0, 1.2, 0.8), (0.6, 0.7, 0.5), (1.2, 0.3, 0.2)]
    for bends in fist:
        curls = {}
        for side, sign in (("left", -1), ("right", 1)):
            for finger in ("Index", "Middle", "Ring", "Little"):
                for joint, bend in zip(("Proximal", "Intermediate", "Distal"), bends, strict=True):
                    curls[f"{side}{finger}{joint}"] = (0, 0, sign * bend * _BENT)
        found.append(_pose(**curls))
    for wide in (0.6, 1.2):
        spread = {}
        for side, sign in (("left", 1), ("right", -1)):
            spread |= {f"{side}{finger}Proximal": (0, sign * wide * turn, -sign * 0.4) for finger, turn in _FAN.items()}
        found.append(_pose(**spread))
    for x, y, z in _THUMB:
        found.append(_pose(leftThumbMetacarpal=(x, y, z), rightThumbMetacarpal=(x, -y, -z)))
    for x, y, z in _WRIST:
        found.append(_pose(leftHand=(x, y, z), rightHand=(x, -y, -z)))
    return found


def build_leg_poses() -> Array:
    """(P, J, 4) local rotations of the humanoid: one leg or both bent, spread and turned; the spine bent and turned."""
    found = [_pose(spine=turn) for turn in _SPINE]
    for hip, knee, wide, turned in _LEGS:
        left = {"leftUpperLeg": (-hip, turned, wide), "leftLowerLeg": (knee, 0.0, 0.0)}
        right = {"rightUpperLeg": (-hip, -turned, -wide), "rightLowerLeg": (knee, 0.0, 0.0)}
        found += [_pose(**left), _pose(**right), _pose(**left, **right, spine=(_SITTING, 0.0, 0.0))]
    return np.stack(found)


def _pose(**turns: tuple[float, float, float]) -> Array:
    """(J, 4) of the T-pose with some joints turned about x, then y, then z, radians; the neck and head share their turn."""
    index, local = humanoid().index, quat_identity(len(humanoid()))
    for name, angles in turns.items():
        for axis, angle in zip(np.eye(3), angles, strict=True):
            local[index[name]] = quat_multiply(axis_angle_to_quat(axis, angle), local[index[name]])
    return local
