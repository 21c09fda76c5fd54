"""How much room the body takes, measured from the mesh: for keeping hands out of it."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cospeech.export.mannequin.character import Character, skin
from cospeech.motion.rotations import Array, axis_angle_to_quat, quat_identity

__all__ = ["BodyVolume", "Ellipsoid", "Section", "body_volume"]

LEVELS = {  # heights in the T-pose, metres; ours: where a hand may meet the body
    "hips": 0.95,
    "waist": 1.06,
    "belly": 1.14,
    "chest": 1.22,
    "upperChest": 1.33,
    "shoulders": 1.40,
    "neck": 1.49,
}

_ARM = 0.5  # ours: what follows the upper arm more than this is sleeve
_HANGING = np.radians(70)  # ours: the T-pose stretches the armpits, so the trunk is measured with the arms down


class Section(NamedTuple):
    """An ellipse around the upright axis: height, half width in x, half depth in z, centre in z; metres."""

    y: float
    half_width: float
    half_depth: float
    centre_z: float


class Ellipsoid(NamedTuple):
    """Centre relative to a joint, and radii along x, y, z; metres."""

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]


class BodyVolume(NamedTuple):
    """Sections of trunk and neck by name, lowest first, and the head with its hair about the head joint."""

    sections: dict[str, Section]
    head: Ellipsoid


def _section(points: Array, triangles: Array, y: float) -> Section:
    """Extent of the cut through the mesh at height ``y``."""
    cuts = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        p, q = points[triangles[:, a]], points[triangles[:, b]]
        cross = (p[:, 1] > y) != (q[:, 1] > y)
        t = (y - p[cross, 1]) / (q[cross, 1] - p[cross, 1])
        cuts.append(p[cross] + t[:, None] * (q - p)[cross])
    cut = np.concatenate(cuts)
    low, high = cut.min(0), cut.max(0)
    return Section(y, float((high - low)[0] / 2), float((high - low)[2] / 2), float((high + low)[2] / 2))


def _triple(v: Array) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])


@lru_cache(2)
def body_volume(character: Character) -> BodyVolume:
    """Sections of the trunk (clothes included; without what follows the upper arms) and the head as an ellipsoid."""
    index = character.skeleton.index
    arms = [index[side + n] for side in ("left", "right") for n in ("UpperArm", "LowerArm", "Hand")]
    local = quat_identity(len(index))
    for side, sign in (("left", -1), ("right", 1)):
        local[index[side + "UpperArm"]] = axis_angle_to_quat([0, 0, 1], sign * _HANGING)
    positions, world = character.skeleton.forward(local, character.skeleton.offsets[0])
    vertices = dict(zip((p.name for p in character.parts), skin(character, world, positions), strict=True))
    meshes = []
    for name in ("shirt", "trousers", "face"):
        part = character[name]
        arm = np.where(np.isin(part.joints, arms), part.weights, 0).sum(1)
        meshes.append((vertices[name], part.triangles[(arm[part.triangles] < _ARM).all(1)]))
    sections = {}
    for name, y in LEVELS.items():
        cuts = [_section(p, t, y) for p, t in meshes if np.any((p[t][:, :, 1] > y).any(1) & (p[t][:, :, 1] < y).any(1))]
        sections[name] = max(cuts, key=lambda s: s.half_width)
    joint = character.skeleton.tpose[index["head"]]
    head = np.concatenate([character[n].vertices for n in ("face", "hair", "ears")]) - joint
    head = head[head[:, 1] > -0.03]
    low, high = head.min(0), head.max(0)
    centre, radii = (low + high) / 2, (high - low) / 2
    return BodyVolume(sections, Ellipsoid(_triple(centre), _triple(radii)))
