"""The trunk and the arms as clothes show them: solids in the sculpting pose."""

from __future__ import annotations

import numpy as np

from .sculpture import joint
from .solids import Solid, capsule, column, ellipsoid, union

__all__ = ["leg_solid", "pelvis_solid", "sleeve_solid", "torso_solid"]

# (y, half width, half depth, centre z) of the shirt, metres; ours, inside the gesture engine's volume of a slim adult
TRUNK = (
    (0.86, 0.160, 0.112, -0.010),
    (0.96, 0.155, 0.109, -0.006),
    (1.02, 0.142, 0.102, -0.003),
    (1.08, 0.142, 0.104, -0.002),
    (1.15, 0.144, 0.103, -0.006),
    (1.23, 0.152, 0.107, -0.010),
    (1.31, 0.156, 0.103, -0.016),
    (1.37, 0.132, 0.083, -0.022),
    (1.405, 0.088, 0.066, -0.022),
    (1.435, 0.062, 0.058, -0.019),
    (1.46, 0.054, 0.054, -0.016),
    (1.52, 0.050, 0.051, -0.012),
)


def torso_solid() -> Solid:
    """Ribs, chest and belly, the slope from the neck to the shoulders, collar bones and shoulder blades."""
    parts = [column(TRUNK, 2.25)]
    bones = []
    for sign in (1, -1):
        side = np.array([sign, 1, 1])
        shoulder = joint("leftUpperArm") * side
        parts.append(
            capsule(np.array([0.034, 1.452, -0.036]) * side, shoulder + np.array([-0.020, 0.004, -0.008]) * side, 0.026, 0.030)
        )
        parts.append(
            capsule(np.array([0.030, 1.400, 0.006]) * side, shoulder + np.array([-0.020, -0.006, 0.008]) * side, 0.030, 0.036)
        )
        parts.append(capsule(np.array([0.060, 1.292, 0.030]) * side, np.array([0.090, 1.315, 0.018]) * side, 0.056, 0.050))
        parts.append(capsule(np.array([0.088, 1.335, -0.060]) * side, np.array([0.078, 1.245, -0.054]) * side, 0.048, 0.047))
        bones.append(
            capsule(np.array([0.020, 1.416, 0.034]) * side, shoulder + np.array([-0.018, 0.029, 0.014]) * side, 0.0125, 0.0110)
        )
    return union(0.016, union(0.045, *parts), *bones)


def sleeve_solid(sign: int) -> Solid:
    """The arm in its sleeve: deltoid, upper arm, elbow, forearm; the elbow's axis lies nearer its back, as in people."""
    shoulder, elbow, hand = (joint(n) * [sign, 1, 1] for n in ("leftUpperArm", "leftLowerArm", "leftHand"))
    upper, lower = elbow - shoulder, hand - elbow
    front = np.array([0, 0, 0.006])
    return union(
        0.030,
        ellipsoid(shoulder + 0.10 * upper + [sign * 0.002, 0.002, 0], (0.046, 0.050, 0.046)),
        capsule(shoulder + 0.10 * upper, shoulder + 0.52 * upper, 0.0445, 0.0385),
        capsule(shoulder + 0.45 * upper + front, elbow + front, 0.0385, 0.0345),
        capsule(elbow + front, elbow + 0.30 * lower + 0.5 * front, 0.0345, 0.0375),
        capsule(elbow + 0.28 * lower + 0.5 * front, hand - 0.06 * lower, 0.0370, 0.0290),
    )


PELVIS = (
    (0.80, 0.150, 0.104, -0.008),
    (0.86, 0.160, 0.110, -0.010),
    (0.92, 0.159, 0.109, -0.008),
    (0.98, 0.149, 0.104, -0.004),
    (1.04, 0.143, 0.103, -0.003),
)


def pelvis_solid() -> Solid:
    """Hips and seat in trousers."""
    seat = [capsule([s * 0.056, 0.925, -0.036], [s * 0.062, 0.845, -0.036], 0.072, 0.072) for s in (1, -1)]
    return union(0.03, column(PELVIS, 2.3), *seat)


def leg_solid(sign: int) -> Solid:
    """One trouser leg."""
    hip, knee, ankle = (joint(n) * [sign, 1, 1] for n in ("leftUpperLeg", "leftLowerLeg", "leftFoot"))
    return union(
        0.05,
        capsule(hip + [-sign * 0.005, -0.03, -0.004], knee + [0, 0.02, 0.004], 0.083, 0.063),
        capsule(hip + [-sign * 0.036, -0.10, -0.004], hip + [-sign * 0.022, -0.30, 0], 0.052, 0.056),
        capsule(knee + [0, 0.02, 0.004], ankle + [0, 0.035, -0.002], 0.062, 0.050),
        capsule(knee + [0, -0.09, -0.014], ankle + [0, 0.20, -0.012], 0.054, 0.050),
    )
