"""Manners: what a system knows of how somebody moves, of its own speakers and out of an example, any motion of any length."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.poses import Pose, find_pose
from ..motion.rotations import Array, axis_angle_to_quat, quat_multiply, quat_rotate
from .flow_bundle import FlowSystem
from .speech_frontend import System

__all__ = [
    "StyleEmbedding",
    "StyleMixture",
    "average_parts",
    "embed_flow_speaker",
    "encode_motion",
    "example",
    "latents_of",
    "standardise_example",
    "stretches",
]

SHORTEST = 1.0  # s; ours: less shows no movement
LONGEST, PIECE = 120.0, 10.0  # s; ours: of a longer example, twelve pieces spread evenly over it are looked at
SPREAD_FLOOR = 0.1  # cospeech.training.batch_loader
STRETCH = 128  # frames that a style code is made of; cospeech.training.calibration_clips
BEGINNINGS = 8  # ours: places in an example that takes begin from
ASIDE, FACING = 0.25, np.pi / 4  # metres and radians; ours: a place or a heading beyond belongs to the room, not to the person
_POINTS = {"direction-vectors": "cospeech.corpora.ted.write", "keypoints2d": "cospeech.corpora.pats.points"}
"""Representation of key points → the module whose ``points_of`` sees motion in its layout."""


@dataclass(frozen=True, eq=False)
class StyleEmbedding:
    """How somebody moves, in a system's standardised numbers."""

    code: Array
    """(style,) of no width for a system that has no codes."""
    speaker_mean: Array
    """(D,) mean pose."""
    beginnings: Array
    """(n, τ, D) stretches that a performance may begin with."""
    style_gain: Array | None = None
    """(D,) deviation, for a flow that knows poses by their recording's own mean and deviation; of a network by windows: by what
    its poses are multiplied (`WindowStatistics.style_gain`)."""
    poses: tuple[Array, ...] = ()
    """(T, D) each: the poses of an example; nothing for a speaker by name."""
    model_mean: Array | None = None
    """(D,) mean of what a network by windows makes in this style, which ``centre`` takes the place of."""


StyleMixture = tuple[tuple[float, StyleEmbedding], ...]
"""Manners with their shares, in sum 1."""


def average_parts(parts: Iterable[tuple[float, Array]]) -> Array:
    """The weighted mean in float32; a single part as it is, to the bit."""
    parts = list(parts)
    if len(parts) == 1:
        return np.asarray(parts[0][1], np.float32)
    return np.sum([share * values for share, values in parts], 0).astype(np.float32)  # type: ignore[no-any-return]


def embed_flow_speaker(system: FlowSystem, name: str) -> StyleEmbedding:
    """One of a system's speakers."""
    s, k = system.statistics, system.styles.index(name)
    each = len(s.histories) // len(system.styles)
    return StyleEmbedding(
        s.styles[k], s.speaker_mean[k], s.histories[k * each : (k + 1) * each], s.style_gain[k] if s.style_gain.size else None
    )


def example(system: FlowSystem, motion: Motion, name: str = "the example") -> StyleEmbedding:
    """What a motion shows of somebody's style; the face is not looked at.

    Args:
        system: who looks at it.
        motion: of any skeleton that is recognised; of one longer than two minutes, twelve pieces of ten seconds are seen.
        name: for messages.

    Raises:
        InputError: it is shorter than a second, or its skeleton is not recognised.
    """
    sizes = system.engine.sizes
    least = max(SHORTEST, max(8, sizes.history + 2) / system.fps)  # 8: cospeech.models.nn.conditioning.StyleEncoder
    shown = standardise_example(system, motion, least, name)
    centre, spread = np.concatenate(shown).mean(0), None
    if system.statistics.style_gain.size:
        spread = np.maximum(np.concatenate(shown).std(0), SPREAD_FLOOR).astype(np.float32)
        shown = tuple((poses - centre) / spread for poses in shown)
    shown = tuple(np.clip(poses, system.statistics.pose_low, system.statistics.pose_high) for poses in shown)
    if sizes.style:
        code = np.mean([system.engine.style_code(stretch) for poses in shown for stretch in stretches(poses, STRETCH)], 0)
    else:
        code = np.zeros(0)
    places = np.linspace(0, sum(len(poses) - sizes.history for poses in shown), BEGINNINGS, endpoint=False)
    every = [np.lib.stride_tricks.sliding_window_view(p[:-1], sizes.history, 0).transpose(0, 2, 1) for p in shown]
    beginnings = np.concatenate(every)[places.astype(int)]
    return StyleEmbedding(code.astype(np.float32), centre.astype(np.float32), beginnings.astype(np.float32), spread, shown)


def standardise_example(system: System, motion: Motion, least: float, name: str) -> tuple[Array, ...]:
    """(T, D) standardised poses of an example, or of pieces of it.

    Args:
        system: who looks at it.
        motion: see `example`.
        least: seconds that it has at least.
        name: for messages.

    Raises:
        InputError: it is shorter, or its skeleton is not recognised.
    """
    if motion.duration < least:
        raise InputError(f"{name} has {motion.duration:.2f} s of motion", f"an example of style has {least:g} s at least")
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


def _standardise(motion: Motion, system: System) -> Array:
    """(T, D) standardised poses."""
    return encode_motion(_move_to_origin(motion.resample(system.fps).retarget("humanoid")), system)


def encode_motion(body: Motion, system: System) -> Array:
    """(T, D) standardised poses of motion on our humanoid, at whatever rate."""
    pose: Pose = find_pose(system.pose)
    if pose.source == "points":
        source: object = import_module(_POINTS[pose.name]).points_of(body)
    else:
        source = body.retarget(pose.skeleton)  # type: ignore[attr-defined]  # all that take motion have one
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


def latents_of(system: FlowSystem, embedding: StyleEmbedding, code: Array) -> list[Array]:
    """(T − τ, D) for each piece of an example: the latents that make it under mean speech and this code."""
    sizes, found = system.engine.sizes, []
    after = sizes.speech_frames - 1 - sizes.history
    for poses in embedding.poses:
        rows = np.concatenate([poses, np.repeat(poses[-1:], after, 0)])
        found.append(system.engine.latents(rows, np.zeros((len(rows), sizes.audio), np.float32), code))
    return found
