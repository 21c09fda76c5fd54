"""The 52 ARKit expressions as displacement fields on the head, the brows, the teeth and the tongue.

Each is the pose at weight 1 minus the neutral face, in the frame of the head joint. Left ones are sculpted, the right ones are
their mirror images. The jaw is driven by the morphs only (``jawOpen`` and its kin): the skeleton's ``jaw`` bone carries no
weight, so that a motion with both is not applied twice. Amplitudes are ours, set by eye to match what the names mean in
Apple's ARBlendShapeLocation.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from cospeech.motion.rotations import Array
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX, ARKIT_MIRROR

from .head import EYE, EYE_RADIUS, LID, MOUTH, MOUTH_HALF, EyeRings, Head, head_solid, on_ball
from .net import smoothstep
from .solids import land

__all__ = ["Shapes", "brow_shapes", "jaw_shapes", "tongue_shapes"]

HINGE = np.array([0.0, 0.046, -0.004])  # of the jaw, just before the ear
OPEN = np.radians(17.0)  # of the jaw at jawOpen = 1
SHARE = 0.34  # of the gap that the upper lip closes at mouthClose
CORNER = np.array([MOUTH_HALF, MOUTH[1]])
UPPER_FOLLOWS = (1.0, 1.0, 1.0, 0.97, 0.84, 0.52, 0.16)  # how far each ring of the upper lid goes with its edge
LOWER_FOLLOWS = (1.0, 1.0, 1.0, 0.92, 0.72, 0.42, 0.15)


def bump(p: Array, centre: tuple[float, float], sizes: tuple[float, float]) -> Array:
    """A bell over the frontal plane, only on the front of the head."""
    d = ((p[:, 0] - centre[0]) / sizes[0]) ** 2 + ((p[:, 1] - centre[1]) / sizes[1]) ** 2
    return np.exp(-d) * smoothstep(0.005, 0.045, p[:, 2])


def vector(weight: Array, x: float | Array = 0.0, y: float | Array = 0.0, z: float | Array = 0.0) -> Array:
    """(V, 3) displacements: weight × (x, y, z)."""
    return np.stack([weight * x, weight * y, weight * z], 1)


def open_jaw(p: Array) -> Array:
    """Displacement of points that turn with the jaw at jawOpen = 1."""
    c, s = np.cos(OPEN), np.sin(OPEN)
    y, z = p[:, 1] - HINGE[1], p[:, 2] - HINGE[2]
    return np.stack([0 * y, c * y - s * z - y, s * y + c * z - z], 1)


class Shapes:
    """Expressions of the face's net."""

    def __init__(self, head: Head) -> None:
        self.head = head
        self.p = head.net.points
        count = len(self.p)
        mouth = head.mouth
        self.q = np.full(count, np.inf)
        self.s, self.side = np.zeros(count), np.zeros(count)
        for q, ids in zip(mouth.q, mouth.ids, strict=True):
            self.q[ids], self.s[ids] = q, mouth.s
            self.side[ids] = np.where(mouth.upper, 1.0, -1.0)
            self.side[ids[[0, len(ids) // 2]]] = 0.0
        self.q[int(mouth.ids.max()) + 1] = -4.5  # the end of the mouth's bag
        self.ringed = np.isfinite(self.q)
        self.full = np.sqrt(np.maximum(1 - self.s**2, 0)) * self.ringed
        self.lips = np.interp(
            np.where(self.ringed, self.q, 9), (-4, -2, -1, 1, 1.3, 1.9, 2.8, 4), (0, 0.4, 1, 1, 0.85, 0.4, 0, 0)
        )
        self.skin = head_solid(lids=False)
        tree = cKDTree(self.p)
        self.mirror = tree.query(self.p * [-1, 1, 1])[1]
        self.jaw = self._jaw_mask()

    def _jaw_mask(self) -> Array:
        p = self.p
        x, y, z = np.abs(p[:, 0]), p[:, 1], p[:, 2]
        wide = smoothstep(0.010, 0.050, x)
        skin = smoothstep(0.010 + 0.024 * wide, -0.010 - 0.016 * wide, y - MOUTH[1])
        skin = skin * smoothstep(-0.010, 0.040, z) * smoothstep(0.002, 0.050, z - 0.55 * (y + 0.020))
        c = np.abs(self.s)
        lower = 1 - 0.53 * c**2.4
        upper = 0.47 * c**3.2 - 0.05 * (1 - c**2)
        rings = np.where(self.side > 0, upper, np.where(self.side < 0, lower, 0.47))
        t = np.clip((np.where(self.ringed, self.q, 9) - 1) / 1.8, 0, 1)
        mask = np.where(self.ringed, (1 - t) * rings + t * skin, skin)
        deep = self.ringed & (self.q < -2.5)
        return np.where(deep, mask * np.where(self.side == 0, 0.9, 0.95), mask)

    def slide(self, dx: Array, dy: Array, dz: Array | float = 0.0) -> Array:
        """Move the skin sideways and up along the face, so that it neither sinks in nor lifts off."""
        moving = (np.abs(dx) + np.abs(dy) > 1e-6) & (self.p[:, 2] > 0.02)
        depth = np.zeros(len(self.p))
        here = self.p[moving] * [1, 1, 0] + [0, 0, 0.2]
        there = here + np.stack([dx, dy, 0 * dx], 1)[moving]
        down = np.tile([0, 0, -1.0], (len(here), 1))
        depth[moving] = np.clip(land(self.skin, there, down, 40)[:, 2] - land(self.skin, here, down, 40)[:, 2], -0.02, 0.02)
        return np.stack([dx, dy, depth + dz], 1)

    def flip(self, delta: Array) -> Array:
        """The same expression on the other side."""
        return delta[self.mirror] * [-1, 1, 1]

    # --- mouth ------------------------------------------------------------------------------------------------------------

    def corner(self, reach: float = 0.020, tall: float = 0.022) -> Array:
        """Weight around the left corner of the mouth."""
        return bump(self.p, tuple(CORNER), (reach, tall))

    def lip(self, upper: bool, outside: float = 0.010) -> Array:
        """Weight of one lip: full on the red, fading to the corners and over the skin beyond."""
        side = 1 if upper else -1
        t = (self.p[:, 1] - MOUTH[1]) * side
        skin = np.exp(-((np.maximum(t - 0.012, 0) / outside) ** 2)) * np.exp(-((self.p[:, 0] / 0.020) ** 2)) * (t > 0)
        skin *= smoothstep(0.03, 0.06, self.p[:, 2])
        beyond = np.where(self.ringed, np.clip((self.q - 1) / 1.8, 0, 1), 1.0)
        around = np.where(self.ringed, self.lips * self.full**0.7, 0) * (self.side == side)
        return np.where(self.ringed, np.maximum(around, skin * beyond * 0.5), 0.5 * skin)

    def mouth_area(self) -> Array:
        """Weight of the whole mouth."""
        return bump(self.p, (0.0, MOUTH[1]), (0.036, 0.024))

    def corners_in(self, share: float, forward: float) -> Array:
        """Corners towards the middle and the lips forward, as in u and o."""
        area = bump(self.p, (0.0, MOUTH[1]), (0.040, 0.028))
        ahead = bump(self.p, (0.0, MOUTH[1]), (0.022, 0.020))
        inner = np.where(self.ringed & (self.q < -1), 0.6, 1.0)
        return np.stack([-share * self.p[:, 0] * area, 0 * area, forward * ahead * inner + 0.0025 * area * np.abs(self.s)], 1)

    def roll(self, upper: bool) -> Array:
        """The red of a lip folds back over the teeth."""
        side = 1 if upper else -1
        mine = (self.side == side) * self.full**0.8
        q = np.where(self.ringed, self.q, 9)
        toward = np.interp(q, (-2, -1, 0, 1, 1.3, 1.9, 2.8), (0, 0, -0.0002, -0.0050, -0.0036, -0.0022, 0.0))
        back = np.interp(
            q, (-3, -2, -1, 0, 0.68, 1, 1.3, 1.9, 2.8), (0, -0.001, -0.0045, -0.0055, -0.0050, -0.0034, -0.002, -0.001, 0)
        )
        return vector(mine, 0, side * toward * (1.0 if upper else 1.2), back)

    def press(self) -> Array:
        """Lips flattened against each other on the left."""
        left = smoothstep(-0.25, 0.65, self.s) * self.ringed
        q = np.where(self.ringed, self.q, 9)
        squeeze = np.interp(q, (-1, 0, 1, 1.3, 1.9, 2.8), (0, 0, 0.0026, 0.0024, 0.0015, 0))
        back = np.interp(q, (-1, 0, 0.5, 1, 1.9, 2.8), (-0.001, -0.0012, -0.0020, -0.0014, -0.0004, 0))
        flat = vector(left * self.full**0.6, 0, -self.side * squeeze, back)
        w = self.corner(0.012, 0.016)
        return flat + self.slide(0.0022 * w, 0.0008 * w, -0.0012 * w)

    def mouth_shapes(self) -> dict[str, Array]:
        """All mouth expressions; left ones only."""
        w, tight, area = self.corner(), self.corner(0.012, 0.016), self.mouth_area()
        p, up, low = self.p, self.lip(True), self.lip(False)
        cheek = bump(p, (0.041, 0.044), (0.017, 0.018))
        out: dict[str, Array] = {}
        smile = self.slide(0.0088 * w, 0.0108 * w + 0.0042 * cheek, -0.0012 * w + 0.0030 * cheek)
        out["mouthSmileLeft"] = smile + vector(smoothstep(-0.3, 0.5, self.s) * self.ringed, 0, -self.side * self._thin(0.0010))
        frown = self.slide(0.0016 * w, -0.0098 * w, -0.0004 * w)
        out["mouthFrownLeft"] = frown + vector(bump(p, (0.020, 0.000), (0.014, 0.010)), 0, -0.0010, 0.0010)
        out["mouthDimpleLeft"] = self.slide(0.0060 * tight + 0.002 * w, 0.0014 * tight, -0.0034 * tight)
        out["mouthStretchLeft"] = self.slide(0.0105 * w, -0.0042 * w, -0.0008 * w)
        out["mouthPressLeft"] = self.press()
        left = smoothstep(-0.30, 0.45, np.where(self.ringed, self.s, p[:, 0] / 0.024))
        lower_down = low * left
        out["mouthLowerDownLeft"] = vector(lower_down, 0.0008, -0.0078, -0.0012)
        wing = bump(p, (0.016, 0.046), (0.009, 0.010))
        out["mouthUpperUpLeft"] = vector(up * left, 0.0004, 0.0068, -0.0006) + vector(wing, 0.0005, 0.0016, 0.0008)
        shift = self.slide(0.0095 * area, 0 * area)
        out["mouthLeft"] = shift
        out["mouthPucker"] = self.corners_in(0.44, 0.0090) + vector(self._thin(0.0012), 0, self.side, 0.8)
        out["mouthFunnel"] = self.corners_in(0.30, 0.0075) + vector(up, 0, 0.0034, 0.0015) + vector(low, 0, -0.0052, 0.0015)
        out["mouthRollUpper"], out["mouthRollLower"] = self.roll(True), self.roll(False)
        chin = bump(p, (0, -0.008), (0.020, 0.014))
        out["mouthShrugLower"] = (
            vector(low, 0, 0.0052, 0.0034) + vector(up, 0, 0.0040, 0.0014) + vector(chin, 0, 0.0040, 0.0012)
        )
        out["mouthShrugUpper"] = vector(up, 0, 0.0042, 0.0028) + vector(low, 0, 0.0016, 0.0010)
        return out

    def _thin(self, by: float) -> Array:
        """Narrowing of the red at full stretch: more at its border."""
        q = np.where(self.ringed, self.q, 9)
        return by * np.interp(q, (0, 1, 1.9, 2.8), (0, 1, 0.5, 0)) * self.full

    def jaw_shapes(self) -> dict[str, Array]:
        """Jaw expressions, and mouthClose: what closes the lips again at jawOpen = 1."""
        m = self.jaw
        turn = m[:, None] * open_jaw(self.p)
        corner = self.corner(0.016, 0.018) + self.flip(vector(self.corner(0.016, 0.018), 1))[:, 0] * -1
        turn += np.stack([-0.10 * self.p[:, 0] * corner, 0 * m, 0 * m], 1)
        out = {"jawOpen": turn}
        out["jawForward"] = vector(m, 0, -0.0005, 0.0075)
        sway = m + 0.22 * self.lip(True)
        out["jawLeft"] = vector(sway, 0.0085, 0, 0)
        rows, count = self.head.mouth.ids, self.head.mouth.ids.shape[1]
        contact = rows[self.head.mouth.q.index(0.0)]
        other = contact[(-np.arange(count)) % count]
        gap = np.where(self.head.mouth.upper[:, None], turn[other] - turn[contact], turn[contact] - turn[other])
        share = np.where(self.head.mouth.upper, SHARE, SHARE - 1)
        close = np.zeros_like(turn)
        for q, ids in zip(self.head.mouth.q, rows, strict=True):
            fade = np.interp(q, (-4, -2, -1, 1, 1.3, 1.9, 2.8), (0.0, 0.5, 1, 1, 0.95, 0.80, 0.52))
            close[ids] = fade * share[:, None] * gap
        t = (self.p[:, 1] - MOUTH[1]) * -1
        near = np.exp(-((np.maximum(t - 0.018, 0) / 0.014) ** 2)) * np.exp(-((self.p[:, 0] / 0.022) ** 2)) * (t > 0.008)
        middle = gap[count // 4]
        skin = np.where(self.ringed, 0, near * smoothstep(0.03, 0.06, self.p[:, 2])) * 0.52
        close += (SHARE - 1) * skin[:, None] * middle
        out["mouthClose"] = close
        return out

    # --- eyes, brows, cheeks, nose -----------------------------------------------------------------------------------------

    def lids(self, eye: EyeRings, upper: Array, lower: Array, across: float = 0.0) -> Array:
        """Displacement when the edges of the left lids move up by ``upper`` and ``lower`` (metres, per s) over the ball."""
        delta = np.zeros_like(self.p)
        for k, ids in enumerate(eye.ids):
            follows = np.where(eye.upper, UPPER_FOLLOWS[k], LOWER_FOLLOWS[k])
            x, y = (self.p[ids] - EYE)[:, :2].T
            dy = follows * np.where(eye.upper, upper, lower)
            dx = across * follows * (1 - eye.s**2)
            radius = EYE_RADIUS + (0.0004 if k < 2 else LID if k < 4 else LID + 0.0012)
            dz = on_ball(x + dx, y + dy, radius) - on_ball(x, y, radius)
            delta[ids] = np.stack([dx, dy, dz * (1.0 if k < 5 else follows**0.5)], 1)
        return delta

    def eye_shapes(self) -> dict[str, Array]:
        """Lids of the left eye."""
        eye = self.head.eyes["Left"]
        edge = self.p[eye.ids[1]][:, 1]
        other = edge[(-np.arange(len(edge))) % len(edge)]
        full = np.maximum(1 - eye.s**2, 0) ** 0.6
        rise = 0.0010 * full  # of the lower lid when blinking
        meet = np.where(eye.upper, other + rise - edge, 0)
        meet[[0, len(meet) // 2]] = 0.0
        out = {"eyeBlinkLeft": self.lids(eye, meet, rise)}
        out["eyeWideLeft"] = self.lids(eye, 0.0030 * full, -0.0010 * full)
        cheek = bump(self.p, (0.034, 0.062), (0.018, 0.010))
        out["eyeSquintLeft"] = self.lids(eye, -0.0022 * full, 0.0032 * full) + vector(cheek, 0, 0.0022, 0.0010)
        out["eyeLookDownLeft"] = self.lids(eye, -0.0046 * full, -0.0016 * full)
        out["eyeLookUpLeft"] = self.lids(eye, 0.0024 * full, 0.0012 * full)
        out["eyeLookInLeft"] = self.lids(eye, 0.0004 * full, 0.0002 * full, -0.0013)
        out["eyeLookOutLeft"] = self.lids(eye, 0.0004 * full, 0.0002 * full, 0.0013)
        return out

    def upper_face_shapes(self) -> dict[str, Array]:
        """Brows' skin, cheeks and nose; left ones only."""
        p = self.p
        out = brow_fields(p)
        eye = self.head.eyes["Left"]
        full = np.maximum(1 - eye.s**2, 0) ** 0.6
        out["browDownLeft"] += self.lids(eye, -0.0012 * full, 0 * full)
        puff = bump(p, (0.040, 0.018), (0.020, 0.022)) * np.where(self.ringed & (self.q < 0), 0.0, 1.0)
        away = p - [0, 0.02, 0.03]
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        both = puff + puff[self.mirror]
        out["cheekPuff"] = 0.0095 * both[:, None] * away + vector(self.mouth_area() * self.full, 0, 0, 0.0010)
        rise = bump(p, (0.038, 0.056), (0.019, 0.015))
        low = self.lids(eye, 0 * full, 0.0020 * full)
        out["cheekSquintLeft"] = self.slide(0 * rise, 0.0052 * rise, 0.0030 * rise) + low
        wing, side = bump(p, (0.0125, 0.048), (0.0085, 0.009)), bump(p, (0.012, 0.072), (0.010, 0.012))
        lift = self.lip(True) * smoothstep(-0.2, 0.6, np.where(self.ringed, self.s, p[:, 0] / 0.024))
        sneer = vector(wing, 0.0012, 0.0042, 0.0012) + vector(side, 0, 0.0010, 0.0018) + vector(lift, 0, 0.0030, 0)
        out["noseSneerLeft"] = sneer + 0.22 * out["browDownLeft"]
        part = self.lip(False)
        out["tongueOut"] = vector(part, 0, -0.0052, 0.0006) + vector(self.lip(True), 0, 0.0018, 0)
        return out

    def all(self) -> dict[str, Array]:
        """All 52, in ARKit's order."""
        left = self.mouth_shapes() | self.jaw_shapes() | self.eye_shapes() | self.upper_face_shapes()
        out = {}
        for name in ARKIT:
            if name in left:
                out[name] = left[name]
            else:
                out[name] = self.flip(left[ARKIT[ARKIT_MIRROR[ARKIT_INDEX[name]]]])
        return {name: np.where(np.abs(d) < 4e-5, 0, d) for name, d in out.items()}


def brow_fields(p: Array) -> dict[str, Array]:
    """Brow expressions as fields over the front of the head, for skin and brows alike; left ones only."""
    inner = bump(p, (0.014, 0.106), (0.016, 0.016))
    outer = bump(p, (0.041, 0.108), (0.016, 0.016))
    middle = bump(p, (0.027, 0.107), (0.018, 0.016))
    glabella = bump(p, (0.0, 0.100), (0.010, 0.014))
    other = bump(p, (-0.014, 0.106), (0.016, 0.016))
    down = vector(inner, -0.0030, -0.0066, 0.0012) + vector(middle, -0.0006, -0.0030, 0.0006)
    up = vector(outer, 0.0006, 0.0080, -0.0012) + vector(middle, 0, 0.0024, 0)
    both = vector(np.maximum(inner, other), 0, 0.0098, -0.0006) + vector(glabella, 0, 0.0010, 0)
    return {"browDownLeft": down + vector(glabella, 0, -0.0008, 0.0008), "browOuterUpLeft": up, "browInnerUp": both}


def _mirror_fields(p: Array, fields: Callable[[Array], dict[str, Array]]) -> dict[str, Array]:
    """Fields of the left and, mirrored, of the right side."""
    here, there = fields(p), fields(p * [-1, 1, 1])
    out = dict(here)
    for name in here:
        twin = ARKIT[ARKIT_MIRROR[ARKIT_INDEX[name]]]
        if twin != name:
            out[twin] = there[name] * [-1, 1, 1]
    return out


def brow_shapes(p: Array) -> dict[str, Array]:
    """Expressions of the brows' points."""

    def fields(q: Array) -> dict[str, Array]:
        out = brow_fields(q)
        return out | {"noseSneerLeft": 0.22 * out["browDownLeft"]}

    return {k: np.where(np.abs(v) < 4e-5, 0, v) for k, v in _mirror_fields(p, fields).items()}


def jaw_shapes(p: Array) -> dict[str, Array]:
    """What the lower teeth do: all of the jaw's movements."""
    one = np.ones(len(p))
    return {
        "jawOpen": open_jaw(p),
        "jawForward": vector(one, 0, -0.0005, 0.0075),
        "jawLeft": vector(one, 0.0085),
        "jawRight": vector(one, -0.0085),
    }


def tongue_shapes(p: Array) -> dict[str, Array]:
    """What the tongue does: it goes with the jaw, and out."""
    front = smoothstep(p[:, 2].min(), p[:, 2].max(), p[:, 2])
    out = vector(0.35 + 0.65 * front, 0, -0.0030 * front**2, 0.030)
    return jaw_shapes(p) | {"tongueOut": out}
