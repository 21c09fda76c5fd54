"""Motion as bytes for the studio's page; see `cospeech.studio.messages.MotionHeader`."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from ..errors import InternalError
from ..motion.motion import Motion
from ..motion.skeletons.arkit import ARKIT
from ..rules.options import FPS_RANGE
from .messages import MotionHeader

__all__ = ["frame_bytes", "read_motion", "write_motion"]

_FLOAT = np.dtype("<f4")


def write_motion(motion: Motion, path: Path) -> None:
    """Write a motion of our humanoid. A motion without a face has weights of zero, and names none in its header."""
    weights = [] if motion.face is None else list(ARKIT)
    header = MotionHeader(fps=motion.fps, frames=len(motion), joints=list(motion.skeleton.names), weights=weights)
    text = header.model_dump_json().encode()
    text += b" " * (-len(text) % 4)
    with path.open("wb") as file:
        file.write(struct.pack("<I", len(text)) + text)
        for values in (motion.root, motion.rotations, _face(motion)):
            file.write(np.ascontiguousarray(values, _FLOAT).tobytes())


def read_motion(path: Path) -> Motion:
    """Read a file of `write_motion`; float32 motion is read back exactly.

    Raises:
        InternalError: it is something else.
    """
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data)
    header = MotionHeader.model_validate_json(data[4 : 4 + length])
    values = np.frombuffer(data, _FLOAT, offset=4 + length)
    frames, joints = header.frames, len(header.joints)
    if len(values) != frames * (3 + 4 * joints + len(ARKIT)) or not FPS_RANGE[0] <= header.fps <= FPS_RANGE[1]:
        raise InternalError("a motion of the studio is damaged")
    root, rotations, face = np.split(values, np.cumsum([3 * frames, 4 * joints * frames]))
    weights = face.reshape(frames, -1) if header.weights else None
    return Motion(header.fps, rotations.reshape(frames, joints, 4), root.reshape(frames, 3), weights)


def frame_bytes(frame: Motion) -> bytes:
    """One frame of a live session: float64 time, then float32 root, rotations and face."""
    values = [frame.root[0], frame.rotations[0].ravel(), _face(frame)[0]]
    return struct.pack("<d", frame.start) + np.concatenate(values).astype(_FLOAT).tobytes()


def _face(motion: Motion) -> np.ndarray:
    return np.zeros((len(motion), len(ARKIT)), _FLOAT) if motion.face is None else motion.face
