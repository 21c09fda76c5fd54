"""Sweater, trousers and shoes: the body as it is seen, sculpted with the arms hanging."""

from __future__ import annotations

import numpy as np

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array
from cospeech.motion.skeleton import humanoid

from .net import Net, frame, ring, smoothstep
from .sculpture import joint, make_part, mirror_part, srgb, weights_of
from .solids import Solid, capsule, column, gradient, land, settle, union

__all__ = ["SWEATER_COLUMN", "clothes", "sleeve_solid", "torso_solid"]

COLUMNS = 32  # points around the torso; ours
ARM = 16  # points around a sleeve, = boundary of the 4 × 4 armhole
LEG = 18  # points around a trouser leg

# (y, half width, half depth, centre z) of the sweater, metres; ours, inside the gesture engine's volume of a slim adult
SWEATER_COLUMN = (
    (0.86, 0.173, 0.121, -0.010),
    (0.92, 0.171, 0.120, -0.008),
    (0.96, 0.164, 0.116, -0.006),
    (1.02, 0.149, 0.106, -0.003),
    (1.08, 0.143, 0.102, -0.002),
    (1.15, 0.146, 0.105, -0.004),
    (1.23, 0.153, 0.111, -0.008),
    (1.31, 0.155, 0.108, -0.014),
    (1.37, 0.138, 0.091, -0.020),
    (1.405, 0.098, 0.075, -0.022),
    (1.435, 0.068, 0.063, -0.020),
    (1.46, 0.057, 0.057, -0.016),
    (1.52, 0.053, 0.054, -0.012),
)


def torso_solid() -> Solid:
    """Chest, belly and shoulders under the sweater."""
    parts = [column(SWEATER_COLUMN, 2.25)]
    for sign in (1, -1):
        neck, shoulder = np.array([sign * 0.032, 1.426, -0.026]), joint("leftUpperArm") * [sign, 1, 1]
        parts.append(capsule(neck, shoulder + [sign * -0.026, -0.012, 0.002], 0.030, 0.041))
        parts.append(capsule([sign * 0.058, 0.905, -0.050], [sign * 0.062, 0.86, -0.046], 0.078, 0.074))
        parts.append(capsule([sign * 0.062, 1.285, 0.028], [sign * 0.085, 1.31, 0.02], 0.058, 0.052))
        parts.append(capsule([sign * 0.085, 1.32, -0.055], [sign * 0.075, 1.24, -0.050], 0.052, 0.050))
    return union(0.055, *parts)


def sleeve_solid(sign: int) -> Solid:
    """The arm in its sleeve, from the shoulder to the wrist."""
    shoulder, elbow, hand = (joint(n) * [sign, 1, 1] for n in ("leftUpperArm", "leftLowerArm", "leftHand"))
    upper, lower = elbow - shoulder, hand - elbow
    return union(
        0.03,
        capsule(shoulder + [-sign * 0.012, -0.016, 0], shoulder + 0.30 * upper, 0.047, 0.0525),
        capsule(shoulder + 0.3 * upper, elbow, 0.051, 0.043),
        capsule(elbow, elbow + 0.35 * lower, 0.043, 0.042),
        capsule(elbow + 0.3 * lower, hand - 0.06 * lower, 0.042, 0.0350),
    )


def _torso_rows(solid: Solid) -> list[Array]:
    """Rings of the trunk from the hem to the neckline."""
    heights = [
        0.925,
        0.955,
        0.99,
        1.03,
        1.075,
        1.12,
        1.165,
        1.210,
        1.252,
        1.292,
        1.322,
        1.350,
        1.376,
        1.400,
        1.420,
        1.436,
        1.446,
    ]
    angle = 2 * np.pi * np.arange(COLUMNS) / COLUMNS
    rows = []
    for y in heights:
        outward = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
        if y == heights[-1]:  # the neckline: a clean ellipse, lower at the throat
            start = np.array([0, 1.447, -0.0165]) + outward * [0.0600, 0, 0.0605]
            rows.append(start - np.array([0, 0.16, 0]) * (start[:, 2:] + 0.0165))
            continue
        start = np.array([0, y, -0.012]) + outward * [0.16, 0, 0.12] * (1.0 if y < 1.39 else 0.62)
        rows.append(settle(solid, start, 10))
    return rows


