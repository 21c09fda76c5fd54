"""What a session can be given beside speech: a face, and motion that it continues from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from ..errors import InputError
from ..motion.edit import OffsetFade, decay
from ..motion.motion import Motion
from ..motion.rotations import Array
from .network import Network
from .styles.embedding import encode_motion
from .system import System

__all__ = [
    "NOTHING",
    "OFFLINE",
    "Conditioning",
    "ConditioningFace",
    "Seam",
    "check_conditioning",
    "poses_before",
    "read_conditioning",
]

FADE = 0.5  # s; ours: as styles are faded
OFFLINE = "play it offline: look_ahead=inf, as `cospeech generate` does"
"""The hint of an error where speech is not heard as a whole."""


_TRAIN = (
    "train a chain of generation with model.face_teacher_forcing and model.seed_dropout (docs/models/chain_of_generation.md)"
)


class ConditioningFace:
    """Weights of a face over time; after its end it fades out within half a second.

    Args:
        motion: with a face.

    Raises:
        InputError: it has none.
    """

    def __init__(self, motion: Motion) -> None:
        if motion.face is None or not len(motion):
            raise InputError(
                "the motion for the option face has no face", "name a file with ARKit weights: .json, .csv or .glb"
            )
        self._fps, self._duration = motion.fps, motion.duration
        self._weights = np.clip(motion.face, 0, 1).astype(np.float32)

    def at(self, times: Array) -> tuple[Array, Array]:
        """(T,) seconds → (T, 52) weights, and (T, 1) how far they are given, 0 … 1; before it begins, its first ones."""
        last = len(self._weights) - 1
        place = np.clip(times * self._fps, 0, last)
        low = np.minimum(place.astype(int), max(last - 1, 0))
        part = (place - low).astype(np.float32)[:, None]
        here, there = self._weights[low], self._weights[np.minimum(low + 1, last)]
        share = np.clip(1 - (times - self._duration) / FADE, 0, 1).astype(np.float32)
        return here + part * (there - here), share[:, None]


@dataclass(frozen=True)
class Conditioning:
    """A face, and motion to continue from; None where not given."""

    face: ConditioningFace | None = None
    before: Motion | None = None
    """Motion at whose end the new poses begin."""

    @property
    def anything(self) -> bool:
        """Whether a face or a motion is given."""
        return self.face is not None or self.before is not None


NOTHING = Conditioning()


def read_conditioning(face: object, before: object) -> Conditioning:
    """Read the face and the motion to continue from.

    Raises:
        InputError: neither a Motion nor a file, or a file that cannot be read.
    """
    face_motion, past = _motion(face, "a face"), _motion(before, "motion to continue from")
    if past is not None and not len(past):
        raise InputError("the motion to continue from has no frames", "name another")
    return Conditioning(None if face_motion is None else ConditioningFace(face_motion), past)


def _motion(conditioning: object, what: str) -> Motion | None:
    if conditioning is None or isinstance(conditioning, Motion):
        return conditioning
    if not isinstance(conditioning, str | PathLike):
        raise InputError(f"{what} cannot be {str(conditioning)[:60]!r}", "a Motion, or a motion file")
    return Motion.load(conditioning)


def check_conditioning(conditioning: Conditioning, network: Network) -> None:
    """Refuse what a network does not take.

    Raises:
        InputError: it takes no such thing, or plays frame by frame.
    """
    able = network.signature.inputs
    for port, what, there in (("face", "a face", conditioning.face), ("seed", "motion to continue from", conditioning.before)):
        if there is not None and network.signature.window is None:
            raise InputError(f"{what} cannot be given while speech comes frame by frame", OFFLINE)
        if there is not None and port not in able:
            raise InputError(f"this model does not take {what}", _TRAIN)


def poses_before(system: System, motion: Motion, frames: int) -> Array:
    """(frames, D) standardised poses at the end of a motion, of the system's frames before the next one would begin; where it
    is shorter, its first pose is held.

    Raises:
        InputError: its skeleton is not recognised.
    """
    step = motion.fps / system.fps
    tail = motion[max(0, len(motion) - int(np.ceil(frames * step)) - 1) :]
    rows = encode_motion(tail.retarget("humanoid"), system)
    place = np.clip(len(tail) - step * np.arange(frames, 0, -1), 0, len(tail) - 1)
    low = np.minimum(place.astype(int), max(len(tail) - 2, 0))
    part = (place - low).astype(np.float32)[:, None]
    here, there = rows[low], rows[np.minimum(low + 1, len(tail) - 1)]
    return (here + part * (there - here)).astype(np.float32)  # type: ignore[no-any-return]


class Seam:
    """The gap between the last frame of a motion and the first frame that continues it, faded out within half a second.

    The representation of a network lacks some angles: a thumb has fewer numbers than angles; feet and eyes have none. The seam
    makes every joint continue from where it was.

    Args:
        before: the motion, of any skeleton that is recognised; one frame at least.
        fps: of the motion that continues it.
        still: joints that are not generated, and stay as they are.
        has_place: whether the hips' place is generated.
    """

    def __init__(self, before: Motion, fps: float, *, still: Sequence[int] = (), has_place: bool = True) -> None:
        last = before[len(before) - 1 :].retarget("humanoid")
        self._rotations, self._root = np.asarray(last.rotations[0], float), np.asarray(last.root[0], float)
        self._fps, self._still, self._has_place = fps, list(still), has_place
        self._gap: OffsetFade | None = None

    def blend(self, rotations: Array, root: Array, first: int) -> tuple[Array, Array]:
        """Rotations (n, J, 4) and places (n, 3) of the frames from ``first`` on, which is 0 at the first call."""
        if self._gap is None:
            self._gap = OffsetFade(self._rotations, self._root, rotations[0], root[0])
            self._gap.turns[self._still] = 0.0
            self._gap.way *= self._has_place
        return self._gap.apply(rotations, root, decay(len(rotations), self._fps, FADE, first))
