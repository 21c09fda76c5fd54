"""Motion: the type that every generator returns and every exporter takes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import isfinite
from numbers import Real
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..limits import JOINT_FRAMES, MOTION_RATES
from .rotations import Array, quat_continuous, quat_slerp
from .skeleton import Skeleton, humanoid
from .skeletons.arkit import ARKIT, ARKIT_MIRROR

if TYPE_CHECKING:
    from ..export.notebook import NotebookView

__all__ = ["Motion"]

_UNIT = 0.02  # tolerance of a squared length [ours: float16 is off by 0.001, careless interpolation by more]


@dataclass(frozen=True, eq=False)
class Motion:
    """A piece of motion at a constant frame rate.

    Args:
        fps: frames per second.
        rotations: (T, J, 4) local rotations, xyzw, unit length, without sign flips from frame to frame.
        root: (T, 3) position of the root joint in metres, Y up, the character facing +Z.
        face: (T, 52) ARKit weights in 0 … 1 in the order of `cospeech.motion.skeletons.arkit.ARKIT`, or None.
        skeleton: its J joints; our humanoid if not given.
        start: time of the first frame in seconds; each chunk of a stream has its own.

    Raises:
        InputError: shapes disagree, rotations are not of unit length, fps is not 0.0001 … 10,000, or a value or ``start`` is
            not a finite number.
    """

    fps: float
    rotations: Array
    root: Array
    face: Array | None = None
    skeleton: Skeleton = None  # type: ignore[assignment]  # filled in below
    start: float = 0.0

    def __post_init__(self) -> None:
        if self.skeleton is None:
            object.__setattr__(self, "skeleton", humanoid())
        if not isinstance(self.skeleton, Skeleton):
            raise InputError(f"{self.skeleton!r} is not a skeleton", "cospeech.motion.skeleton.find_skeleton(name) makes one")
        _check_rate(self.fps)
        _check_start(self.start)
        for name in ("fps", "start"):
            if type(getattr(self, name)) not in (int, float):  # float32 does not tell frames apart after some hours
                object.__setattr__(self, name, float(getattr(self, name)))
        for name in ("rotations", "root", "face"):
            if name != "face" or self.face is not None:
                object.__setattr__(self, name, _numbers(name, getattr(self, name)))
        frames, joints = self.rotations.shape[:1], len(self.skeleton)
        if self.rotations.shape != (*frames, joints, 4) or self.root.shape != (*frames, 3):
            raise InputError(f"motion of {joints} joints with rotations {self.rotations.shape}, root {self.root.shape}")
        lengths = np.einsum("tjk,tjk->tj", self.rotations, self.rotations)
        if np.abs(lengths - 1).max(initial=0) > _UNIT:
            raise InputError(
                "rotations of a motion are not of unit length", "cospeech.motion.rotations.quat_normalize makes them so"
            )
        if self.face is not None and self.face.shape != (*frames, len(ARKIT)):
            raise InputError(f"face of shape {self.face.shape}, expected {(*frames, len(ARKIT))}")

    def __repr__(self) -> str:
        face = "without a face" if self.face is None else "with a face"
        return f"Motion({len(self)} frames at {self.fps:g} fps, {len(self.skeleton)} joints, {face})"

    def __len__(self) -> int:
        return len(self.rotations)

    @property
    def duration(self) -> float:
        """Seconds: frames over fps."""
        return len(self) / self.fps

    @property
    def times(self) -> Array:
        """(T,) time of each frame in seconds, from ``start``."""
        return self.start + np.arange(len(self)) / self.fps

    def __getitem__(self, frames: slice) -> Motion:
        """Frames ``a:b`` as a Motion with its own start time."""
        if not isinstance(frames, slice):
            first = frames if isinstance(frames, int | np.integer) else 3
            end = "" if first == -1 else first + 1
            raise InputError(f"motion[{frames!r:.40}] is no slice of a motion", f"one frame is motion[{first}:{end}]")
        if any(isinstance(end, float | np.floating) for end in (frames.start, frames.stop)):
            hint = f"of seconds: cospeech.motion.edit.cut(motion, {frames.start}, {frames.stop})"
            raise InputError("a slice of a motion counts frames, in whole numbers", hint)
        if (frames.step or 1) != 1:
            raise InputError("a motion is cut with a slice of step 1; use resample() to change its rate")
        first = frames.indices(len(self))[0]
        return replace(
            self,
            rotations=self.rotations[frames],
            root=self.root[frames],
            face=None if self.face is None else self.face[frames],
            start=self.start + first / self.fps,
        )

    @staticmethod
    def concatenate(chunks: Iterable[Motion]) -> Motion:
        """Join chunks of one fps and skeleton in time; sign flips between chunks are removed."""
        parts = list(chunks)
        if not parts:
            raise InputError("nothing to concatenate")
        head = parts[0]
        for part in parts[1:]:
            if part.fps != head.fps or part.skeleton != head.skeleton or (part.face is None) != (head.face is None):
                raise InputError("chunks differ in fps, skeleton or in having a face")
        return replace(
            head,
            rotations=quat_continuous(np.concatenate([p.rotations for p in parts])),
            root=np.concatenate([p.root for p in parts]),
            face=None if head.face is None else np.concatenate([p.face for p in parts if p.face is not None]),
        )

    def resample(self, fps: float) -> Motion:
        """The same motion at another rate: slerp for rotations, linear for the rest; the duration changes by less than a frame.

        Raises:
            InputError: the rate is out of range, or the motion would become larger than motion in memory may be.
        """
        _check_rate(fps)
        if fps == self.fps or len(self) == 0:
            return replace(self, fps=fps)
        count = max(1, int(np.ceil(len(self) * fps / self.fps - 1e-9)))
        if count > len(self) and count * len(self.skeleton) > JOINT_FRAMES:
            problem = f"{len(self):,} frames at {self.fps:g} fps would become {count:,} at {fps:g}"
            raise InputError(problem, f"at most {JOINT_FRAMES // len(self.skeleton):,}: cut the motion into pieces")
        at = np.minimum(np.arange(count) * (self.fps / fps), len(self) - 1)
        low = np.minimum(at.astype(int), len(self) - 1)
        high = np.minimum(low + 1, len(self) - 1)
        t = at - low

        def mix(x: Array) -> Array:
            return (x[low] + (x[high] - x[low]) * t[:, None]).astype(x.dtype)

        rotations = quat_slerp(self.rotations[low], self.rotations[high], t[:, None]).astype(self.rotations.dtype)
        face = None if self.face is None else mix(self.face)
        return replace(self, fps=fps, rotations=quat_continuous(rotations), root=mix(self.root), face=face)

    def mirror(self) -> Motion:
        """Left and right exchanged (our humanoid only)."""
        from .skeletons.humanoid import MIRROR

        if self.skeleton.kind != "humanoid":
            raise InputError(f"cannot mirror a {self.skeleton.kind!r} skeleton", "retarget('humanoid') first")
        other = [self.skeleton.index[MIRROR.get(name, name)] for name in self.skeleton.names]
        flip = np.array([1, -1, -1, 1], self.rotations.dtype)
        return replace(
            self,
            rotations=self.rotations[:, other] * flip,
            root=self.root * np.array([-1, 1, 1], self.root.dtype),
            face=None if self.face is None else self.face[:, list(ARKIT_MIRROR)],
        )

    def positions(self) -> Array:
        """(T, J, 3) world positions of the joints in metres."""
        return self.skeleton.forward(self.rotations, self.root)[0]

    def retarget(self, target: str | Skeleton, **options: object) -> Motion:
        """This motion on another skeleton; see `cospeech.motion.retarget.retarget`."""
        from .retarget import retarget

        return retarget(self, target, **options)  # type: ignore[arg-type]

    @staticmethod
    def load(path: str | PathLike[str], **options: object) -> Motion:
        """Read a motion file; the suffix picks the reader (`cospeech.export.load`)."""
        from ..export import load

        return load(path, **options)

    def save(self, path: str | PathLike[str], **options: object) -> None:
        """Write a motion file; the suffix picks the writer (`cospeech.export.save`)."""
        from ..export import save

        save(self, path, **options)

    def show(self, audio: object = None, **options: object) -> NotebookView:
        """This motion as the output of a notebook's cell: a character to play, to turn and to hear.

        Args:
            audio: the speech that plays with it: a file or a `cospeech.Speech`.
            options: ``avatar``, the file of a character in place of our mannequin; ``height`` of the view, 120 … 4096 pixels.

        Raises:
            InputError: the audio or the avatar cannot be read, or the height is too small or too large.
        """
        from ..export.notebook import show

        return show(self, audio, **options)  # type: ignore[arg-type]


def _check_rate(fps: object) -> None:
    """Raise an InputError for a frame rate that motion cannot have."""
    try:
        fits = isinstance(fps, Real) and not isinstance(fps, bool) and MOTION_RATES[0] <= float(fps) <= MOTION_RATES[1]
    except OverflowError:  # a whole number beyond all floats
        fits = False
    if not fits:  # NaN, too
        text = repr(fps)[:40] if not isinstance(fps, int) or abs(fps) < 1e9 else "too many"  # digits of an int have a limit
        raise InputError(f"{text} frames per second", f"{MOTION_RATES[0]:g} … {MOTION_RATES[1]:g}, such as 30")


def _check_start(start: object) -> None:
    """Raise an InputError for a time that is no finite number."""
    try:
        is_time = isinstance(start, Real) and not isinstance(start, bool) and isfinite(start)
    except OverflowError:  # a whole number beyond all floats
        is_time = False
    if not is_time:
        raise InputError(f"a motion that starts at {start!r:.40}", "seconds, such as 0.0")


def _numbers(name: str, value: object) -> Array:
    """A value as an array of floats; raise an InputError if it holds anything but finite real numbers."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        raise InputError(f"{name} of a motion are not an array", "give an array of floats") from None
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} of a motion are of type {array.dtype}", "give an array of floats")
    if not np.isfinite(array).all():
        raise InputError(f"{name} of a motion holds values that are not finite")
    return array if array.dtype.kind == "f" else array.astype(float)
