"""Poses for which the mannequin's weights are made: of the rules on the example speech, and of joints at their ends."""

from __future__ import annotations

import numpy as np

import cospeech
from cospeech.cli.demo import EXAMPLE, EXAMPLE_WORDS
from cospeech.motion.rotations import Array, axis_angle_to_quat, quat_identity, quat_multiply
from cospeech.motion.skeleton import humanoid

__all__ = ["build_poses"]

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


def build_poses() -> Array:
    """(P, J, 4) local rotations of the humanoid; with each pose its mirror image."""
    speech = cospeech.Speech.load(EXAMPLE, transcript=EXAMPLE_WORDS)
    poses = [*_end_poses()]
    for style, count in _STYLES.items():
        motion = cospeech.load("rules").generate(speech, style=style, seed=3)
        for frame in np.linspace(0, len(motion) - 1, count).round().astype(int):
            one = motion[frame : frame + 1]
            poses += [one.rotations[0], one.mirror().rotations[0]]
    return np.stack(poses).astype(float)


def _end_poses() -> list[Array]:
    """Heads turned and bent, fists and spread fingers, on the T-pose."""
    found = []
    for turn in (
        (0.5, 0, 0),
        (-0.45, 0, 0),
        (0, 0.7, 0),
        (0, -0.7, 0),
        (0, 0, 0.4),
        (0, 0, -0.4),
        (0.3, 0.5, 0.2),
        (0.3, -0.5, -0.2),
    ):
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
    return found


def _pose(**turns: tuple[float, float, float]) -> Array:
    """(J, 4) of the T-pose with some joints turned about x, then y, then z, radians; the neck and head share their turn."""
    index, local = humanoid().index, quat_identity(len(humanoid()))
    for name, angles in turns.items():
        for axis, angle in zip(np.eye(3), angles, strict=True):
            local[index[name]] = quat_multiply(axis_angle_to_quat(axis, angle), local[index[name]])
    return local
