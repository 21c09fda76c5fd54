"""The head: its solid, and a net with rings around the eyes and the mouth.

Metres, in the frame of the head joint of the T-pose (y up, z to the front, x to the left). Feature rings are placed in the
frontal plane and dropped onto the solid; the rest is filled with points whose spacing follows the detail, joined by the convex
hull of their directions from the middle of the head (a Delaunay triangulation on the sphere).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from cospeech.motion.rotations import Array

from .net import Net, smoothstep
from .solids import Solid, capsule, cut, ellipsoid, gradient, land, union

__all__ = ["EYE", "EYE_RADIUS", "LIP_POINTS", "EyeRings", "Head", "MouthRings", "head_net", "head_solid", "mouth_line"]

EYE = np.array([0.031, 0.082, 0.072])  # the humanoid's left eye joint
EYE_RADIUS = 0.0160  # ours: a third larger than life reads at arm's length
LID = 0.0015  # thickness of the lids at their edge
MIDDLE = np.array([0.0, 0.075, 0.0])  # from which every point of the head is seen
NOSTRIL = np.array([0.0066, 0.0420, 0.0992])
BOTTOM = -0.105  # where the neck ends inside the collar

LIP_POINTS = 28  # around the mouth: two corners, 13 above, 13 below
LID_POINTS = 22  # around an eye: two corners, 10 above, 10 below
MOUTH = np.array([0.0, 0.0165])  # middle of the closed mouth in the frontal plane
MOUTH_HALF = 0.0235


def head_solid(lids: bool = True) -> Solid:
    """Skull, face, nose, ears' seat and neck, with sockets and lids."""
    both = (1, -1)
    skull = union(0.03, *(ellipsoid((s * 0.019, 0.110, -0.012), (0.0550, 0.0815, 0.0920)) for s in both))
    forehead = ellipsoid((0, 0.110, 0.030), (0.058, 0.050, 0.062))
    face = ellipsoid((0, 0.053, 0.028), (0.0565, 0.078, 0.062))
    jaw = [capsule((s * 0.0385, 0.020, 0.016), (s * 0.009, -0.012, 0.070), 0.0150, 0.0140) for s in both]
    cheeks = [ellipsoid((s * 0.040, 0.048, 0.056), (0.020, 0.020, 0.022)) for s in both]
    cheeks += [ellipsoid((s * 0.0345, 0.022, 0.050), (0.019, 0.024, 0.022)) for s in both]
    muzzle = ellipsoid((0, 0.020, 0.070), (0.030, 0.028, 0.0265))
    chin = ellipsoid((0, -0.0105, 0.0765), (0.0185, 0.0130, 0.0150))
    neck = capsule((0, -0.16, -0.012), (0, 0.030, -0.016), 0.0480, 0.0432, (1, 1, 1.06))
    mass = union(0.030, skull, face, forehead, *cheeks)
    mass = union(0.024, mass, *jaw, chin, muzzle)
    mass = union(0.030, mass, neck)
    brows = [capsule((s * 0.010, 0.1005, 0.0790), (s * 0.040, 0.1035, 0.0640), 0.0095, 0.0085) for s in both]
    mass = union(0.018, mass, *brows)
    sockets = [ellipsoid((s * 0.032, 0.083, 0.0985), (0.0185, 0.0125, 0.0165)) for s in both]
    mass = cut(0.014, mass, *sockets)
    bridge = capsule((0, 0.096, 0.0800), (0, 0.054, 0.1035), 0.0072, 0.0082)
    tip = ellipsoid((0, 0.0486, 0.1062), (0.0088, 0.0086, 0.0096))
    wings = [ellipsoid((s * 0.0110, 0.0486, 0.0950), (0.0064, 0.0064, 0.0088)) for s in both]
    mass = union(0.014, mass, union(0.010, bridge, tip, *wings))
    philtrum = capsule((0, 0.034, 0.1035), (0, 0.026, 0.1035), 0.0032, 0.0034)
    mass = cut(0.008, mass, philtrum)
    if lids:
        mass = union(0.006, mass, *(ellipsoid(EYE * [s, 1, 1], np.full(3, EYE_RADIUS + LID)) for s in both))
    return mass


def mouth_line(s: Array) -> Array:
    """Height of the closed mouth over s = −1 … 1 from corner to corner: a soft bow."""
    return MOUTH[1] + 0.0011 * s**4 + 0.0010 * np.abs(s) ** 1.5 * (1 - s**2) * 1.4 - 0.0004 * s**2 + 0.0006 * s**4


