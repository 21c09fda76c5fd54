"""Forearms and hands: a tube whose end splits into four fingers and whose side grows a thumb, eight points around each finger.

Modelled in the T-pose (palm down), in the frame of the left wrist: x towards the finger tips, y to the back of the hand,
z towards the thumb. The right hand is its mirror image.
"""

from __future__ import annotations

import numpy as np

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array
from cospeech.motion.skeleton import humanoid

from .garment_weights import hand_share
from .net import Net, frame, smoothstep
from .sculpture import SKIN, make_part, mirror_part, srgb, weights_of
from .solids import Solid, capsule, cut, ellipsoid, land, settle, union

__all__ = ["hands"]

FINGERS = ("Index", "Middle", "Ring", "Little")
JOINTS = ("Proximal", "Intermediate", "Distal")
RADII = {  # metres at knuckle, middle joint, last joint, tip; ours, after adult hand surveys, slightly slender
    "Index": (0.0107, 0.0094, 0.0083, 0.0070),
    "Middle": (0.0109, 0.0096, 0.0085, 0.0072),
    "Ring": (0.0104, 0.0091, 0.0081, 0.0068),
    "Little": (0.0092, 0.0080, 0.0071, 0.0061),
    "Thumb": (0.0170, 0.0126, 0.0105, 0.0076),
}
MELT = 0.010  # metres over which the weights of joints and webs flow into one another; ours
AROUND = np.radians([45, 0, -45, -90, -135, 180, 135, 90])  # of a finger's points, from its back towards the thumb
WEB = np.array([0.0190, 0.0200, 0.0185, 0.0140])  # metres from each knuckle to where the fingers part; ours


def _at(name: str) -> Array:
    rest, index = humanoid().tpose, humanoid().index
    return rest[index["left" + name]] - rest[index["leftHand"]]


def _chain(finger: str) -> list[Array]:
    """Joints and tip of a finger in the wrist's frame."""
    names = ("Metacarpal", "Proximal", "Distal") if finger == "Thumb" else JOINTS
    points = [_at(finger + n) for n in names]
    return [*points, points[-1] + np.array(humanoid().ends["left" + finger + names[-1]])]


def _digit(finger: str) -> Solid:
    chain, radii = _chain(finger), RADII[finger]
    ends = [*chain[:3], chain[3] - (chain[3] - chain[2]) / np.linalg.norm(chain[3] - chain[2]) * radii[3]]
    bones = [capsule(ends[k], ends[k + 1], radii[k] * 0.96, radii[k + 1] * 0.97) for k in range(3)]
    swell = 0.97 if finger == "Thumb" else 1.03
    knuckles = [ellipsoid(ends[k], np.full(3, radii[k] * swell)) for k in (1, 2)]
    pad = ellipsoid(0.45 * ends[2] + 0.55 * chain[3] - [0, radii[3] * 0.30, 0], np.full(3, radii[3] * 1.02))
    return union(0.006, *bones, *knuckles, pad)


def _palm() -> Solid:
    wrist = capsule((-0.06, 0, 0), (0.008, -0.001, 0.0), 0.0255, 0.0265, (1, 0.80, 1))
    forearm = capsule((-0.18, 0, 0.002), (-0.05, 0, 0), 0.0350, 0.0255, (1, 0.92, 1))
    rays = []
    for finger in FINGERS:
        knuckle = _chain(finger)[0]
        base = np.array([0.012, -0.002, knuckle[2] * 0.45])
        rays.append(capsule(base, knuckle + [-0.002, -0.0025, 0], 0.0165, RADII[finger][0] * 1.16))
    thenar = capsule((0.020, -0.010, 0.016), (0.050, -0.015, 0.042), 0.0170, 0.0135)
    heel = capsule((0.016, -0.010, -0.016), (0.060, -0.011, -0.030), 0.0150, 0.0115)
    pads = capsule((0.080, -0.008, 0.024), (0.074, -0.010, -0.030), 0.0085, 0.0085)
    rays += [ellipsoid(_chain(f)[0] + [0.001, 0.0042, 0], np.full(3, RADII[f][0] * 0.98)) for f in FINGERS]  # knuckles
    hollow = ellipsoid((0.054, -0.0345, 0.000), (0.026, 0.014, 0.016))
    return cut(0.012, union(0.016, wrist, forearm, *rays, thenar, heel, pads), hollow)


FOREARM = (  # distance from the wrist, half height, half width, metres: bare below the rolled sleeve; ours
    (-0.152, 0.0305, 0.0330),
    (-0.128, 0.0290, 0.0320),
    (-0.105, 0.0265, 0.0302),
    (-0.082, 0.0238, 0.0284),
)


def _around_wrist(x: float, radii: tuple[float, float]) -> Array:
    """20 points: back of the hand from the index to the little side, the edge, the palm back again, the thumb's edge."""
    across = np.linspace(0.94, -0.94, 9)
    high = np.sqrt(1 - across**2)
    zeros = 0 * across + x
    back = np.stack([zeros, high * radii[0], across * radii[1]], 1)
    palm = np.stack([zeros, -high * radii[0], across * radii[1]], 1)[::-1]
    return np.concatenate([back, [[x, 0, -radii[1]]], palm, [[x, 0, radii[1]]]])


