"""The studio: three lights, a backdrop, and how surfaces answer them.

There is a warm soft key light from the front left, a cool rim light from behind on the right, and light from all around, cool
from above and warm from the floor. All colours are linear RGB until `develop` turns them into 8-bit sRGB (IEC 61966-2-1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["KEY", "REACH", "backdrop", "develop", "draw_backdrop", "from_srgb", "scatter", "shade", "to_srgb", "tone"]

Floats = NDArray[np.float32]


def _colour(r: float, g: float, b: float) -> Floats:
    return np.array([r, g, b], np.float32)[:, None]


def _unit(x: float, y: float, z: float) -> Floats:
    v = np.array([x, y, z], np.float32)
    return v / np.linalg.norm(v)


# Directions towards the lights in the camera's frame (right, up, back to the camera), and everything below: ours, by eye.
KEY = _unit(-0.55, 0.75, 0.75)
_RIM = _unit(0.80, 0.45, -0.60)
_KEY_COLOUR = _colour(1.20, 1.12, 1.03)
_RIM_COLOUR = _colour(0.75, 0.90, 1.15)
_SKY, _GROUND = _colour(0.40, 0.44, 0.51), _colour(0.22, 0.20, 0.195)
_WRAP = _colour(0.32, 0.20, 0.16)  # how far the key reaches round an edge; red farthest, as in skin
REACH = -float(_WRAP.max())
"""Cosine between a normal and the key light, at and below which the key has no effect."""
_STRAY = np.float32(0.25)  # share of the key that is reflected into its own shadows
_SHOULDER = 0.72  # linear light above which highlights are compressed
_STEPS, _RANGE = 16384, 2.0  # steps of linear light, and the largest value, that `develop` tells apart


def shade(normal: Floats, sight: Floats, colour: Floats, roughness: Floats, open_sky: Floats, lit: Floats) -> Floats:
    """Compute the light that surface points send to the camera, linear RGB (3, N).

    Args:
        normal: (3, N) unit normals in the camera's frame (right, up, back to the camera).
        sight: (3, N) unit directions from the points to the camera, same frame.
        colour: (3, N) linear albedo.
        roughness: (N,) 0 mirror … 1 chalk.
        open_sky: (N,) 0 … 1, how much of the surroundings the point sees.
        lit: (N,) 0 … 1, how much of the key it sees.
    """
    out = scatter(normal, open_sky, lit)
    lit = _STRAY * open_sky + (1 - _STRAY) * lit
    out *= colour
    edge = 1 - np.clip(_dot(normal, sight), 0, 1)
    rim = np.maximum(_RIM @ normal + np.float32(0.25), 0) * (edge * edge * edge) * open_sky
    out += _RIM_COLOUR * (rim * np.float32(0.55))
    half = KEY[:, None] + sight
    half /= np.sqrt(_dot(half, half))
    sharp = 2 / np.maximum(roughness, np.float32(0.12)) ** 4  # Blinn–Phong exponent of a GGX lobe (Walter et al. 2007)
    gloss = np.exp(sharp * (_dot(normal, half) - 1)) * (sharp + 8)  # cosine power as a spherical Gaussian
    gloss *= np.maximum(KEY @ normal, 0) * lit * np.float32(0.04 / 8 / np.pi)  # 0.04: reflectance of skin, cloth, plastics
    out += _KEY_COLOUR * gloss
    return out


def scatter(normal: Floats, open_sky: Floats, lit: Floats) -> Floats:
    """Compute the diffuse light of a white surface, (3, N); arguments as of `shade`."""
    diffuse = np.maximum((KEY @ normal + _WRAP) / (1 + _WRAP), 0)
    up = np.float32(0.5) + np.float32(0.5) * normal[1]
    out: Floats = (_GROUND + (_SKY - _GROUND) * up) * open_sky
    out += _KEY_COLOUR * (diffuse * (_STRAY * open_sky + (1 - _STRAY) * lit))
    return out


def _dot(a: Floats, b: Floats) -> Floats:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def backdrop(width: int, height: int, colour: tuple[int, int, int]) -> Floats:
    """A paper backdrop lit from the front: (3, height, width) linear RGB around the 8-bit sRGB ``colour``.

    It changes only from top to bottom, so that pictures set side by side show no seam.
    """
    y = np.linspace(0, 1, height, dtype=np.float32)
    fall = 0.90 + 0.20 * np.exp(-(((y - 0.42) / 0.50) ** 2))
    column = from_srgb(np.array(colour, np.float32) / 255)[:, None] * fall
    return np.ascontiguousarray(np.broadcast_to(column[:, :, None], (3, height, width)), np.float32)


def draw_backdrop(width: int, height: int, colour: tuple[int, int, int]) -> NDArray[np.uint8]:
    """The bare `backdrop` as a picture (H, W, 3), 8-bit sRGB."""
    return np.ascontiguousarray(develop(backdrop(width, height, colour)).transpose(1, 2, 0))


def from_srgb(value: NDArray[np.floating]) -> NDArray[np.floating]:
    """sRGB 0 … 1 → linear light."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def to_srgb(value: NDArray[np.floating]) -> NDArray[np.floating]:
    """Linear light 0 … 1 → sRGB."""
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)


def _curve() -> Floats:
    linear = np.arange(_STEPS) * (_RANGE / _STEPS)
    room = 1 - _SHOULDER
    soft = np.where(linear <= _SHOULDER, linear, _SHOULDER + room * (1 - np.exp(-(linear - _SHOULDER) / room)))
    return (255 * to_srgb(soft)).astype(np.float32)


_TONES = _curve()
_CURVE = np.round(_TONES).astype(np.uint8)


def develop(light: Floats) -> NDArray[np.uint8]:
    """Linear light of any shape → 8-bit sRGB with a soft shoulder, so that highlights do not burn out."""
    return _CURVE.take(_step(light), mode="clip")


def tone(light: Floats) -> Floats:
    """As `develop`, but 0 … 255 with fractions."""
    return _TONES.take(_step(light), mode="clip")


def _step(light: Floats) -> NDArray[np.intp]:
    step = light * np.float32(_STEPS / _RANGE)
    return np.clip(step, 0, _STEPS - 1, out=step).astype(np.intp)  # faster than maximum, then minimum