def _lip_height(s: Array, upper: Array) -> Array:
    round_ = np.maximum(1 - s**2, 0)
    bow = 0.0075 * round_**0.80 - 0.0011 * np.exp(-((s / 0.13) ** 2)) + 0.0004 * np.exp(-(((np.abs(s) - 0.27) / 0.14) ** 2))
    return np.where(upper, np.maximum(bow, 0), 0.0086 * round_**0.62)


@dataclass(frozen=True)
class MouthRings:
    """Rings of the mouth from inside outwards: indices (R, 28), place along the lip s (28,), upper (28,) bool, and q per ring.

    q is 0 at the line where the lips meet, 1 at the border of the red, negative inside, > 1 on the skin around.
    """

    ids: Array
    s: Array
    upper: Array
    q: tuple[float, ...]


@dataclass(frozen=True)
class EyeRings:
    """Rings of one eye from under the lid outwards: indices (R, 22), s = −1 inner … 1 outer corner, upper."""

    ids: Array
    s: Array
    upper: Array


@dataclass(frozen=True)
class Head:
    """The head's net and what the sculptor of expressions needs to know about it."""

    net: Net
    solid: Solid
    mouth: MouthRings
    eyes: dict[str, EyeRings]


def _loop(count: int) -> tuple[Array, Array]:
    """s and upper for a loop that starts at the right-hand (−x) corner and runs over the top."""
    half = count // 2
    angle = np.pi * np.arange(half + 1) / half
    s = -np.cos(angle)
    s = 0.72 * s + 0.28 * (2 * np.arange(half + 1) / half - 1)
    return np.concatenate([s[:-1], s[1:][::-1]]), np.arange(count) < half


LIP_RINGS = (-4.0, -3.0, -2.0, -1.0, 0.0, 0.32, 0.68, 1.0, 1.3, 1.9, 2.8)


