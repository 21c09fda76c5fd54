"""The part of a picture that differs from the bare backdrop: pictures of a film are drawn, sent and encoded as such parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Patch"]


class Patch(NamedTuple):
    """A part of a picture; the rest of it is the bare backdrop.

    Attributes:
        top: the row of its first pixel, even.
        left: the column of its first pixel, even.
        pixels: (h, w, 3) 8-bit sRGB.
    """

    top: int
    left: int
    pixels: NDArray[np.uint8]

    def paste(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Paste it into a picture (H, W, 3), which is changed and returned."""
        height, width, _ = self.pixels.shape
        picture[self.top : self.top + height, self.left : self.left + width] = self.pixels
        return picture
