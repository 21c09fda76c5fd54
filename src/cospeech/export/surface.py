"""The texture of a surface, and its holes and transparency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Surface", "Texture", "normalise_normals"]


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture that is laid over a surface.

    Args:
        pixels: (H, W, 4) 8-bit sRGB and opacity; the first row is at v = 0.
        wrap: what lies beyond the edges, along u and v: ``"repeat"``, ``"mirror"`` or ``"clamp"``.
    """

    pixels: NDArray[np.uint8]
    wrap: tuple[str, str] = ("repeat", "repeat")


@dataclass(frozen=True, eq=False)
class Surface:
    """Texture and opacity of a part.

    Args:
        texture: multiplied with the colour of the part; None for plain colour.
        places: (V, 2) float32 texture coordinates of the vertices.
        opacity: (V,) float32, multiplied with that of the texture.
        cutoff: opacity below which there is a hole; 0 for a surface without holes; None for a translucent surface.
    """

    texture: Texture | None
    places: NDArray[np.float32]
    opacity: NDArray[np.float32]
    cutoff: float | None = 0.0


def normalise_normals(normals: NDArray[np.floating]) -> NDArray[np.float32]:
    """Normals (V, 3) of length 1, as glTF demands to float32; where a surface has none, up."""
    exact = normals.astype(np.float64)
    length = np.linalg.norm(exact, axis=1, keepdims=True)
    return np.where(length > 1e-12, exact / np.maximum(length, 1e-12), (0.0, 1.0, 0.0)).astype(np.float32)