def _mouth(net: Net, solid: Solid) -> MouthRings:
    s, upper = _loop(LIP_POINTS)
    sign = np.where(upper, 1.0, -1.0)
    sign[[0, LIP_POINTS // 2]] = 0.0
    height, line = _lip_height(s, upper), mouth_line(s)
    ids = []
    for q in LIP_RINGS:
        red = np.clip(q, 0, 1)
        out = np.maximum(q - 1, 0) * 0.0068
        x = s * (MOUTH_HALF + 0.0012 * red + out * 1.05) * 1.0
        y = line + sign * (height * red + out * (0.55 + 0.45 * np.sqrt(np.maximum(1 - s**2, 0))))
        front = land(solid, np.stack([x, y, np.full(len(x), 0.2)], 1), np.tile([0, 0, -1.0], (len(x), 1)))
        full = np.sqrt(np.maximum(1 - s**2, 0))
        profile = np.interp(q, (-4, 0, 0.32, 0.68, 1.0, 1.3, 1.9), (-1.0, -1.0, 1.5, 1.9, 0.35, 0.0, 0.0)) * 1e-3
        swell = profile * np.where(upper, 1.0, 1.18) * (0.30 + 0.70 * full if q <= 0 else full)
        front[:, 2] += swell
        if q < 0:
            deep = np.interp(-q, (0, 1, 2, 3, 4), (0, 0.0035, 0.009, 0.020, 0.036))
            tall = np.interp(-q, (0, 1, 2, 3, 4), (0.0, 0.0012, 0.0075, 0.0125, 0.010))
            front[:, 2] -= deep * (1.0 if q > -2 else 0.75 + 0.25 * full)
            front[:, 1] += sign * tall * (0.25 + 0.75 * full)
            front[:, 0] *= np.interp(-q, (0, 1, 2, 3, 4), (1.0, 0.985, 0.95, 0.85, 0.60))
        ids.append(net.add(front))
    net.tube(ids)
    end = net.points[ids[0]].mean(0) - [0, 0, 0.004]
    net.cap(ids[0][::-1], end)
    return MouthRings(np.array(ids), s, upper, LIP_RINGS)


# rings of an eye: distance from the edge of the lid in metres, and how the ring is placed
LID_RINGS = (-0.0022, 0.0, 0.0004, 0.0013, 0.0030, 0.0058, 0.0092)


def eye_opening(s: Array, upper: Array) -> tuple[Array, Array]:
    """The edge of the lids in the frontal plane, from the eye's centre; s = −1 at the nose."""
    round_ = np.maximum(1 - s**2, 0)
    x = 0.0150 * s
    middle = -0.0012 + 0.0016 * (s + 1) / 2
    top = 0.0072 * round_**0.60 * (1 - 0.10 * s)
    low = -0.0067 * round_**0.72 * (1 + 0.12 * s)
    return x, middle + np.where(upper, top, low)


def on_ball(x: Array, y: Array, radius: Array | float) -> Array:
    """Depth of a ball's front over the frontal plane, flattening out near its rim instead of falling off."""
    inside = np.maximum(1 - (x**2 + y**2) / np.square(radius), 0.05)
    return radius * np.sqrt(inside)


def _eye(net: Net, solid: Solid, sign: int) -> EyeRings:
    s, upper = _loop(LID_POINTS)
    x, y = eye_opening(s, upper)
    outward = np.stack([x / 0.0150, np.where(upper, 1, -1) * np.sqrt(np.maximum(1 - s**2, 0))], 1)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    ids = []
    for k, gap in enumerate(LID_RINGS):
        if k == 0:
            gap = 0.0022
        stretch = np.where(upper, 1.0, 0.82) * (1 if k < 5 else 1.0)
        px = x + outward[:, 0] * gap * (0.9 if k > 3 else 1.0)
        py = y + outward[:, 1] * gap * stretch * (1.18 if k > 4 else 1.0)
        if k < 2:
            pz = EYE[2] + on_ball(px, py, EYE_RADIUS + 0.0004)
        elif k < 4:
            pz = EYE[2] + on_ball(px, py, EYE_RADIUS + LID)
        else:
            start = np.stack([EYE[0] + px, EYE[1] + py, np.full(len(px), 0.2)], 1)
            pz = land(solid, start, np.tile([0, 0, -1.0], (len(px), 1)))[:, 2]
            if k == 5:  # the crease above the lid
                pz = pz - 0.0016 * upper * (1 - s**2)
        points = np.stack([EYE[0] + px, EYE[1] + py, pz], 1) * [sign, 1, 1]
        ids.append(net.add(points))
    rows = [r if sign > 0 else r[::-1] for r in ids]
    net.tube(rows)
    net.cap(rows[0][::-1], (EYE - [0, 0, 0.004]) * [sign, 1, 1])
    return EyeRings(np.array(ids), s, upper)


def _spacing(p: Array) -> Array:
    """Wanted distance between points: fine at the nose, mouth and lids, coarse under the hair and on the neck."""
    front = smoothstep(0.02, 0.06, p[:, 2])
    base = 0.019 - 0.0095 * front
    nose = np.exp(-((p[:, 0] / 0.020) ** 2) - ((p[:, 1] - 0.052) / 0.020) ** 2) * (p[:, 2] > 0.07)
    mouth = np.exp(-((p[:, 0] / 0.040) ** 2) - ((p[:, 1] - 0.015) / 0.028) ** 2) * (p[:, 2] > 0.03)
    jaw = np.exp(-(((p[:, 1] + 0.004) / 0.034) ** 2)) * (p[:, 2] > -0.035)
    base = np.minimum(base, 0.019 - 0.0100 * jaw)
    eyes = np.exp(-(((np.abs(p[:, 0]) - 0.031) / 0.028) ** 2) - ((p[:, 1] - 0.085) / 0.026) ** 2) * (p[:, 2] > 0.03)
    return base * (1 - 0.62 * nose) * (1 - 0.30 * mouth) * (1 - 0.28 * eyes)


def _fill(solid: Solid, rim: Array, bounds: list[Array]) -> tuple[Array, Array]:
    """Points of the midline and of the left half that fill the head between the feature rings."""
    elevation = np.linspace(-1.30, np.pi / 2, 320)
    line = []
    for back in (0, 1):
        d = np.stack([0 * elevation, np.sin(elevation), np.cos(elevation) * (1 - 2 * back)], 1)
        line.append(land(solid, MIDDLE + 0.25 * d, -d))
    rng = np.random.default_rng(7)
    d = rng.normal(size=(16000, 3))
    d[: len(d) * 6 // 10, 2] = np.abs(d[: len(d) * 6 // 10, 2]) * 1.5
    d[:, 0] = np.abs(d[:, 0])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    cloud = land(solid, MIDDLE + 0.25 * d, -d)
    midline: list[Array] = []
    filling = list(_nostril(solid))
    points = np.full((len(rim) + len(filling) + 2 * len(elevation) + len(cloud), 3), np.inf)
    count = len(rim) + len(filling)
    points[:count] = [*rim, *filling]

    def choose(p: Array, reach: float) -> bool:
        """Take a point if no point chosen before is within ``reach``."""
        nonlocal count
        off = points[:count] - p
        if np.einsum("na,na->n", off, off).min() <= reach**2:
            return False
        points[count] = p
        count += 1
        return True

    ridge = np.concatenate(line)
    for p in ridge[(ridge[:, 1] >= BOTTOM + 0.012) & ~_inside(ridge, bounds)]:
        if choose(p, 0.9 * _spacing(p[None])[0]):
            midline.append(p)
    reach = _spacing(cloud)
    good = (cloud[:, 1] >= BOTTOM + 0.6 * reach) & (cloud[:, 0] >= 0.62 * reach) & ~_inside(cloud, bounds)
    for p, r in zip(cloud[good], reach[good], strict=True):
        if choose(p, r):
            filling.append(p)
    return np.array(midline), np.array(filling)


def _nostril(solid: Solid) -> Array:
    """Points in and around the left nostril, so that it can be dark."""
    turn = 2 * np.pi * np.arange(6) / 6
    rim = NOSTRIL + 0.0029 * np.stack([np.cos(turn), 0 * turn, 1.25 * np.sin(turn)], 1)
    d = np.concatenate([[NOSTRIL], rim]) - MIDDLE
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return land(solid, MIDDLE + 0.25 * d, -d)


def _inside(p: Array, bounds: list[Array]) -> Array:
    """(N,) which front points (N, 3) lie inside one of the closed outlines of the frontal plane."""
    inside = np.zeros(len(p), bool)
    x, y = p[:, :1], p[:, 1:2]
    for outline in bounds:
        a, b = outline, np.roll(outline, -1, axis=0)
        cross = (a[:, 1] > y) != (b[:, 1] > y)
        edge = a[:, 0] + (y - a[:, 1]) / np.where(cross, b[:, 1] - a[:, 1], 1) * (b[:, 0] - a[:, 0])
        inside |= np.count_nonzero(cross & (x < edge), axis=1) % 2 == 1
    return inside & (p[:, 2] >= 0.03)


def head_net() -> Head:
    """Build the net: features, neck ring, filling, hull."""
    solid = head_solid()
    net = Net()
    mouth = _mouth(net, head_solid(lids=False))
    eyes = {"Left": _eye(net, solid, 1), "Right": _eye(net, solid, -1)}
    angle = 2 * np.pi * np.arange(28) / 28
    d = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
    bottom = net.add(land(solid, np.array([0, BOTTOM, -0.01]) + 0.2 * d, -d))
    outlines = [mouth.ids[-1], eyes["Left"].ids[-1], eyes["Right"].ids[-1]]
    bounds = [net.points[o][:, :2] for o in outlines]
    rim = np.concatenate([*outlines, bottom])
    line, left = _fill(solid, net.points[rim], bounds)
    middle = net.add(line)
    lefts = net.add(left)
    rights = net.add(left * [-1, 1, 1])
    hull = np.concatenate([rim, middle, lefts, rights])
    for turn in range(6):
        faces = _hull_faces(net.points[hull], hull, [*outlines, np.array(bottom)])
        if turn < 5:
            _even_out(net, faces, solid, middle, lefts, rights)
    net.faces += [tuple(int(i) for i in f) for f in faces]
    low = net.points[bottom].mean(0)
    net.cap(bottom[::-1], low)
    return Head(net, solid, mouth, eyes)


def _hull_faces(points: Array, ids: Array, outlines: list[Array]) -> Array:
    d = points - MIDDLE
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    faces = ConvexHull(d).simplices
    a, b, c = (d[faces[:, k]] for k in range(3))
    flip = np.einsum("fi,fi->f", np.cross(b - a, c - a), a) < 0
    faces[flip] = faces[flip][:, ::-1]
    faces = ids[faces]
    for outline in outlines:
        faces = faces[~np.isin(faces, outline).all(1)]
    return faces


def _even_out(net: Net, faces: Array, solid: Solid, middle: list[int], lefts: list[int], rights: list[int]) -> None:
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    total = np.zeros_like(net.points)
    count = np.zeros(len(net.points))
    np.add.at(total, pairs[:, 0], net.points[pairs[:, 1]])
    np.add.at(count, pairs[:, 0], 1)
    mean = total / np.maximum(count, 1)[:, None]
    for ids, fix in ((middle, [0, 1, 1]), (lefts, [1, 1, 1])):
        p = 0.5 * (net.points[ids] + mean[ids]) * fix
        d = p - MIDDLE
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        net.points[ids] = land(solid, MIDDLE + 0.25 * d, -d)
    net.points[rights] = net.points[lefts] * [-1, 1, 1]


def head_normals(head: Head) -> Array:
    """Normals of the solid where the net follows it, of the faces in the mouth and at the lids' edges."""
    own = head.net.shade(head.solid, 0.0)
    normals = gradient(head.solid, head.net.points)
    free = np.zeros(len(own))
    free[head.mouth.ids[:8].ravel()] = 1
    free[head.mouth.ids[8]] = 0.5
    for eye in head.eyes.values():
        free[eye.ids[:6].ravel()] = 1
    free[-1] = 1
    blend = free[:, None] * own + (1 - free[:, None]) * (0.35 * own + 0.65 * normals)
    return blend / np.linalg.norm(blend, axis=1, keepdims=True)
