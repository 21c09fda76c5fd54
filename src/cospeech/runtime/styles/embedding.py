"""What a model knows of a style: of one of its speakers, or from an example of any length."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from ...motion.motion import Motion
from ...motion.poses import Pose, find_pose
from ...motion.rotations import Array, axis_angle_to_quat, quat_multiply, quat_rotate
from ..bundles.spec import BundleFacts

__all__ = ["StyleEmbedding", "StyleMixture", "encode_motion", "mix", "standardise_example", "stretches", "average_parts"]

LONGEST, PIECE = 120.0, 10.0  # s; ours: of a longer example, twelve pieces spread evenly over it are looked at
ASIDE, FACING = 0.25, np.pi / 4  # metres and radians; ours: a place or a heading beyond belongs to the room, not to the person


@dataclass(frozen=True, eq=False)
class StyleEmbedding:
    """A style in the standardised numbers of a system; None: the system does not use this number."""

    code: Array
    """(C,) what the network is given; of no width for a system that has no codes."""
    speaker_mean: Array
    """(D,) mean pose."""
    beginnings: Array
    """(n, τ, D) stretches that an autoregressive network may begin with."""
    speaker_std: Array | None = None
    """(D,) standard deviation, for a flow that knows poses by their recording's own mean and standard deviation."""
    poses: tuple[Array, ...] = ()
    """(T, D) each: the poses of an example; nothing for a speaker by name."""
    model_mean: Array | None = None
    """(D,) mean of what a network of windows makes in this style, which ``speaker_mean`` takes the place of."""
    style_gain: Array | None = None
    """(D,) factors on its poses, so that they deviate as the speaker's do."""
    live_model_mean: Array | None = None
    """(D,) and (D,): the same of the network of frames."""
    live_style_gain: Array | None = None


StyleMixture = tuple[tuple[float, StyleEmbedding], ...]
"""Styles with their shares, in sum 1."""


def average_parts(parts: Iterable[tuple[float, Array]]) -> Array:
    """The weighted mean in float32; a single part as it is, to the bit."""
    parts = list(parts)
    if len(parts) == 1:
        return np.asarray(parts[0][1], np.float32)
    return np.sum([share * values for share, values in parts], 0).astype(np.float32)  # type: ignore[no-any-return]


def mix(mixture: StyleMixture) -> StyleEmbedding:
    """One style out of several: the weighted means of their numbers; it has no examples and no beginnings."""
    values: dict[str, Any] = {}
    for name in ("code", "speaker_mean", "speaker_std", "model_mean", "style_gain", "live_model_mean", "live_style_gain"):
        parts = [(share, getattr(style, name)) for share, style in mixture if getattr(style, name) is not None]
        values[name] = average_parts(parts) if parts else None
    return StyleEmbedding(**values, beginnings=np.zeros((0, 0, 0), np.float32))


def standardise_example(system: BundleFacts, motion: Motion, least: float, name: str) -> tuple[Array, ...]:
    """(T, D) standardised poses of an example, or of pieces of it.

    Args:
        system: the model's facts.
        motion: of any skeleton that is recognised; of one longer than two minutes, twelve pieces of ten seconds are seen.
        least: seconds that it has at least.
        name: for messages.

    Raises:
        InputError: it is shorter, or its skeleton is not recognised.
    """
    if motion.duration < least:
        raise InputError(f"{name} has only {motion.duration:.2f} s of motion", f"an example of style has {least:g} s at least")
    try:
        return tuple(_standardise(piece, system) for piece in _spread(motion, least))
    except InputError as error:
        raise InputError(f"{name}: {error.problem}", error.hint) from None


def _spread(motion: Motion, least: float) -> list[Motion]:
    """The whole of it, or pieces evenly spread, each of ``least`` seconds at least."""
    if motion.duration <= LONGEST:
        return [motion]
    length = max(round(PIECE * motion.fps), math.ceil(least * motion.fps))
    starts = np.linspace(0, len(motion) - length, round(LONGEST / PIECE)).astype(int)
    return [motion[int(start) : int(start) + length] for start in starts]


def stretches(poses: Array, length: int) -> list[Array]:
    """Stretches of this length, overlapping by half, the last one at the end; fewer frames are one stretch."""
    last = max(0, len(poses) - length)
    return [poses[start : start + length] for start in [*range(0, last, length // 2), last]]


def _standardise(motion: Motion, system: BundleFacts) -> Array:
    """(T, D) standardised poses."""
    return encode_motion(_move_to_origin(motion.resample(system.fps).retarget("humanoid")), system)


def encode_motion(body: Motion, system: BundleFacts) -> Array:
    """(T, D) standardised poses of motion on our humanoid, at whatever rate."""
    pose: Pose = find_pose(system.pose)
    source = body if pose.source == "points" else body.retarget(pose.skeleton)  # type: ignore[attr-defined]  # the others have one
    s = system.statistics
    return ((pose.encode(source) - s.pose_mean) / s.pose_std).astype(np.float32)  # type: ignore[no-any-return]


def _move_to_origin(body: Motion) -> Motion:
    """Our humanoid brought to where speakers stand, and turned to the front, if it is not there or nearly."""
    hips, root = np.asarray(body.rotations[:, 0], float), np.asarray(body.root, float).copy()
    ahead = quat_rotate(hips, np.array([0.0, 0.0, 1.0])).mean(0)
    heading = float(np.arctan2(ahead[0], ahead[2]))
    rotations = body.rotations.copy()
    middle = np.median(root, 0) * [1, 0, 1]
    if abs(heading) > FACING:
        back = axis_angle_to_quat([0, 1, 0], -heading)
        rotations[:, 0] = quat_multiply(back, hips)
        root = quat_rotate(back, root - middle) + middle
    if np.hypot(middle[0], middle[2]) > ASIDE:
        root = root - middle
    return Motion(body.fps, rotations, root.astype(np.float32))
