"""A format of one's own, in a package of one's own: the places of both hands as text, one line per frame."""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np

from cospeech import Motion, export

FORMAT = export.Format(
    module=__name__,
    what="places of the hands: x y z of the left one, then of the right one, metres",
    opens="numpy.loadtxt, or any text editor",
    holds=("body",),
)


class Writer(export.Writer):
    """Writes a line per frame."""

    _file: IO[str] | None = None

    def _begin(self, temporary: Path) -> None:
        """A file is about to be written: ``temporary`` becomes the file once all is done."""
        self._file = temporary.open("w", encoding="ascii", newline="")

    def _write(self, motion: Motion) -> None:
        """A piece of motion: (T, J, 4) rotations and (T, 3) places of the root, of ``motion.skeleton``."""
        hands = [motion.skeleton.index[name] for name in ("leftHand", "rightHand")]
        places = motion.positions()[:, hands]  # (T, 2, 3) metres
        np.savetxt(self._file, places.reshape(len(motion), 6), "%.4f")

    def _finish(self) -> None:
        """The last piece has been written."""
        self._discard()

    def _discard(self) -> None:
        """Close what is open; called at the end, and where something fails."""
        if self._file is not None:
            self._file.close()