def _last_row() -> tuple[Array, Array]:
    """The palm's last 20 points, just before the fingers part, and the three web points between fingers."""
    knuckles = np.array([_chain(f)[0] for f in FINGERS])
    ends = knuckles + WEB[:, None] * [1, 0, 0]
    borders = [ends[0] + [0, 0, 0.0102], *(0.5 * (ends[:-1] + ends[1:]) - [0.001, 0, 0]), ends[3] - [0, 0, 0.0090]]
    rows: dict[int, list[Array]] = {1: [], -1: []}
    for side in (1, -1):
        for k in range(4):
            rows[side] += [borders[k] + [0, side * 0.006, 0], ends[k] + [0.001, side * 0.0095, 0]]
        rows[side].append(borders[4] + [0, side * 0.006, 0])
    edges = [borders[4] + [0, 0, -0.001], borders[0] + [0, 0, 0.001]]
    webs = np.array([b - [0.002, 0.001, 0] for b in borders[1:4]])
    return np.concatenate([rows[1], edges[:1], rows[-1][::-1], edges[1:]]), webs


def _stations(finger: str) -> list[tuple[float, int]]:
    """Where rings sit on a finger: (share of the way, bone)."""
    if finger == "Thumb":
        return [
            (0.66, 0),
            (0.86, 0),
            (0.05, 1),
            (0.30, 1),
            (0.60, 1),
            (0.84, 1),
            (0.99, 1),
            (0.20, 2),
            (0.50, 2),
            (0.78, 2),
            (0.93, 2),
        ]
    return [
        (0.64, 0),
        (0.84, 0),
        (0.985, 0),
        (0.16, 1),
        (0.46, 1),
        (0.76, 1),
        (0.98, 1),
        (0.22, 2),
        (0.52, 2),
        (0.78, 2),
        (0.93, 2),
    ]


def _grow(net: Net, base: list[int], finger: str, solid: Solid) -> list[int]:
    """Rings from ``base`` to the tip; returns the new points."""
    chain = _chain(finger)
    new, previous = [], base
    for share, bone in _stations(finger):
        axis = chain[bone + 1] - chain[bone]
        centre = chain[bone] + share * axis
        up, _ = frame(axis, (0, 1, 0))
        side = np.cross(axis / np.linalg.norm(axis), up) * -1
        side = side if side[2] * axis[0] - side[0] * axis[2] > 0 else -side
        out = np.cos(AROUND)[:, None] * up + np.sin(AROUND)[:, None] * side
        ids = net.add(land(solid, centre + 0.03 * out, -out))
        net.bridge(previous, ids)
        new += ids
        previous = ids
    tip = chain[3] + 0.02 * axis / np.linalg.norm(axis)
    top = net.cap(previous, tip)
    net.points[top] = land(solid, tip[None], -axis[None] / np.linalg.norm(axis))[0]
    return [*new, top]


def _make_left_hand() -> Part:
    palm, digits = _palm(), {f: _digit(f) for f in (*FINGERS, "Thumb")}
    whole = union(0.010, union(0.016, palm, digits["Thumb"]), *(digits[f] for f in FINGERS))
    trunk = union(0.010, palm, *(digits[f] for f in FINGERS))
    net = Net()
    last, webs = _last_row()
    start = _around_wrist(-0.062, (0.0215, 0.0270))
    at = (0.0, 0.18, 0.35, 0.47, 0.575, 0.675, 0.775, 0.87, 0.945, 1.0)
    rows = [net.add(_around_wrist(x, (high, wide))) for x, high, wide in FOREARM]
    rows += [net.add(start + t * (last - start)) for t in at]
    net.tube(rows)
    web = net.add(webs)
    loop = _thumb_hole(net, rows)
    soft = [i for row in rows[len(FOREARM) + 1 :] for i in row] + web
    edge = {0: rows[-1][19], 4: rows[-1][9], 1: web[0], 2: web[1], 3: web[2]}
    fingers: dict[str, list[int]] = {}
    for k, finger in enumerate(FINGERS):
        back = [rows[-1][2 * k + j] for j in range(3)]
        front = [rows[-1][18 - 2 * k - j] for j in (2, 1, 0)]
        base = [*back, edge[k + 1], *front, edge[k]]
        fingers[finger] = _grow(net, base, finger, digits[finger])
    fingers["Thumb"] = _grow(net, loop, "Thumb", digits["Thumb"])
    in_use = {i for f in net.faces for i in f}
    free = np.zeros(len(net.points), bool)
    free[[i for i in soft if i in in_use]] = True
    free[[*rows[-1], *web]] = False
    net.faces = [f[::-1] for f in net.faces]  # the rows run from the thumb's side to the little finger: right to left
    net.cap(rows[0], net.points[rows[0]].mean(0))
    free = np.append(free, False)
    net.points[rows[-1]] = settle(whole, net.points[rows[-1]], 8)
    net.relax(trunk, free, 30)
    seam = np.zeros(len(net.points), bool)
    seam[[*loop, *fingers["Thumb"][:8]]] = True
    net.soften(seam, 3)
    return _finish(net, whole, rows, web, fingers)


