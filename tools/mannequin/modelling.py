"""From clay to character: puts the parts together; the result is kept as a file of the package."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cospeech.export.mannequin.character import Character, Part
from cospeech.motion.rotations import Array
from cospeech.motion.skeleton import humanoid

from .clothes import clothes
from .ease_parts import ease_parts
from .face_shapes import Shapes, brow_shapes, jaw_shapes, tongue_shapes
from .features import Piece, brows, ears, eyeball, hair, teeth, tongue
from .hands import hands
from .head import NOSTRIL, Head, head_net, head_normals
from .net import smoothstep
from .sculpture import DARK, SKIN, make_part, srgb, weights_of

__all__ = ["sculpt"]


def _neck_weights(p: Array) -> Array:
    """Head, neck and chest by height; the chin belongs to the head."""
    rise = p[:, 1] + 0.55 * np.maximum(p[:, 2] - 0.02, 0)
    head = smoothstep(-0.100, 0.030, rise)
    chest = smoothstep(-0.030, -0.130, p[:, 1])
    return weights_of(len(p), head=head, neck=(1 - head) * (1 - chest), upperChest=(1 - head) * chest)


def _face_colour(head: Head) -> Array:
    """Skin with red lips, a dark line at the lashes, warm cheeks, nose tip and nostrils, and the mouth's inside."""
    p = head.net.points
    colour = np.tile(SKIN, (len(p), 1))

    def blend(weight: Array, ink: Array) -> None:
        colour[:] += np.clip(weight, 0, 1)[:, None] * (ink - colour)

    blush = srgb("dd8f78")
    for sign in (1, -1):
        d = ((p[:, 0] - sign * 0.041) / 0.018) ** 2 + ((p[:, 1] - 0.046) / 0.014) ** 2
        blend(0.34 * np.exp(-d) * (p[:, 2] > 0.03), blush)
        hole = (p - NOSTRIL * [sign, 1, 1]) / [0.0030, 0.0040, 0.0036]
        blend(1.0 * np.exp(-((hole**2).sum(1) ** 2)), srgb("5a2e28"))
    blend(0.25 * np.exp(-(((p - [0, 0.050, 0.113]) / 0.010) ** 2).sum(1)), blush)
    lips = {0.0: "8f4745", 0.32: "bd6b64", 0.68: "c4736b", 1.0: "cc8675", -1.0: "84403f", -2.0: "5f2a2c"}
    for q, ids in zip(head.mouth.q, head.mouth.ids, strict=True):
        if q in lips:
            colour[ids] = srgb(lips[q])
        elif q < -2:
            colour[ids] = DARK * (0.8 if q > -3.5 else 0.35)
    colour[head.mouth.ids.max() + 1] = DARK * 0.35
    lash, line = srgb("2b1a16"), srgb("b9826b")
    for eye in head.eyes.values():
        dark = eye.upper & (np.abs(eye.s) < 0.97)
        for k in (0, 1, 2):
            colour[eye.ids[k]] = np.where(dark[:, None], lash, srgb("c98f7c"))
        half = 0.55 * (eye.upper & (np.abs(eye.s) < 0.97))[:, None]
        colour[eye.ids[3]] += half * (srgb("6a4436") - colour[eye.ids[3]])
        colour[eye.ids[5]] += 0.30 * eye.upper[:, None] * (line - colour[eye.ids[5]])
    return colour


def _face_parts() -> list[Part]:
    head = head_net()
    lift = humanoid().tpose[humanoid().index["head"]]
    shapes = Shapes(head).all()
    weights, normals, colour = _neck_weights(head.net.points), head_normals(head), _face_colour(head)
    contact = head.net.points[head.mouth.ids[head.mouth.q.index(0.0)]]
    front = contact[:, 2].max()

    def part(name: str, piece: Piece, joint: str, roughness: float, morphs: dict[str, Array] | None = None) -> Part:
        piece.net.points = piece.net.points + lift
        return make_part(
            name, piece.net, piece.normals, weights_of(len(piece.net.points), **{joint: 1.0}), piece.colour, roughness, morphs
        )

    eyebrows, _ = brows()
    upper, lower = teeth(True, front - 0.0100, 0.0138), teeth(False, front - 0.0126, 0.0148)
    lick = tongue(front - 0.0170, 0.0152)
    parts = [
        part("leftEye", eyeball(1), "leftEye", 0.25),
        part("rightEye", eyeball(-1), "rightEye", 0.25),
        part("brows", eyebrows, "head", 0.9, brow_shapes(eyebrows.net.points)),
        part("ears", ears(), "head", 0.7),
        part("hair", hair(), "head", 0.75),
        part("upperTeeth", upper, "head", 0.35),
        part("lowerTeeth", lower, "head", 0.35, jaw_shapes(lower.net.points)),
        part("tongue", lick, "head", 0.45, tongue_shapes(lick.net.points)),
    ]
    head.net.points = head.net.points + lift
    return [make_part("face", head.net, normals, weights, colour, 0.7, shapes), *parts]


def sculpt() -> Character:
    """Model the character from nothing (some minutes); `cospeech.export.mannequin.build` loads the kept result instead."""
    parts = ease_parts([*_face_parts(), *hands(), *clothes()])
    return Character(humanoid(), tuple(replace(p, morphs={k: v for k, v in p.morphs.items() if v.any()}) for p in parts))
