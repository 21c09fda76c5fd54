"""Trousers with a belt."""

from __future__ import annotations

import numpy as np

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array
from cospeech.motion.skeleton import humanoid

from .body_solids import leg_solid, pelvis_solid
from .garment_weights import spine_weights
from .net import Net, ring, smoothstep
from .sculpture import make_part, srgb, weights_of
from .solids import Solid, land, union

__all__ = ["trousers"]

LEG = 18  # points around a trouser leg
HIP = (1.00, 0.70)  # heights between which the trousers pass from the pelvis to a thigh, metres; ours: the least stretch
MELT = 0.14  # metres over which the weights flow into one another; ours: the least stretch
WAIST = 0.990  # metres: what lies higher follows the pelvis and the spine as the shirt does; ours
KNEE = 0.14  # metres above and below the knee over which a leg bends; ours
LEATHER, BRASS, CLOTH = srgb("4f3426"), srgb("b9a27a"), srgb("2f3648")
BELT = ((1.034, -0.012), (1.032, 0.0062), (1.003, 0.0062), (1.000, 0.0045))  # height, stands off; metres
BUCKLE = ((0.0, 0.0), (0.002, 0.0), (0.007, 1.0), (0.013, 1.0), (0.014, 0.3))  # ours: from its border inwards, stands off


def trousers() -> Part:
    """Straight trousers: a pelvis tube that splits into two legs over a strip at the crotch."""
    legs = {sign: leg_solid(sign) for sign in (1, -1)}
    solid = union(0.03, pelvis_solid(), *legs.values())
    net = Net()
    count, strip = 28, 3
    angle = 2 * np.pi * np.arange(count) / count
    outward = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
    rows = []
    for y, out in (*BELT, (0.999, 0.0), (0.98, 0.0), (0.95, 0.0), (0.915, 0.0), (0.88, 0.0), (0.845, 0.0)):
        start = np.array([0, y, -0.008]) + outward * [0.19, 0, 0.14]
        rows.append(net.add(land(solid, start, -outward) + out * outward))
    net.tube(rows[::-1])
    front, back = rows[-1][0], rows[-1][count // 2]
    z = np.linspace(net.points[front][2], net.points[back][2], strip + 2)[1:-1]
    bridge = net.add(np.stack([0 * z, 0 * z + 0.825, z], 1))
    net.points[front, 1] = net.points[back, 1] = 0.84
    half = count // 2
    tops = {1: rows[-1][: half + 1] + bridge[::-1], -1: [*rows[-1][half:], front, *bridge]}
    heights = (0.792, 0.750, 0.70, 0.64, 0.585, 0.545, 0.515, 0.485, 0.455, 0.42, 0.37, 0.31, 0.24, 0.18, 0.118)
    for sign, top in tops.items():
        previous = top
        for y in heights:
            t = np.clip((0.915 - y) / 0.83, 0, 1)
            centre = np.array([sign * 0.092, y, 0.0 + 0.004 - 0.016 * t])
            points = ring(centre, np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), LEG, (0.12, 0.12))
            points = land(legs[sign], points, (centre - points) / 0.12)
            ids = net.add_following(previous, points)
            net.bridge(ids, previous)
            previous = ids
        centre = net.points[previous].mean(0)
        for grow, y in ((1.04, 0.092), (1.02, 0.086), (0.93, 0.088), (0.86, 0.105)):
            ids = net.add(centre * [1, 0, 1] + (net.points[previous] - centre) * [grow, 0, grow] + [0, y, 0])
            net.bridge(ids, previous)
            previous = ids
            centre = net.points[previous].mean(0)
    free = (net.points[:, 1] > 0.77) & (net.points[:, 1] < 0.93)
    seam = [*bridge, *(row[k] for row in rows for k in (0, count // 2))]
    free[bridge] = False
    net.points[bridge, 1] = 0.800
    net.relax(solid, free, 30)
    net.points[seam, 0] = 0.0
    return _fit_trousers(net, solid)


def _fit_trousers(net: Net, solid: Solid) -> Part:
    """Weights, normals and colours, and a buckle on the belt."""
    p = net.points
    weights = weights_of(len(p), **spine_weights(p[:, 1]))
    index = humanoid().index
    for sign, side in ((1, "left"), (-1, "right")):
        mine = p[:, 0] * sign > 1e-6
        thigh = smoothstep(*HIP, p[:, 1]) * mine
        shin = smoothstep(0.495 + KNEE, 0.495 - KNEE, p[:, 1]) * mine
        foot = smoothstep(0.12, 0.05, p[:, 1]) * mine * 0.5
        weights *= (1 - thigh)[:, None]
        weights[:, index[side + "UpperLeg"]] += thigh * (1 - shin)
        weights[:, index[side + "LowerLeg"]] += thigh * shin * (1 - foot)
        weights[:, index[side + "Foot"]] += thigh * shin * foot
    weights = net.spread(weights, MELT, p[:, 1] < WAIST)  # the belt stays on the shirt
    colour = np.tile(CLOTH, (len(p), 1))
    colour[p[:, 1] > 0.9995] = LEATHER
    first = len(p)
    ink = _add_buckle(net, solid)
    weights = np.concatenate([weights, weights_of(len(ink), **spine_weights(net.points[first:, 1]))])
    return make_part("trousers", net, net.shade(solid, 0.0), weights, np.concatenate([colour, ink]), 0.8, is_posed=True)


def _add_buckle(net: Net, solid: Solid) -> Array:
    """A frame of brass around the belt's end; returns the colours of its points."""
    rows, colours = [], []
    square = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)], float)
    for inset, stand in BUCKLE:
        x, y = (square * [0.0225 - inset, 0.0195 - inset]).T
        start = np.stack([x, 1.0165 + y, 0 * x + 0.3], 1)
        points = land(solid, start, np.tile([0, 0, -1.0], (8, 1)))
        points[:, 2] += 0.0064 + 0.0045 * stand
        rows.append(net.add(points))
        colours.append(np.tile(LEATHER if inset >= 0.014 else BRASS, (8, 1)))
    net.tube(rows)
    net.cap(rows[-1], net.points[rows[-1]].mean(0))
    return np.concatenate([*colours, LEATHER[None]])
