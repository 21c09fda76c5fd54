"""Frames as JSON texts: one per WebSocket message, or one per line (NDJSON).

The first text describes the others, and the last one ends the stream:

    {"type": "start", "version": 1, "fps": 60, "latency": 1.6, "joints": ["hips", …], "parents": [-1, …],
     "offsets": [[x, y, z], …], "face": ["eyeBlinkLeft", …]}
    {"type": "frame", "frame": 0, "time": 0.0, "root": [x, y, z], "rotations": [[x, y, z, w], …], "face": [0.0, …]}
    {"type": "end", "frames": 660}

Metres, +Y up, +Z out of the face; rotations are local, of a T-pose with identity rest rotations. ``time`` is in seconds of the
audio clock, which is 0 where the speech begins.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...motion.motion import Motion
from ...motion.skeleton import Skeleton
from ...motion.skeletons.arkit import ARKIT

__all__ = ["VERSION", "JsonEncoder"]

VERSION = 1
_DIGITS = 5  # of a number: a hundredth of a millimetre, a thousandth of a degree (ours)


class JsonEncoder:
    """Frames of motion → texts.

    Args:
        fps: of the motion.
        latency: seconds by which a frame comes after its sound.
        skeleton: of the motion.
        face: whether the motion has one.
    """

    def __init__(self, fps: float, latency: float, skeleton: Skeleton, *, face: bool) -> None:
        self._frames, self._fps = 0, fps
        self._start = {
            "type": "start", "version": VERSION, "fps": fps, "latency": round(latency, _DIGITS),
            "joints": list(skeleton.names), "parents": list(skeleton.parents),
            "offsets": _shorten(skeleton.offsets), "face": list(ARKIT) if face else [],
        }  # fmt: skip

    def begin(self) -> bytes:
        """The first text."""
        return _text(self._start)

    def frames(self, motion: Motion) -> Iterator[list[bytes]]:
        """The text of each frame."""
        face = None if motion.face is None else _shorten(motion.face)
        root, rotations = _shorten(motion.root), _shorten(motion.rotations)
        for k in range(len(motion)):
            time = round(motion.start + k / motion.fps, 6)
            frame = {
                "type": "frame",
                "frame": round(time * self._fps),
                "time": time,
                "root": root[k],
                "rotations": rotations[k],
            }
            self._frames += 1
            yield [_text(frame if face is None else frame | {"face": face[k]})]

    def end(self) -> bytes:
        """The last text."""
        return _text({"type": "end", "frames": self._frames})


def _shorten(values: NDArray[Any]) -> Any:
    """Nested lists of numbers with few digits; rounded as doubles, because a float32 is written with all digits of a double."""
    return (np.round(values.astype(np.float64), _DIGITS) + 0.0).tolist()  # + 0.0: no negative zeros


def _text(value: dict[str, object]) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode()
