"""Poses for which the mannequin is eased: of the rules on the example speech, and of joints anywhere within their limits."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np

import cospeech
from cospeech.cli.demo import EXAMPLE, EXAMPLE_WORDS
from cospeech.motion.rotations import Array, axis_angle_to_quat, quat_identity, quat_multiply
from cospeech.motion.skeleton import humanoid
from cospeech.rules import STYLES

__all__ = ["build_finger_poses", "build_limit_poses", "build_speaking_poses"]

_FRAMES = 60  # of each performance; ours
_TAKES = ((3, EXAMPLE_WORDS), (4, None), (5, None))  # seeds and transcripts of the performances in each style; ours
# Degrees about x, y and z of the left side, least and most: the half axes of the ellipsoid of a joint's turns. Ours: about
# what people reach, and more where files bend one bone for several (the trunk) or twist a hand for its forearm.
_LIMITS = {
    "spine": ((-20, 60), (-30, 30), (-20, 20)),
    "chest": ((-15, 25), (-20, 20), (-15, 15)),
    "upperChest": ((-10, 20), (-15, 15), (-10, 10)),
    "neck": ((-35, 40), (-45, 45), (-45, 45)),
    "head": ((-85, 45), (-45, 45), (-25, 25)),
    "Shoulder": ((-10, 10), (-20, 20), (-10, 30)),
    "Hand": ((-110, 110), (-30, 30), (-75, 75)),
    "UpperLeg": ((-125, 25), (-40, 40), (-25, 55)),
    "LowerLeg": ((0, 150), (-10, 10), (-5, 5)),
    "Foot": ((-35, 45), (-30, 30), (-20, 20)),
    "Toes": ((-45, 20), (-5, 5), (-5, 5)),
    "ThumbMetacarpal": ((-40, 60), (-40, 80), (-30, 30)),
    "ThumbProximal": ((-40, 20), (-30, 60), (-16, 16)),
    "ThumbDistal": ((-40, 20), (-15, 50), (-5, 5)),
}
_ARM = ((-85, 75), (-110, 35), (-80, 80))  # degrees: above the T-pose's arm, to the back, and twisted; ours
_ELBOW, _CARRIED = 155.0, 60.0  # degrees: bent at most; its axis off the T-pose's, as files have it; ours
_CURL = (85.0, 100.0, 60.0)  # degrees of a finger's joints in a fist; ours
_BACK = 15.0  # degrees to which a knuckle bends back; ours
_FAN = {"Index": -9.0, "Middle": 0.0, "Ring": 9.0, "Little": 18.0}  # degrees of spread fingers; ours


@lru_cache(1)
def build_speaking_poses() -> Array:
    """(P, J, 4) local rotations of the humanoid: the rules in all styles."""
    poses = []
    for seed, transcript in _TAKES:
        speech = cospeech.Speech.load(EXAMPLE, transcript=transcript)
        for style in STYLES:
            motion = cospeech.load("rules").generate(speech, style=style, seed=seed)
            poses.append(motion.rotations[np.linspace(0, len(motion) - 1, _FRAMES).round().astype(int)])
    return np.concatenate(poses).astype(float)


def build_limit_poses(count: int, seed: int) -> Array:
    """(count, J, 4) local rotations of the humanoid: joints anywhere within their limits, at random."""
    rng, index = np.random.default_rng(seed), humanoid().index
    poses = np.tile(quat_identity(len(humanoid())), (count, 1, 1)).astype(float)
    for pose in poses:
        for name, limits in _LIMITS.items():
            for side in ("left", "right") if name[0].isupper() else ("",):
                pose[index[side + name]] = _mirror(_draw_turn(rng, limits), side)
        for side in ("left", "right"):
            for name, turn in (_draw_arm(rng) | _draw_fingers(rng)).items():
                pose[index[side + name]] = _mirror(turn, side)
    return poses


def build_finger_poses() -> Array:
    """(12, J, 4) local rotations of the humanoid: each finger of the left hand apart from the others.

    It bends as in a fist, or at its knuckle alone, or stays straight in a fist. By chance such hands are too few, and the
    skin between two knuckles would stretch most of all.
    """
    fist, poses = dict(zip(("Proximal", "Intermediate", "Distal"), _CURL, strict=True)), []
    for finger in _FAN:
        others = [other for other in _FAN if other != finger]
        for fingers, joints in (([finger], [*fist]), ([finger], ["Proximal"]), (others, [*fist])):
            pose = quat_identity(len(humanoid())).astype(float)
            for name, joint in product(fingers, joints):
                pose[humanoid().index[f"left{name}{joint}"]] = _turn(0, 0, -fist[joint])
            poses.append(pose)
    return np.stack(poses)


def _mirror(turn: Array, side: str) -> Array:
    return turn * [1, -1, -1, 1] if side == "right" else turn


def _turn(x: float, y: float, z: float) -> Array:
    """Quaternion of a rotation vector in degrees."""
    vector = np.radians([x, y, z])
    return axis_angle_to_quat(vector / max(np.linalg.norm(vector), 1e-9), np.linalg.norm(vector))


def _draw_turn(rng: np.random.Generator, limits: tuple[tuple[float, float], ...]) -> Array:
    """A turn in the ellipsoid of a joint's limits."""
    way = rng.normal(size=3)
    way *= rng.random() ** 0.5 / np.linalg.norm(way)
    return _turn(*(high * w if w > 0 else -low * w for w, (low, high) in zip(way, limits, strict=True)))


def _draw_arm(rng: np.random.Generator) -> dict[str, Array]:
    """Turns of upper arm and forearm."""
    up, back, twist = (rng.uniform(*span) for span in _ARM)
    back *= np.cos(np.radians(up))
    upper = quat_multiply(_turn(0, back, 0), quat_multiply(_turn(0, 0, up), _turn(twist, 0, 0)))
    bend, axis = rng.beta(1, 0.8) * _ELBOW, np.radians(rng.uniform(-_CARRIED, _CARRIED))
    lower = quat_multiply(_turn(0, -bend * np.cos(axis), bend * np.sin(axis)), _turn(rng.uniform(-20, 20), 0, 0))
    return {"UpperArm": upper, "LowerArm": lower}


def _draw_fingers(rng: np.random.Generator) -> dict[str, Array]:
    """Turns of the four fingers: they bend together, more or less, but one may be straight or bent alone."""
    curl, fan, turns = rng.beta(0.7, 0.7), rng.uniform(-0.5, 1), {}
    for finger, wide in _FAN.items():
        own = float(np.clip(curl + 0.22 * rng.normal(), 0, 1.05))
        if rng.random() < 0.12:
            own = float(rng.integers(2))
        knuckle, middle, last = np.array(_CURL) * own * rng.uniform(0.6, 1, 3)
        knuckle -= _BACK * (1 - own)
        spread = wide * fan * (1 - 0.6 * own) + 3 * rng.normal()
        turns[finger + "Proximal"] = quat_multiply(_turn(0, 0, -knuckle), _turn(0, spread, 0))
        turns[finger + "Intermediate"], turns[finger + "Distal"] = _turn(0, 0, -middle), _turn(0, 0, -last)
    return turns