def _thumb_hole(net: Net, rows: list[list[int]]) -> list[int]:
    """Open 2 × 2 cells on the thumb's edge; returns the loop of 8 points in a finger ring's order."""
    r = len(FOREARM) + 3
    cols = (0, 19, 18)  # back, edge, palm
    middle = rows[r + 1][19]
    net.faces = [f for f in net.faces if middle not in f]
    # a finger ring starts at 45° (back, thumb side) and runs over the back to the far side and below
    loop = [rows[r][cols[0]], rows[r + 1][cols[0]], rows[r + 2][cols[0]], rows[r + 2][cols[1]]]
    loop += [rows[r + 2][cols[2]], rows[r + 1][cols[2]], rows[r][cols[2]], rows[r][cols[1]]]
    return loop


def _finger_weights(p: Array, finger: str) -> tuple[Array, Array, Array]:
    """How far a point lies beyond each of a finger's three joints, 0 … 1."""
    chain = _chain(finger)
    beyond = []
    for k, reach in ((0, 0.016), (1, 0.0095), (2, 0.0085)):
        before = chain[k] - chain[k - 1] if k else chain[1] - chain[0]
        after = chain[k + 1] - chain[k]
        bisector = before / np.linalg.norm(before) + after / np.linalg.norm(after)
        s = (p - chain[k]) @ bisector / np.linalg.norm(bisector)
        beyond.append(smoothstep(-reach, reach, s))
    return beyond[0], beyond[1] * beyond[0], beyond[2] * beyond[1] * beyond[0]


def _finish(net: Net, whole: Solid, rows: list[list[int]], web: list[int], fingers: dict[str, list[int]]) -> Part:
    """Weights, normals and colours of the left hand."""
    p = net.points
    wrist = hand_share(p[:, 0])
    weights = weights_of(len(p), leftHand=wrist, leftLowerArm=1 - wrist)
    index = humanoid().index
    z = np.array([_chain(f)[0][2] for f in FINGERS])
    near = np.exp(-(((p[:, 2:3] - z) / 0.0085) ** 2))
    near /= near.sum(1, keepdims=True) + 1e-12
    thumb = np.zeros(len(p), bool)
    thumb[fingers["Thumb"]] = True
    for k, finger in enumerate(FINGERS):
        own = near[:, k].copy()
        for other in (*FINGERS, "Thumb"):
            own[fingers[other]] = float(other == finger)
        a, b, c = _finger_weights(p, finger)
        if finger in fingers:
            tail = np.zeros(len(p), bool)
            tail[fingers[finger]] = True
            b, c = np.where(tail, b, 0), np.where(tail, c, 0)
        total = a * own
        weights[:, index["leftHand"]] -= total
        for name, value in zip(JOINTS, (a - b, b - c, c), strict=True):
            weights[:, index["left" + finger + name]] += value * own
    a, b, c = _finger_weights(p, "Thumb")
    chain = _chain("Thumb")
    line = capsule(chain[0], chain[1], 0.0, 0.0)(p)
    grip = np.where(thumb, 1.0, smoothstep(0.030, 0.012, line) * smoothstep(0.004, 0.030, p[:, 2]))
    a = np.where(thumb, np.maximum(a, 0.75), smoothstep(-0.010, 0.035, (p - chain[0]) @ (chain[1] - chain[0]) / 0.044)) * grip
    weights *= (1 - a)[:, None]
    for name, value in zip(("Metacarpal", "Proximal", "Distal"), (a - b * thumb, (b - c) * thumb, c * thumb), strict=True):
        weights[:, index["leftThumb" + name]] += value
    weights = np.maximum(weights, 0)
    weights /= weights.sum(1, keepdims=True)
    weights = net.spread(weights, MELT, p[:, 0] > -0.05)
    normals = net.shade(whole, 0.35)
    colour = _tint(p, fingers, normals)
    net.points = p + humanoid().tpose[index["leftHand"]]
    return make_part("leftHand", net, normals, weights, colour, 0.65)


def _tint(p: Array, fingers: dict[str, list[int]], normals: Array) -> Array:
    """Skin colour, warmer at the tips and knuckles, pale nails."""
    colour = np.tile(SKIN, (len(p), 1))
    warm, nail = srgb("dd9f82"), srgb("f0cdb8")
    for finger, ids in fingers.items():
        tip = smoothstep(0.028, 0.0, np.linalg.norm(p[ids] - _chain(finger)[3], axis=1))[:, None] * 0.6
        colour[ids] += tip * (warm - colour[ids])
    for ids in fingers.values():
        for around in (ids[-25:-17], ids[-17:-9]):
            colour[[around[1]]] = nail
            colour[[around[0], around[2]]] = 0.5 * nail + 0.5 * colour[[around[0], around[2]]]
    return colour


def hands() -> list[Part]:
    """Both hands."""
    left = _make_left_hand()
    return [left, mirror_part(left, "rightHand")]