def sweater() -> Part:
    """A crew-neck sweater: torso tube, two sleeves grown out of armholes, ribbed hem, cuffs and collar."""
    torso = torso_solid()
    arms = [sleeve_solid(1), sleeve_solid(-1)]
    solid = union(0.045, torso, *arms)
    net = Net()
    rows = [net.add(r) for r in _torso_rows(torso)]
    low, high = 9, 13  # the armhole lies between these rows
    holes = []
    for side in (COLUMNS // 4, 3 * COLUMNS // 4):
        cols = [side - 2 + k for k in range(5)]
        loop = [rows[low][c] for c in cols] + [rows[r][cols[-1]] for r in range(low + 1, high)]
        loop += [rows[high][c] for c in reversed(cols)] + [rows[r][cols[0]] for r in range(high - 1, low, -1)]
        holes.append((cols, loop))
    hidden = {rows[r][c] for cols, _ in holes for r in range(low + 1, high) for c in cols[1:-1]}
    net.tube(rows)
    net.faces = [f for f in net.faces if not hidden & set(f)]
    for r in range(low, high):  # cells whose corners all lie on the loop
        for cols, _ in holes:
            for k in (0, 3):
                cell = {rows[r][cols[k]], rows[r][cols[k + 1]], rows[r + 1][cols[k]], rows[r + 1][cols[k + 1]]}
                net.faces = [f for f in net.faces if set(f) != cell]
    labels = {"arm": [], "soft": [i for row in rows[7:] for i in row]}
    tails = []
    for (_, loop), sign, arm in zip(holes, (1, -1), arms, strict=True):
        tails.append(_grow_sleeve(net, loop, sign, arm, labels))
    free = np.zeros(len(net.points), bool)
    free[labels["soft"]] = True
    free[[*rows[-1], *rows[6]]] = False
    net.relax(solid, free, 40)
    shoulder = free & (np.abs(net.points[:, 0]) > 0.085) & (np.abs(net.points[:, 0]) < 0.235) & (net.points[:, 1] > 1.335)
    net.soften(shoulder, 2, 0.45)
    first_edge = len(net.points)
    _finish_edges(net, rows, tails)
    return _dress(net, solid, labels, first_edge)


def _grow_sleeve(net: Net, loop: list[int], sign: int, arm: Solid, labels: dict[str, list[int]]) -> list[int]:
    """Rings of a sleeve from the armhole to the cuff; returns the last ring."""
    shoulder, elbow, hand = (joint(n) * [sign, 1, 1] for n in ("leftUpperArm", "leftLowerArm", "leftHand"))
    upper, lower = elbow - shoulder, hand - elbow
    at = [shoulder + t * upper for t in (0.10, 0.22, 0.34, 0.47, 0.60, 0.72, 0.82, 0.90, 0.965)]
    at += [elbow + t * lower for t in (0.035, 0.10, 0.18, 0.28, 0.40, 0.52, 0.63, 0.73, 0.81, 0.865)]
    previous = loop
    for k, centre in enumerate(at):
        axis = upper / np.linalg.norm(upper) if k < 8 else lower / np.linalg.norm(lower)
        if k in (8, 9):
            axis = upper / np.linalg.norm(upper) + lower / np.linalg.norm(lower)
        # the loop starts at the front lower corner for the left side and at the back lower one for the right
        first, second = frame(axis, (0, 0, 1))
        points = ring(centre, first, second, ARM, (0.08, 0.08), turn=0.0)
        points = land(arm, points, (centre - points) / 0.08)
        ids = _nearest_turn(net, previous, points)
        net.bridge(previous, ids)
        labels["arm"] += ids
        if k < 2:
            labels["soft"] += ids
        previous = ids
    return previous


def _nearest_turn(net: Net, previous: list[int], points: Array) -> list[int]:
    """Add a ring so that its points follow those of ``previous`` with the least twist."""
    turns = [np.roll(way, shift, axis=0) for way in (points, points[::-1]) for shift in range(len(points))]
    costs = [np.sum((turned - net.points[previous]) ** 2) for turned in turns]
    return net.add(turns[int(np.argmin(np.round(costs, 9)))])


def _finish_edges(net: Net, rows: list[list[int]], tails: list[list[int]]) -> None:
    """Rolled hem, collar and cuffs: each edge bulges a little and turns inwards."""

    def add_ring(points: Array, grow: float, lift: Array) -> list[int]:
        centre = points.mean(0)
        return net.add(centre + (points - centre) * grow + lift)

    down = np.array([0, -1.0, 0])
    steps = ((1.010, 0.003), (1.020, 0.016), (1.018, 0.034), (1.0, 0.040), (0.95, 0.037))
    previous = rows[0]
    for grow, drop in steps:
        ids = add_ring(net.points[rows[0]], grow, drop * down)
        net.bridge(ids, previous)
        previous = ids
    collar = net.points[rows[-1]]
    previous = rows[-1]
    for grow, rise in ((1.015, 0.005), (1.005, 0.014), (0.945, 0.019), (0.88, 0.013), (0.79, -0.012)):
        ids = add_ring(collar, grow, -rise * down + [0, 0, 0.15 * rise])
        net.bridge(previous, ids)
        previous = ids
    for tail, sign in zip(tails, (1, -1), strict=True):
        lower = (joint("leftHand") - joint("leftLowerArm")) * [sign, 1, 1]
        lower = lower / np.linalg.norm(lower)
        previous = tail
        for grow, along in ((0.86, 0.008), (0.84, 0.028), (0.80, 0.033), (0.72, 0.032), (0.68, 0.010)):
            ids = add_ring(net.points[tail], grow, along * lower)
            net.bridge(previous, ids)
            previous = ids
        net.cap(previous, net.points[previous].mean(0) - 0.012 * lower)


def spine_weights(y: Array) -> dict[str, Array]:
    """Weights of the spine's joints by height: soft steps around each joint."""
    names = ("hips", "spine", "chest", "upperChest", "neck", "head")
    heights = [joint(n)[1] for n in names]
    above = [np.ones_like(y)]
    for k in range(1, len(names)):
        reach = 0.05 if k < 4 else 0.03
        above.append(smoothstep(heights[k] - reach, heights[k] + reach, y))
    above.append(np.zeros_like(y))
    return {n: above[k] * (1 - above[k + 1]) for k, n in enumerate(names)}


def _dress(net: Net, solid: Solid, labels: dict[str, list[int]], first_edge: int) -> Part:
    """Weights, normals and colour of the sweater."""
    p = net.points
    count = len(p)
    spine = spine_weights(np.minimum(p[:, 1], 1.40))
    weights = weights_of(count, **spine)
    index = humanoid().index
    for sign, side in ((1, "left"), (-1, "right")):
        mine = p[:, 0] * sign > 0
        lift = smoothstep(0.06, 0.14, p[:, 0] * sign) * smoothstep(1.30, 1.38, p[:, 1]) * 0.75
        lift = np.where(mine, lift, 0)
        weights *= (1 - lift)[:, None]
        weights[:, index[side + "Shoulder"]] += lift
    arm = np.zeros(count, bool)
    arm[labels["arm"]] = True
    arm |= np.abs(p[:, 0]) > 0.27
    weights[arm] = 0
    for sign, side in ((1, "left"), (-1, "right")):
        mine = arm & (p[:, 0] * sign > 0)
        weights[mine] = limb_weights(p[mine], side)
    free = (np.abs(p[:, 0]) < 0.26) & (p[:, 1] > 1.17)
    weights = net.diffuse(weights, 18, free)
    colour = np.tile(srgb("5c8f9c"), (count, 1))
    colour[first_edge:] = srgb("4a7885")  # ribbed hem, collar and cuffs
    return make_part("sweater", net, net.shade(solid, 0.0), weights, colour, 0.9, posed=True)


def limb_weights(p: Array, side: str) -> Array:
    """Upper arm → forearm → hand, by the place along the bones; a share of the hand's twist reaches up the forearm."""
    shoulder, elbow, hand = (joint(side + n) for n in ("UpperArm", "LowerArm", "Hand"))
    upper, lower = elbow - shoulder, hand - elbow
    bisector = upper / np.linalg.norm(upper) + lower / np.linalg.norm(lower)
    bisector /= np.linalg.norm(bisector)
    bend = smoothstep(-0.035, 0.035, (p - elbow) @ bisector)
    along = (p - elbow) @ lower / (lower @ lower)
    twist = 0.45 * smoothstep(0.40, 1.0, along) ** 1.3 * bend
    return weights_of(len(p), **{side + "UpperArm": 1 - bend, side + "LowerArm": bend - twist, side + "Hand": twist})


PELVIS = (
    (0.80, 0.150, 0.105, -0.008),
    (0.86, 0.160, 0.113, -0.010),
    (0.92, 0.158, 0.111, -0.008),
    (0.98, 0.145, 0.100, -0.004),
    (1.03, 0.132, 0.090, -0.003),
)


def leg_solid(sign: int) -> Solid:
    """One trouser leg."""
    hip, knee, ankle = (joint(n) * [sign, 1, 1] for n in ("leftUpperLeg", "leftLowerLeg", "leftFoot"))
    return union(
        0.04,
        capsule(hip + [-sign * 0.007, -0.03, -0.004], knee + [0, 0, 0.004], 0.081, 0.061),
        capsule(knee + [0, 0, 0.004], ankle + [0, 0.035, -0.004], 0.060, 0.053),
        capsule(knee + [0, -0.07, -0.012], ankle + [0, 0.20, -0.014], 0.054, 0.052),
    )


def trousers() -> Part:
    """Straight trousers: a pelvis tube that splits into two legs over a strip at the crotch."""
    pelvis = [column(PELVIS, 2.3)]
    pelvis += [capsule([s * 0.058, 0.90, -0.050], [s * 0.062, 0.86, -0.046], 0.068, 0.066) for s in (1, -1)]
    legs = {s: leg_solid(s) for s in (1, -1)}
    solid = union(0.03, *pelvis, *legs.values())
    net = Net()
    count, strip = 28, 3
    angle = 2 * np.pi * np.arange(count) / count
    outward = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
    rows = []
    for y in (1.02, 0.985, 0.95, 0.915, 0.88, 0.845):
        start = np.array([0, y, -0.008]) + outward * [0.19, 0, 0.14]
        rows.append(net.add(land(solid, start, -outward)))
    net.tube(rows[::-1])
    front, back = rows[-1][0], rows[-1][count // 2]
    z = np.linspace(net.points[front][2], net.points[back][2], strip + 2)[1:-1]
    bridge = net.add(np.stack([0 * z, 0 * z + 0.825, z], 1))
    net.points[front, 1] = net.points[back, 1] = 0.84
    half = count // 2
    tops = {1: rows[-1][: half + 1] + bridge[::-1], -1: [*rows[-1][half:], front, *bridge]}
    heights = (0.80, 0.755, 0.70, 0.64, 0.59, 0.55, 0.52, 0.495, 0.47, 0.44, 0.40, 0.35, 0.29, 0.23, 0.18, 0.14, 0.118)
    for sign, top in tops.items():
        previous = top
        for y in heights:
            t = np.clip((0.915 - y) / 0.83, 0, 1)
            centre = np.array([sign * 0.092, y, 0.0 + 0.004 - 0.016 * t])
            points = ring(centre, np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), LEG, (0.12, 0.12))
            points = land(legs[sign], points, (centre - points) / 0.12)
            ids = _nearest_turn(net, previous, points)
            net.bridge(ids, previous)
            previous = ids
        centre = net.points[previous].mean(0)
        for grow, y in ((1.04, 0.092), (1.02, 0.086), (0.93, 0.088), (0.86, 0.105)):
            ids = net.add(centre * [1, 0, 1] + (net.points[previous] - centre) * [grow, 0, grow] + [0, y, 0])
            net.bridge(ids, previous)
            previous = ids
            centre = net.points[previous].mean(0)
    free = (net.points[:, 1] > 0.66) & (net.points[:, 1] < 0.93)
    seam = [*bridge, *(row[k] for row in rows for k in (0, count // 2))]
    free[bridge] = False
    net.points[bridge, 1] = 0.800
    net.relax(solid, free, 30)
    net.points[seam, 0] = 0.0
    return _fit_trousers(net, solid)


def _fit_trousers(net: Net, solid: Solid) -> Part:
    p = net.points
    columns = {"hips": np.ones(len(p))}
    weights = weights_of(len(p), **columns)
    index = humanoid().index
    for sign, side in ((1, "left"), (-1, "right")):
        mine = p[:, 0] * sign > 1e-6
        thigh = smoothstep(0.93, 0.80, p[:, 1] + 0.35 * np.maximum(0, 0.06 - np.abs(p[:, 0])))
        thigh = np.where(mine, thigh, 0)
        shin = smoothstep(0.545, 0.445, p[:, 1]) * mine
        foot = smoothstep(0.12, 0.05, p[:, 1]) * mine * 0.5
        weights[mine] = 0
        weights[:, index["hips"]] += mine * (1 - thigh)
        weights[:, index[side + "UpperLeg"]] += thigh * (1 - shin)
        weights[:, index[side + "LowerLeg"]] += shin * (1 - foot)
        weights[:, index[side + "Foot"]] += foot
    weights = net.diffuse(weights, 5, (p[:, 1] > 0.7) & (p[:, 1] < 0.97))
    return make_part("trousers", net, net.shade(solid, 0.0), weights, srgb("3b4358"), 0.9, posed=True)


def shoes() -> list[Part]:
    """Plain sneakers: an upper and a pale sole, left and right."""
    ankle = joint("leftFoot")
    x = ankle[0]
    upper = union(
        0.03,
        capsule((x - 0.001, 0.046, -0.036), (x, 0.098, -0.016), 0.038, 0.034),
        capsule((x, 0.046, -0.030), (x + 0.006, 0.034, 0.100), 0.039, 0.038, (1.0, 0.95, 1)),
        capsule((x + 0.006, 0.032, 0.100), (x + 0.004, 0.028, 0.140), 0.042, 0.036, (1.04, 0.85, 1)),
    )
    sole = capsule((x, 0.012, -0.036), (x + 0.006, 0.012, 0.138), 0.043, 0.045, (1.0, 1.0, 1.0))
    parts = []
    body, normals = _shell(upper, (x + 0.003, 0.045, 0.045), 18, 11, floor=0.012)
    parts.append(_shoe("shoe", body, normals, srgb("d8d3cb")))
    base, normals = _shell(sole, (x + 0.003, 0.012, 0.05), 22, 6, floor=0.0, roof=0.026)
    parts.append(_shoe("sole", base, normals, srgb("f4f2ee")))
    out = []
    for part in parts:
        out += [_rename(part, "left"), mirror_part(part, "right" + part.name.capitalize())]
    return out


def _rename(part: Part, side: str) -> Part:
    from dataclasses import replace

    return replace(part, name=side + part.name.capitalize())


def _shell(
    solid: Solid, centre: tuple[float, float, float], around: int, rows: int, floor: float, roof: float = 1.0
) -> tuple[Net, Array]:
    """A globe of points dropped onto ``solid`` and flattened at ``floor`` and ``roof``."""
    net = Net()
    middle = np.array(centre)
    elevation = np.linspace(-np.pi / 2, np.pi / 2, rows + 2)[1:-1]
    angle = 2 * np.pi * np.arange(around) / around
    ids = []
    for e in elevation:
        d = np.stack([np.sin(angle) * np.cos(e), np.full(around, np.sin(e)), np.cos(angle) * np.cos(e)], 1)
        away = d * [0.14, 0.14, 0.30]
        ids.append(net.add(land(solid, middle + away, -away / np.linalg.norm(away, axis=1, keepdims=True))))
    net.tube(ids)
    net.cap(ids[-1], middle + [0, 0.2, 0])
    net.cap(ids[0][::-1], middle - [0, 0.2, 0])
    tips = net.points[-2:]
    net.points[-2:] = land(solid, tips, np.array([[0, -1.0, 0], [0, 1, 0]]))
    net.points = settle(solid, net.points, 6)
    normals = gradient(solid, net.points)
    net.points[:, 1] = np.clip(net.points[:, 1], floor, roof)
    normals = np.where((net.points[:, 1:2] <= floor), [0, -1.0, 0], normals)
    normals = np.where((net.points[:, 1:2] >= roof), [0, 1.0, 0], normals)
    return net, normals


def _shoe(name: str, net: Net, normals: Array, colour: Array) -> Part:
    toes = smoothstep(0.09, 0.14, net.points[:, 2])
    weights = weights_of(len(net.points), leftFoot=1 - toes, leftToes=toes)
    return make_part(name, net, normals, weights, colour, 0.6, posed=True)


def clothes() -> list[Part]:
    """All garments."""
    return [sweater(), trousers(), *shoes()]
