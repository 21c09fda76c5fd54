"""Live Link Face over UDP, as the app sends it to Unreal's Live Link (version 6 of the packet, port 11111).

A packet has the version (uint32, little-endian), an identity ("$" and a UUID), the subject's name with its length, the frame
and the share of a frame, the rate as a fraction, and 61 float32: ARKit's 52 weights, then yaw, pitch and roll of the head and
of both eyes. All but the version is big-endian. Here JawLeft comes before JawRight and MouthLeft before MouthRight; the app's
CSV has them the other way round.
"""

from __future__ import annotations

import struct
import uuid
from collections.abc import Iterator

import numpy as np

from ...motion.motion import Motion
from ...motion.skeletons.arkit import ARKIT
from ..live_link_csv import head_and_eyes
from ..timing import fraction_of_rate
from ..to_humanoid import as_humanoid

__all__ = ["PORT", "LiveLinkEncoder"]

PORT = 11111
_VERSION = 6
_NAMESPACE = uuid.UUID("6e0a1a52-6a0b-5d0e-9c11-0b6a0f1b9f5c")  # ours, a random one: for the identities of our subjects


class LiveLinkEncoder:
    """Frames of motion → packets.

    Args:
        subject: the name that Unreal lists; the same name has the same identity on every run.
    """

    def __init__(self, subject: str = "cospeech") -> None:
        name = subject.encode()
        identity = f"${uuid.uuid5(_NAMESPACE, subject)}".encode()
        self._head = struct.pack("<I", _VERSION) + identity + struct.pack("!i", len(name)) + name

    def begin(self) -> bytes:
        """Nothing: every frame is complete."""
        return b""

    end = begin

    def frames(self, motion: Motion) -> Iterator[list[bytes]]:
        """The packet of each frame; its time counts from the beginning of the speech."""
        motion = as_humanoid(motion)
        face = np.zeros((len(motion), len(ARKIT))) if motion.face is None else np.clip(motion.face, 0, 1)
        values = np.concatenate([face, head_and_eyes(motion)], 1).astype(">f4")
        rate = fraction_of_rate(motion.fps)
        for k, row in enumerate(values):
            at = motion.start * motion.fps + k
            whole = int(at + 1e-6)
            when = struct.pack("!IfII", whole, max(at - whole, 0.0), rate.numerator, rate.denominator)
            yield [self._head + when + struct.pack("!B", len(row)) + row.tobytes()]
