"""What is sewn to the shirt: collar, buttons and a pocket. Each takes its weights from the cloth below it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array

from .net import Net, smoothstep
from .sculpture import make_part, srgb
from .solids import Solid, gradient, land, settle

__all__ = ["add_buttons", "add_collar", "make_pocket"]

COLLAR, EDGE, BUTTON, PATCH, STITCH = srgb("6299a7"), srgb("4d8492"), srgb("eee8da"), srgb("5c93a1"), srgb("36606d")
BUTTONS = (1.318, 1.255, 1.192, 1.129, 1.066)  # heights, metres
STATIONS = 21  # of the collar, from the left point around the neck to the right one


def _weights_below(net: Net, weights: Array, points: Array) -> Array:
    """Weights (V, J) of the cloth around ``points`` (V, 3); ``weights`` are those of the net's first points."""
    distance, nearest = cKDTree(net.points[: len(weights)]).query(points, 16)
    share = np.exp(-((distance / 0.018) ** 2)) + 1e-9
    return np.einsum("vk,vkj->vj", share / share.sum(1, keepdims=True), weights[nearest])


def add_collar(net: Net, solid: Solid, weights: Array, colour: Array) -> tuple[Array, Array]:
    """A turned-down collar that stands open at the throat."""
    first = len(net.points)
    turn = np.linspace(-1, 1, STATIONS) * np.radians(136)  # from the middle of the back
    away = np.stack([np.sin(turn), 0 * turn, -np.cos(turn)], 1)
    base = np.array([0, 1.4500, -0.0170]) + away * [0.0640, 0, 0.0630]
    base[:, 1] -= 0.26 * (base[:, 2] + 0.0170)
    point = smoothstep(0.60, 1.0, np.abs(turn) / np.radians(136))
    profile = (  # out, up, darker, and what the points add to them
        (-0.001, -0.012, 0.75, 0.000, 0.000),
        (-0.003, 0.018, 0.85, 0.000, -0.006),
        (-0.001, 0.0260, 1.0, 0.001, -0.010),
        (0.0035, 0.0235, 1.0, 0.003, -0.012),
        (0.0080, 0.0080, 1.0, 0.009, -0.020),
        (0.0120, -0.0110, 1.0, 0.014, -0.034),
        (0.0125, -0.0150, 0.62, 0.015, -0.037),
        (0.0095, -0.0140, 0.60, 0.013, -0.035),
    )
    rows, colours = [], []
    for k, (out, up, dark, more, drop) in enumerate(profile):
        p = base + away * (out + more * point)[:, None] + np.array([0, 1.0, 0]) * (up + drop * point)[:, None]
        low = (solid(p) < 0.0075) & (k > 3)
        p[low] = settle(lambda q, k=k: solid(q) - (0.0075 if k < 7 else 0.002), p[low], 8)
        if k > 3:
            p = _even(p)
        rows.append(net.add(p))
        colours.append(np.tile((EDGE if k == 6 else COLLAR) * dark, (STATIONS, 1)))
    net.tube(rows, closed=False)
    for end, way in ((0, 1), (STATIONS - 1, -1)):
        ids = [row[end] for row in rows][::way]
        for k in range(3):
            net.faces.append((ids[k], ids[k + 1], ids[-2 - k], ids[-1 - k]))
    own = _weights_below(net, weights, net.points[first:])
    return np.concatenate([weights, own]), np.concatenate([colour, *colours])


def _even(p: Array) -> Array:
    """Smooth the inside of a row of points (N, 3)."""
    for _ in range(3):
        p = np.concatenate([p[:1], 0.25 * p[:-2] + 0.5 * p[1:-1] + 0.25 * p[2:], p[-1:]])
    return p


def add_buttons(net: Net, solid: Solid, weights: Array, colour: Array) -> tuple[Array, Array]:
    """A row of buttons on the placket."""
    first = len(net.points)
    around = 2 * np.pi * np.arange(8) / 8
    colours = []
    for y in BUTTONS:
        middle = land(solid, np.array([[0, y, 0.3]]), np.array([[0, 0, -1.0]]))
        (out,) = gradient(solid, middle)
        rise = np.array([0, out[2], -out[1]])
        place = middle[0] + 0.0030 * out
        flat = np.cos(around)[:, None] * [1.0, 0, 0] + np.sin(around)[:, None] * rise
        net.cap(net.add(place + 0.0060 * flat), place + 0.0026 * out)
        colours += [BUTTON * 0.8] * 8 + [BUTTON]
    own = _weights_below(net, weights, net.points[first:])
    return np.concatenate([weights, own]), np.concatenate([colour, np.array(colours)])


def make_pocket(net: Net, solid: Solid, weights: Array) -> Part:
    """A pocket with a hem on the left of the chest of the shirt ``net``, whose ``weights`` (V, J) it takes."""
    across = np.array([0, 0.002, 0.004, 0.030, 0.056, 0.058, 0.060])
    down = (0, 0.002, 0.012, 0.014, 0.04, 0.063, 0.066, 0.068)
    patch, rows, colours = Net(), [], []
    last = len(down) - 1
    for k, fall in enumerate(down):
        x = 0.054 + across
        y = 1.300 - fall + 0 * x
        if k >= last - 2:  # the bottom comes to a soft point
            y -= 0.010 * (1 - np.abs(across / 0.030 - 1))
        p = land(solid, np.stack([x, y, 0 * x + 0.3], 1), np.tile([0, 0, -1.0], (len(x), 1)))
        border = np.minimum(np.minimum(np.arange(7), 6 - np.arange(7)), min(k, last - k))
        p += np.interp(border, (0, 1), (0.0012, 0.0044))[:, None] * gradient(solid, p)
        rows.append(patch.add(p))
        inside = STITCH if k == 3 else PATCH * (1.08 if k <= 2 else 1.0)
        colours.append(np.where((border == 0)[:, None], STITCH, inside))
    patch.tube(rows[::-1], closed=False)
    own, colour = _weights_below(net, weights, patch.points), np.concatenate(colours)
    return make_part("pocket", patch, patch.shade(solid, 0.0), own, colour, 0.9, is_posed=True)
