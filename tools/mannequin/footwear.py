"""Shoes: an upper with a sole, left and right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array

from .net import Net, smoothstep
from .sculpture import joint, make_part, mirror_part, srgb, weights_of
from .solids import Solid, capsule, gradient, land, settle, union

__all__ = ["shoes"]


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
    parts.append(_shoe("shoe", body, normals, srgb("8a5f45")))
    base, normals = _shell(sole, (x + 0.003, 0.012, 0.05), 22, 6, floor=0.0, roof=0.026)
    parts.append(_shoe("sole", base, normals, srgb("e9e2d6")))
    out = []
    for part in parts:
        out += [_rename(part, "left"), mirror_part(part, "right" + part.name.capitalize())]
    return out


def _rename(part: Part, side: str) -> Part:
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
    toes = smoothstep(0.05, 0.18, net.points[:, 2])  # ours: the least stretch
    weights = weights_of(len(net.points), leftFoot=1 - toes, leftToes=toes)
    return make_part(name, net, normals, weights, colour, 0.6, is_posed=True)
