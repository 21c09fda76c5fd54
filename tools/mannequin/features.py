"""What sits on and in the head: eyeballs, brows, ears, hair, teeth and tongue. Frame and units as in `head`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cospeech.motion.rotations import Array

from .head import EYE, EYE_RADIUS, head_solid
from .net import Net, smoothstep
from .sculpture import DARK, HAIR, SKIN, srgb
from .solids import gradient, land

__all__ = ["Piece", "brows", "ears", "eyeball", "hair", "teeth", "tongue"]

IRIS_RADIUS = 0.0078  # metres on the ball; ours, a little larger than life
PUPIL_RADIUS = 0.0034


@dataclass(frozen=True)
class Piece:
    """A net with normals and colours (V, 3)."""

    net: Net
    normals: Array
    colour: Array


def eyeball(sign: int) -> Piece:
    """White, iris with a dark rim, pupil and a highlight: rings around the line of sight, each colour with its own points."""
    net, colours = Net(), []
    centre = EYE * [sign, 1, 1]
    white, warm, rim, iris, light, black = (srgb(c) for c in ("f4f1ec", "e6d5cd", "23303a", "4f7f8c", "8ab4b4", "0c0d10"))
    edge, hole = np.arcsin(IRIS_RADIUS / EYE_RADIUS), np.arcsin(PUPIL_RADIUS / EYE_RADIUS)
    zones = [  # (angles from the line of sight outwards in, colours)
        ((2.0, 1.35, 0.95, 0.70, edge), (warm, warm, white, white, white)),
        ((edge, edge * 0.86, edge * 0.66, hole), (rim, iris, light, iris)),
        ((hole, hole * 0.5), (black, black)),
    ]
    angle = 2 * np.pi * np.arange(20) / 20
    for k, (cones, inks) in enumerate(zones):
        rows = []
        for cone, ink in zip(cones, inks, strict=True):
            flat = 1.0 if k == 0 else 1.0 - 0.012 * (edge - cone) / edge
            d = np.stack([np.sin(cone) * np.cos(angle), np.sin(cone) * np.sin(angle), np.full(20, np.cos(cone))], 1)
            rows.append(net.add(centre + EYE_RADIUS * flat * d))
            colours += [ink] * 20
        net.tube(rows)
        if k == 2:
            net.cap(rows[-1], centre + [0, 0, EYE_RADIUS * 0.988])
            colours.append(black)
    spot = np.array([-0.20, 0.24, 0.0])
    spot[2] = np.sqrt(1 - spot @ spot)
    side = np.cross([0, 1.0, 0], spot)
    side /= np.linalg.norm(side)
    rise = np.cross(spot, side)
    middle = centre + (EYE_RADIUS + 0.0002) * spot
    around = 2 * np.pi * np.arange(8) / 8
    dots = net.add(middle + 0.0015 * (np.cos(around)[:, None] * side + np.sin(around)[:, None] * rise))
    net.cap(dots, middle + 0.0001 * spot)
    colours += [np.ones(3)] * 9
    normals = net.points - centre
    return Piece(net, normals / np.linalg.norm(normals, axis=1, keepdims=True), np.array(colours))


def brow_line(t: Array) -> tuple[Array, Array, Array]:
    """Centre (x, y) and half height of the left brow over t = 0 (nose) … 1 (temple)."""
    x = 0.0125 + 0.0375 * t
    y = 0.1068 + 0.0050 * np.sin(np.pi * np.minimum(t * 0.80, 1)) - 0.0042 * t**3
    half = 0.0041 * (1 - 0.30 * t) * np.minimum(1, (t + 0.05) * 7) ** 0.5 * np.sqrt(np.maximum(1 - t**5, 0.02))
    return x, y, half


def brows() -> tuple[Piece, Array]:
    """Both brows, soft ridges on the skin; also t of each point (V,)."""
    solid = head_solid()
    net, place = Net(), []
    t = np.linspace(0, 1, 11)
    x, y, half = brow_line(t)
    for sign in (1, -1):
        rows = []
        for v, lift in ((-1.0, -0.0010), (-0.55, 0.0013), (0.35, 0.0017), (1.0, -0.0010)):
            start = np.stack([sign * x, y + v * half, np.full(len(t), 0.2)], 1)
            p = land(solid, start, np.tile([0, 0, -1.0], (len(t), 1)))
            p += lift * gradient(solid, p)
            rows.append(net.add(p if sign > 0 else p[::-1]))
            place.append(t if sign > 0 else t[::-1])
        net.tube(rows, closed=False)
    normals = 0.5 * gradient(solid, net.points) + 0.5 * net.shade(solid, 0.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    place_all = np.concatenate(place)
    thin = np.clip(1 - place_all, 0, 1)[:, None]
    colour = HAIR * (0.9 + 0.25 * (1 - thin))
    return Piece(net, normals, colour), place_all


def ears() -> Piece:
    """Two ears: a folded disc with a rim, a hollow and a lobe, closed behind."""
    net, colours = Net(), []
    count = 16
    angle = 2 * np.pi * np.arange(count) / count
    shape = 1 + 0.10 * np.sin(angle) - 0.16 * np.maximum(-np.sin(angle), 0) * (0.6 + 0.4 * np.cos(angle))
    # rings over the ear: share of the outline, height above the disc; the last two close the back
    rings = (
        (0.14, -0.0035), (0.32, -0.0035), (0.56, -0.0010), (0.70, 0.0012), (0.80, 0.0), (0.90, 0.0022),
        (1.0, 0.0008), (0.98, -0.0022), (0.70, -0.0070), (0.45, -0.0140),
    )  # fmt: skip
    for sign in (1, -1):
        rows = []
        for share, high in rings:
            along, up = np.cos(angle) * shape * 0.0165 * share, np.sin(angle) * shape * 0.030 * share
            stand = high + 0.0075 * (np.cos(angle) * share) ** 1.0 * (np.cos(angle) < 0) * -1 * (high > -0.006)
            p = np.stack([0.0705 + stand, 0.066 + up + 0.10 * along, -0.012 + along - 0.16 * up], 1)
            p[:, 0] += 0.05 * (p[:, 1] - 0.066)
            p *= [sign, 1, 1]
            rows.append(net.add(p if sign < 0 else p[::-1]))
            dip = smoothstep(-0.001, -0.0035, np.full(count, high)) * (share < 0.5)
            colours.append(SKIN * [1.0, 0.90, 0.86] * (1 - 0.35 * dip[:, None]))
        net.tube(rows[::-1])
        net.cap(rows[0], net.points[rows[0]].mean(0))
        net.cap(rows[-1][::-1], net.points[rows[-1]].mean(0))
        colours += [colours[-len(rings)][:1], SKIN[None]]
    normals = net.shade(lambda p: p[:, 0], 0.0)
    return Piece(net, normals, np.concatenate(colours))


def hairline(a: Array) -> Array:
    """Elevation in radians of the hair's edge over the azimuth (0 = front, positive to the left), from the skull's middle."""
    side = np.abs(a) / np.pi
    knots = np.array([0, 0.10, 0.20, 0.27, 0.33, 0.385, 0.425, 0.46, 0.50, 0.56, 0.62, 0.68, 0.80, 1.0])
    heights = np.radians([37, 37, 35, 27, 12, -8, -17, -8, 5, 4, -10, -30, -44, -47])
    sweep = np.radians(5.0) * np.sin(2.2 * np.clip(a, -1.2, 1.2))  # the fringe falls to the right
    return np.interp(side, knots, heights) + sweep * (side < 0.4)


SKULL = np.array([0.0, 0.095, -0.008])  # from which the hair's points are seen


def hair() -> Piece:
    """A sculpted short cut: volume over the skull, parted on one side and swept over the forehead, with soft strands."""
    solid = head_solid()
    net = Net()
    around, rows = 52, 12
    a = 2 * np.pi * np.arange(around) / around
    a = np.where(a > np.pi, a - 2 * np.pi, a)
    edge = hairline(a)
    crown = np.array([0.010, 0, -0.35])
    ids, tint = [], []
    for k in range(rows + 2):
        t = min((k + 0.6) / (rows - 0.4), 1.0)
        e = np.pi / 2 - (np.pi / 2 - edge) * t**0.94
        d = np.stack([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)], 1)
        d += crown * (np.maximum(d[:, 1:2], 0) ** 2) * (1 - t) * 0.8
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        skin = land(solid, SKULL + 0.25 * d, -d)
        thick, shade = _volume(a, t)
        if k == rows:
            thick = thick * 0.30
        elif k == rows + 1:
            thick = np.full(around, -0.004)
        ids.append(net.add(skin + thick[:, None] * d))
        tint.append(shade)
    net.tube(ids[::-1])
    top = np.array([0, 1.0, 0]) + crown * 0.8
    top /= np.linalg.norm(top)
    peak = land(solid, (SKULL + 0.25 * top)[None], -top[None])[0] + 0.0185 * top
    net.cap(ids[0], peak)
    normals = net.shade(solid, 0.15)
    colour = HAIR * np.concatenate([*tint, [1.0]])[:, None]
    return Piece(net, normals, colour)


def _volume(a: Array, t: float) -> tuple[Array, Array]:
    """Thickness in metres and tint of the hair at azimuth ``a``, ``t`` = 0 at the crown … 1 at the edge."""
    front = np.exp(-((a / 0.85) ** 2))
    side = np.exp(-(((np.abs(a) - 1.35) / 0.45) ** 2))
    sweep = np.exp(-(((a + 0.15) / 0.55) ** 2)) * np.exp(-(((t - 0.80) / 0.22) ** 2))
    part = np.exp(-(((a - 0.55 + 0.15 * t) / 0.10) ** 2)) * smoothstep(0.2, 0.6, np.full_like(a, t))
    round_ = np.sqrt(np.clip(1 - t**6, 0, 1))
    off = smoothstep(0.0, 0.40, np.full_like(a, t))  # of the crown, where all azimuths meet
    front, side = front * off, side * off
    thick = 0.0085 + 0.0105 * (1 - t) + 0.007 * front * round_ + 0.009 * sweep - 0.0025 * side * t - 0.0050 * part
    strand = np.sin(15 * a + 3.0 * t + 1.2 * np.sin(3 * a)) + 0.6 * np.sin(27 * a - 2.0 * t)
    return thick * (0.55 + 0.45 * round_) + 0.0010 * strand * off, 1 + 0.34 * strand * off / 1.6


def _arc(angle: Array, width: float, depth: float, front: float) -> Array:
    return np.stack([width * np.sin(angle), 0 * angle, front - depth * (1 - np.cos(angle))], 1)


def teeth(upper: bool, front: float, edge: float) -> Piece:
    """A row of teeth with its gum on a dental arch; ``front`` z of the incisors, ``edge`` y of their cutting edge."""
    net = Net()
    count = 31
    angle = np.linspace(-1.48, 1.48, count)
    side = 1 if upper else -1
    width, depth = (0.0215, 0.026) if upper else (0.0200, 0.025)
    arch = _arc(angle, width, depth, front)
    normal = np.stack([np.sin(angle) * 1.1, 0 * angle, np.cos(angle)], 1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    gap = (np.arange(count) % 3 == 0).astype(float)
    white, gum, back = srgb("f3efe6"), srgb("c4766f"), srgb("8a4a48")
    tall = (0.0088 if upper else 0.0076) * (1 - 0.22 * np.abs(angle) / 1.48)
    rows, colour = [], []
    table = (  # height share, out, ink
        (1.55, 0.0012, gum), (1.02, 0.0010, gum), (0.96, 0.0012, white), (0.45, 0.0018, white), (0.06, 0.0012, white),
        (0.0, 0.0002, white), (0.06, -0.0022, white), (1.2, -0.0040, back),
    )  # fmt: skip
    for share, out, ink in table:
        notch = gap * np.where(share < 0.2, 0.0006, 0.0)
        p = arch + normal * (out - 0.0005 * gap * (share < 1))[:, None]
        p[:, 1] = edge + side * (share * tall + notch)
        rows.append(net.add(p))
        far = 1 - 0.62 * smoothstep(0.35, 1.45, np.abs(angle))
        colour.append(ink * (far * (1 - 0.22 * gap * (share < 1)))[:, None])
    net.tube(rows if not upper else rows[::-1], closed=False)
    return Piece(net, net.shade(lambda p: p[:, 1], 0.0), np.concatenate(colour))


def tongue(front: float, top: float) -> Piece:
    """A tongue lying behind the lower teeth: rings from the tip to the root."""
    net = Net()
    count = 12
    angle = 2 * np.pi * np.arange(count) / count
    rows = []
    for t in (0.03, 0.12, 0.28, 0.48, 0.70, 0.92):
        wide, high = 0.0165 * min(1, (t * 5) ** 0.5), 0.0058 * min(1, (t * 6) ** 0.5)
        x, y = wide * np.cos(angle), high * np.sin(angle)
        y = y - 0.0018 * np.exp(-((x / 0.004) ** 2)) * (np.sin(angle) > 0) * min(1, t * 5)
        rows.append(net.add(np.stack([x, top - 0.0060 + y + 0.004 * np.sin(np.pi * t), np.full(count, front - 0.040 * t)], 1)))
    net.tube(rows[::-1])
    net.cap(rows[0], np.array([0, top - 0.0062, front]))
    net.cap(rows[-1][::-1], net.points[rows[-1]].mean(0))
    colour = np.tile(srgb("cf6f70"), (len(net.points), 1))
    deep = smoothstep(front - 0.01, front - 0.045, net.points[:, 2])[:, None]
    return Piece(net, net.shade(lambda p: p[:, 1], 0.0), colour * (1 - deep) + DARK * deep)
