"""The shirt: a tube around the trunk with an open front over a white collarless one, and two sleeves rolled up to the forearm.

The columns of the tube follow what is sewn: the placket with its seams in front, which parts above the last closed button, and
a pleat behind. So every seam is a line of the net and keeps its place when the body turns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array

from .body_solids import sleeve_solid, torso_solid
from .garment_weights import MELT, shirt_weights
from .net import Net, frame, ring, smoothstep
from .sculpture import joint, make_part, srgb
from .shirt_details import add_buttons, add_collar, make_pocket
from .solids import Solid, gradient, land, union

__all__ = ["shirt"]

CLOTH, TRIM, SEAM, INNER = srgb("558a99"), srgb("6299a7"), srgb("36606d"), srgb("e4e1da")
ARM = 16  # points around a sleeve, = boundary of the 4 × 4 armhole
SIDE = 13  # columns of a side, from the placket to the pleat; ours: odd, so that one lies under the middle of the arm
PLACKET = (0.0085, 0.0165, 0.0205)  # x of the columns left of the middle of the front, metres: the last two make a seam
PLEAT = (0.0165, 0.0125)  # the same behind
COLUMNS = 2 * (SIDE + len(PLACKET) + len(PLEAT)) + 2
OPEN = 1.331  # height from which the front stands open, metres
HEIGHTS = (
    1.008, 1.030, 1.046, 1.068, 1.098, 1.132, 1.166, 1.200, 1.232, 1.263, 1.294, 1.324, 1.350, 1.377, 1.402, 1.423,
    1.440, 1.447,
)  # fmt: skip
LOW, HIGH = 10, 14  # rows between which an armhole lies
TUCKED = 2  # rows that the belt hides


class _Labels(NamedTuple):
    """Indices of points: of the sleeves, of the rolled cuffs, of the seams around the armholes, of the inner neckline."""

    arm: list[int]
    cuff: list[int]
    seam: list[int]
    neck: list[int]


def _opening(y: float) -> float:
    """Half width of the open front at height ``y``, metres, beyond what the placket takes."""
    return 0.34 * max(0.0, y - OPEN)


def _row(solid: Solid, y: float) -> Array:
    """(COLUMNS, 3) points at one height, from the middle of the front over the left side and the back."""
    neckline = y == HEIGHTS[-1]
    share = np.array([1.86, 2.0, 2.3]) / 2
    front = np.array(PLACKET) + _opening(y if not neckline else 1.405) * share
    middle, reach = np.array([0, y, -0.012]), np.array([0.16, 0, 0.12])
    if neckline:
        middle, reach = np.array([0, 1.449, -0.0165]), np.array([0.0610, 0, 0.0600])
    half = [np.zeros(1), *(np.arcsin(np.clip(v / _half_width(solid, y, neckline), -1, 1)) for v in (front, np.array(PLEAT)))]
    start, stop = half[1][-1] + 0.16, np.pi - half[2][0] - 0.20
    side = np.concatenate([np.linspace(start, np.pi / 2, SIDE // 2 + 1), np.linspace(np.pi / 2, stop, SIDE // 2 + 1)[1:]])
    angle = np.concatenate([half[0], half[1], side, np.pi - half[2], [np.pi]])
    angle = np.concatenate([angle, 2 * np.pi - angle[1:-1][::-1]])
    outward = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
    points = middle + outward * reach
    if neckline:  # lower at the throat
        return points - np.array([0, 0.26, 0]) * (points[:, 2:] + 0.0165)
    x = np.concatenate([[0.0], front])
    first, last, back = len(PLACKET), COLUMNS - len(PLACKET), COLUMNS // 2
    away = np.stack([np.sin(angle) * 0.75, 0 * angle, np.cos(angle)], 1)
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    origin = middle + 0.30 * away
    away[: first + 1] = away[last:] = [0, 0, 1.0]
    origin[: first + 1] = np.stack([x, 0 * x + y, 0 * x + 0.3], 1)
    origin[last:] = np.stack([-x[1:][::-1], 0 * x[1:] + y, 0 * x[1:] + 0.3], 1)
    pleat = slice(back - len(PLEAT), back + len(PLEAT) + 1)
    away[pleat] = [0, 0, -1.0]
    x = np.array([*PLEAT, 0.0, *(-v for v in PLEAT[::-1])])
    origin[pleat] = np.stack([x, 0 * x + y, 0 * x - 0.3], 1)
    points = land(solid, origin, -away)
    fall = 0.26 * smoothstep(1.39, HEIGHTS[-1], np.full(COLUMNS, y)) * (points[:, 2] + 0.0165)
    if y <= OPEN < HEIGHTS[HEIGHTS.index(y) + 1]:  # the inner shirt begins right above the last closed button
        fall[np.r_[0 : len(PLACKET), 1 - len(PLACKET) : 0]] = y - OPEN
    origin[:, 1] -= fall
    return land(solid, origin, -away)


def _half_width(solid: Solid, y: float, neckline: bool) -> float:
    """Half width of the trunk at height ``y``, metres."""
    if neckline:
        return 0.061
    return float(land(solid, np.array([[0.4, y, -0.012]]), np.array([[-1.0, 0, 0]]))[0, 0])


def shirt() -> list[Part]:
    """The shirt with collar and buttons, and its pocket, which is a part of its own because the other side has none."""
    torso = torso_solid()
    arms = [sleeve_solid(1), sleeve_solid(-1)]
    solid = union(0.042, torso, *arms)
    net = Net()
    rows = [net.add(_row(torso, y)) for y in HEIGHTS]
    holes = _armholes(rows)
    hidden = {rows[r][c] for cols, _ in holes for r in range(LOW + 1, HIGH) for c in cols[1:-1]}
    net.tube(rows)
    net.faces = [f for f in net.faces if not hidden & set(f)]
    for r in range(LOW, HIGH):  # cells whose corners all lie on the loop
        for cols, _ in holes:
            for k in (0, 3):
                cell = {rows[r][cols[k]], rows[r][cols[k + 1]], rows[r + 1][cols[k]], rows[r + 1][cols[k + 1]]}
                net.faces = [f for f in net.faces if set(f) != cell]
    labels = _Labels([], [], [i for _, loop in holes for i in loop], [*rows[-1]])
    soft = [i for row in rows[7:-1] for i in row]
    tails = []
    for (_, loop), sign, arm in zip(holes, (1, -1), arms, strict=True):
        tails.append(_grow_sleeve(net, loop, sign, arm, labels, soft))
    free = np.zeros(len(net.points), bool)
    free[soft] = True
    sewn = len(PLACKET) + 1
    behind = range(COLUMNS // 2 - len(PLEAT), COLUMNS // 2 + len(PLEAT) + 1)
    free[[i for row in rows for i in (*row[:sewn], *row[1 - sewn :], *(row[c] for c in behind))]] = False
    net.relax(solid, free, 40)
    shoulder = free & (np.abs(net.points[:, 0]) > 0.085) & (np.abs(net.points[:, 0]) < 0.235) & (net.points[:, 1] > 1.335)
    net.soften(shoulder, 3, 0.4)
    _fold(net, solid)
    _raise_placket(net, solid, rows)
    _finish_edges(net, rows, tails, labels)
    return _dress(net, solid, rows, labels)


def _armholes(rows: list[list[int]]) -> list[tuple[list[int], list[int]]]:
    """The five columns and the 16 points around each armhole, left and right."""
    holes = []
    first = len(PLACKET) + 1 + SIDE // 2
    for side in (first, COLUMNS - first):
        cols = [side - 2 + k for k in range(5)]
        loop = [rows[LOW][c] for c in cols] + [rows[r][cols[-1]] for r in range(LOW + 1, HIGH)]
        loop += [rows[HIGH][c] for c in reversed(cols)] + [rows[r][cols[0]] for r in range(HIGH - 1, LOW, -1)]
        holes.append((cols, loop))
    return holes


def _grow_sleeve(net: Net, loop: list[int], sign: int, arm: Solid, labels: _Labels, soft: list[int]) -> list[int]:
    """Rings of a sleeve from the armhole to the rolled cuff; returns the last ring."""
    shoulder, elbow, hand = (joint(n) * [sign, 1, 1] for n in ("leftUpperArm", "leftLowerArm", "leftHand"))
    upper, lower = elbow - shoulder, hand - elbow
    at = [shoulder + t * upper for t in (0.06, 0.14, 0.24, 0.35, 0.46, 0.56, 0.65, 0.73, 0.80, 0.865, 0.93)]
    at += [elbow + t * lower for t in (0.0, 0.07, 0.14, 0.21, 0.28, 0.345, 0.40)]
    previous = loop
    for k, centre in enumerate(at):
        axis = upper / np.linalg.norm(upper) if k < 10 else lower / np.linalg.norm(lower)
        if 10 <= k <= 12:
            axis = upper / np.linalg.norm(upper) * (13 - k) / 4 + lower / np.linalg.norm(lower) * (k - 9) / 4
        first, second = frame(axis, (0, 0, 1))
        points = ring(centre, first, second, ARM, (0.08, 0.08))
        points = land(arm, points, (centre - points) / 0.08)
        ids = net.add_following(previous, points)
        net.bridge(previous, ids)
        labels.arm.extend(ids)
        if k < 2:
            soft += ids
        previous = ids
    return previous


def _depth_of_folds(p: Array) -> Array:
    """How far the cloth stands off (+) or falls in (−) at points (V, 3), metres: ours, where such a shirt creases."""
    x, y, z = np.abs(p[:, 0]), p[:, 1], p[:, 2]
    around = np.arctan2(x / 0.145, (z + 0.01) / 0.105)
    trunk = smoothstep(0.20, 0.155, x) * smoothstep(1.40, 1.36, y) * smoothstep(0.15, 0.35, around)
    waist = np.exp(-(((y - 1.062) / 0.050) ** 2))
    depth = 0.0060 * waist * np.sin(9.0 * around + 26.0 * (y - 1.06)) + 0.0070 * np.exp(-(((y - 1.054) / 0.020) ** 2))
    # from under the arm across the ribs, and from the shoulder blade down
    pull = np.exp(-(((y - 1.235 - 0.42 * (x - 0.13)) / 0.060) ** 2)) * smoothstep(0.5, 1.1, around)
    depth += 0.0048 * pull * np.sin(105.0 * (y - 1.235 - 0.55 * (x - 0.10)))
    depth *= trunk
    # over the collar bones, and in the hollow under them
    bone = smoothstep(0.035, 0.070, x) * smoothstep(0.150, 0.105, x) * smoothstep(0.0, 0.02, z)
    depth += bone * (0.0045 * np.exp(-(((y - 1.404) / 0.011) ** 2)) - 0.0060 * np.exp(-(((y - 1.376) / 0.013) ** 2)))
    depth -= 0.012 * smoothstep(1.038, 1.022, y) * (x < 0.2)  # under the belt
    shoulder, elbow, hand = (joint(n) for n in ("leftUpperArm", "leftLowerArm", "leftHand"))
    mine = np.stack([x, y, z], 1)
    upper, lower = elbow - shoulder, hand - elbow
    u, v = ((mine - a) @ b / (b @ b) for a, b in ((shoulder, upper), (elbow, lower)))
    along = np.where(v > 0, 0.280 + 0.255 * v, np.minimum(0.280 * u, 0.280))  # metres from the shoulder joint
    turn = np.arctan2(z - (shoulder[2] + 0.02), y - (shoulder[1] - 0.9 * (x - shoulder[0])))
    sleeve = smoothstep(0.215, 0.255, x)
    near_elbow = np.exp(-(((along - 0.275) / 0.060) ** 2))
    depth += 0.0042 * sleeve * near_elbow * np.sin(150.0 * (along - 0.275) + 1.1 * np.sin(turn) + 0.6)
    depth += 0.0030 * sleeve * np.exp(-(((along - 0.13) / 0.05) ** 2)) * np.sin(95.0 * along + 1.6 * np.cos(turn))
    return depth


def _fold(net: Net, solid: Solid) -> None:
    """Lay the cloth in folds."""
    net.points = net.points + _depth_of_folds(net.points)[:, None] * gradient(solid, net.points)


def _raise_placket(net: Net, solid: Solid, rows: list[list[int]]) -> None:
    """The placket lies on the shirt; where the front is open its edge stands up and the inner shirt lies lower."""
    inner = len(PLACKET) - 1
    for y, row in zip(HEIGHTS[:-1], rows[:-1], strict=True):
        lift = np.zeros(COLUMNS)
        edge = [inner, -inner]
        if y <= OPEN:
            lift[: inner + 1] = lift[-inner:] = 0.0026 * (y > 1.04)
        else:
            lift[:inner] = -0.0030
            lift[COLUMNS - inner + 1 :] = -0.0030
            lift[edge] = 0.0040
            lift[[inner + 1, -inner - 1]] = 0.0046
        net.points[row] += lift[:, None] * gradient(solid, net.points[row])


def _finish_edges(net: Net, rows: list[list[int]], tails: list[list[int]], labels: _Labels) -> None:
    """The neckline of the inner shirt, and cuffs rolled up twice."""

    def add_ring(points: Array, grow: float, lift: Array) -> list[int]:
        centre = points.mean(0)
        return net.add(centre + (points - centre) * grow + lift)

    collar, up = net.points[rows[-1]], np.array([0, 1.0, 0.15])
    previous = rows[-1]
    for grow, rise in ((0.995, 0.005), (0.955, 0.009), (0.90, 0.006), (0.80, -0.014)):
        ids = add_ring(collar, grow, rise * up)
        net.bridge(previous, ids)
        labels.neck.extend(ids)
        previous = ids
    for tail, sign in zip(tails, (1, -1), strict=True):
        lower = (joint("leftHand") - joint("leftLowerArm")) * [sign, 1, 1]
        lower = lower / np.linalg.norm(lower)
        previous = tail
        for grow, along in ((1.08, 0.002), (1.13, 0.010), (1.10, 0.033), (1.0, 0.037), (0.86, 0.033), (0.80, 0.010)):
            ids = add_ring(net.points[tail], grow, along * lower)
            net.bridge(previous, ids)
            labels.arm.extend(ids)
            labels.cuff.extend(ids)
            previous = ids
        net.cap(previous, net.points[previous].mean(0) - 0.012 * lower)
        labels.arm.append(len(net.points) - 1)


def _paint(net: Net, rows: list[list[int]], labels: _Labels) -> Array:
    """Colours (V, 3): cloth, darker in folds and seams, lighter trimming, and the white of the inner shirt."""
    p = net.points
    depth = _depth_of_folds(p)
    colour = CLOTH * np.clip(1 + 42.0 * np.minimum(depth, 0.0012), 0.78, 1.05)[:, None]
    inner = len(PLACKET) - 1
    for y, row in zip(HEIGHTS, rows, strict=True):
        closed = y <= OPEN
        colour[[row[0], *row[1:inner], *row[COLUMNS - inner + 1 :]]] = TRIM if closed else INNER
        colour[[row[inner], row[-inner]]] = TRIM if closed else TRIM * 0.9
        colour[[row[inner + 1], row[-inner - 1]]] = SEAM if closed else TRIM
        if TUCKED <= HEIGHTS.index(y) < HIGH:
            behind = COLUMNS // 2
            colour[[row[behind - 2], row[behind + 2]]] = SEAM
            colour[[row[behind - 1], row[behind], row[behind + 1]]] = TRIM
    first, last = len(PLACKET) + 4 + SIDE // 2, COLUMNS - len(PLACKET) - 3 - SIDE // 2
    colour[rows[HIGH - 1][first:last]] = SEAM  # the yoke's seam
    colour[labels.seam] = 0.55 * CLOTH + 0.45 * SEAM
    colour[labels.cuff] = TRIM
    return colour


def _dress(net: Net, solid: Solid, rows: list[list[int]], labels: _Labels) -> list[Part]:
    """Weights, normals and colour of the shirt and what is sewn to it."""
    p = net.points
    arm = np.zeros(len(p), bool)
    arm[labels.arm] = True
    weights = net.spread(shirt_weights(p, arm), MELT, np.ones(len(p), bool))
    colour = _paint(net, rows, labels)
    colour[labels.neck] = 0.86 * INNER
    pocket = make_pocket(net, solid, weights)
    for add in (add_collar, add_buttons):
        weights, colour = add(net, solid, weights, colour)
    return [make_part("shirt", net, net.shade(solid, 0.0), weights, colour, 0.9, is_posed=True), pocket]
