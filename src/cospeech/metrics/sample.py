"""Arguments and result of every registered metric: `Sample`, `Tools` and `Score`; see `cospeech.metrics.metric`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from ..audio.speech import Speech
from ..errors import InputError
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT
from .movement import Track

__all__ = ["FeatureNet", "Sample", "Score", "Tools", "select_points", "select_vectors", "pose_vectors"]

PATS, MASKED = 52, (0, 7, 8, 9)  # key points of PATS; neck, nose and eyes of them (Mix-StAGE metrics.py)

_SHAPES: dict[str, tuple[int, int | None]] = {
    "positions": (3, 3), "points": (3, 2), "rotations": (3, 4), "face": (2, len(ARKIT)), "semantics": (1, None),
}  # fmt: skip
"""Field of a `Sample` → dimensions of its array, and the length of the last."""


@dataclass(frozen=True, eq=False)
class Sample:
    """One recording as metrics see it, in read-only arrays; what is not known is None.

    Args:
        name: of the recording.
        fps: frames per second.
        positions: (T, J, 3) metres, Y up; joint 0 is the root.
        points: (T, K, 2) key points, pixels of the corpus with y up; point 0 is the root.
        rotations: (T, J, 4) local rotations, xyzw.
        names: of the J joints.
        face: (T, 52) ARKit weights in the order of `cospeech.motion.skeletons.arkit.ARKIT`.
        track: hips, shoulders, elbows and wrists (beat and movement metrics).
        speech: the speech of the recording.
        semantics: (T,) semantic score of each frame, 0 … 1.
        label: speaker or style.
        condition: name of the speech; samples with the same one are takes of the same speech. ``name`` if empty.
        group: name of the recording that it is a take or a part of, such as a window. ``condition`` if empty.
        seed_frames: number of first frames that the system was given and did not make.

    Raises:
        InputError: shapes or lengths disagree, a value is not finite, or ``seed_frames`` is negative.
    """

    name: str
    fps: float
    positions: Array | None = None
    points: Array | None = None
    rotations: Array | None = None
    names: tuple[str, ...] = ()
    face: Array | None = None
    track: Track | None = None
    speech: Speech | None = None
    semantics: Array | None = None
    label: str = ""
    condition: str = ""
    group: str = ""
    seed_frames: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise InputError(f"{self.name!r} at {self.fps} frames per second")
        if self.seed_frames < 0:
            raise InputError(f"{self.seed_frames} seed frames of {self.name!r}", "0 or more")
        lengths = set()
        for name, dims in _SHAPES.items():
            value = getattr(self, name)
            if value is None:
                continue
            if value.ndim != dims[0] or (dims[1] is not None and value.shape[-1] != dims[1]):
                raise InputError(f"{name} of {self.name!r} have shape {value.shape}")
            if not np.isfinite(value).all():
                raise InputError(f"{name} of {self.name!r} hold values that are not finite")
            lengths.add(len(value))
            object.__setattr__(self, name, _protect(value))
        if len(lengths) > 1:
            raise InputError(f"arrays of {self.name!r} have {sorted(lengths)} frames", "all of one length")
        if self.track is not None:
            arrays = {each.name: getattr(self.track, each.name) for each in fields(self.track)}
            safe: dict[str, Any] = {name: _protect(value) for name, value in arrays.items() if isinstance(value, np.ndarray)}
            object.__setattr__(self, "track", replace(self.track, **safe))
        object.__setattr__(self, "condition", self.condition or self.name)
        object.__setattr__(self, "group", self.group or self.condition)

    def __len__(self) -> int:
        for value in (self.positions, self.points, self.rotations, self.face, self.semantics):
            if value is not None:
                return len(value)
        return 0 if self.track is None else len(self.track.hips)


def _protect(values: Array) -> Array:
    """A read-only view of an array, because all metrics share one sample."""
    view = values.view()
    view.flags.writeable = False
    return view


def pose_vectors(sample: Sample) -> Array:
    """(T, D) the pose as one vector per frame: positions (or points) less the root's, without the root.

    Raises:
        InputError: the sample has neither, or a root alone.
    """
    values = sample.positions if sample.positions is not None else sample.points
    if values is None:
        raise InputError(f"{sample.name!r} has neither positions nor key points")
    if values.shape[1] < 2:
        raise InputError(f"{sample.name!r} has {values.shape[1]} joints", "a root and at least one more")
    return np.asarray(values[:, 1:] - values[:, :1], np.float64).reshape(len(values), -1)


def select_points(count: int) -> list[int]:
    """Numbers of the points that Mix-StAGE scores: of PATS' 52 all but neck, nose and eyes; else all but the root."""
    return [k for k in range(count) if k not in (MASKED if count == PATS else (0,))]


def select_vectors(sample: Sample) -> Array:
    """(T, D) as `pose_vectors`; for PATS' key points without neck, nose and eyes (`select_points`).

    Raises:
        InputError: as `pose_vectors`.
    """
    poses = pose_vectors(sample)
    if sample.positions is not None or sample.points is None:
        return poses
    keep = [k - 1 for k in select_points(sample.points.shape[1])]
    return poses.reshape(len(poses), -1, 2)[:, keep].reshape(len(poses), -1)


@dataclass(frozen=True)
class FeatureNet:
    """A feature network, or any other function of a window. FGD, IS and clustering hold for *this* one and no other.

    Args:
        name: printed beside every figure that depends on it.
        function: (N, frames, D) windows → (N, F) features (or class probabilities). A network must be in evaluation mode.
        frames: length of a window.
        hop: frames from one window to the next.
        poses: sample → (T, D), the poses that the function takes; default: `pose_vectors`.
    """

    name: str
    function: Callable[[Array], Array]
    frames: int
    hop: int
    poses: Callable[[Sample], Array] = pose_vectors

    def windows(self, sample: Sample) -> Array:
        """(N, F) features of the windows of one sample (never across clips); N is 0 where it is shorter than a window."""
        poses = self.poses(sample)
        starts = range(0, len(poses) - self.frames + 1, self.hop)
        if not starts:
            return np.zeros((0, 0))
        result = np.asarray(self.function(np.stack([poses[k : k + self.frames] for k in starts])), np.float64)
        if result.ndim != 2 or len(result) != len(starts):
            raise InputError(f"{self.name!r} made {result.shape} of {len(starts)} windows", "one row per window")
        if not np.isfinite(result).all():
            raise InputError(f"{self.name!r} made features of {sample.name!r} that are not finite")
        return result


@dataclass(frozen=True, eq=False)
class Tools:
    """What the caller passes to metrics that need it.

    Args:
        features: a named feature network (FGD, clustering, multimodality of features).
        classifier: windows → class probabilities (inception score).
        embedding: (N, F) → (N, 2), such as t-SNE (clustering as published).
        centres: (K, 240) cluster centres of PATS (mode F1).
        seed: of bootstrap and splits.
    """

    features: FeatureNet | None = None
    classifier: FeatureNet | None = None
    embedding: Callable[[Array], Array] | None = None
    centres: Array | None = None
    seed: int = 0


@dataclass(frozen=True)
class Score:
    """A value, its 95 % interval over recordings (None where there is one only), and how many things it is computed from.

    ``draws`` are the values for recordings (groups of samples) drawn with replacement, some of those that the interval is made
    of. Draw k takes the same ones for every system that is scored on them, so two systems can be compared draw by draw.
    """

    value: float
    interval: tuple[float, float] | None = None
    count: int = 1
    note: str = ""
    draws: tuple[float, ...] = field(default=(), repr=False)
