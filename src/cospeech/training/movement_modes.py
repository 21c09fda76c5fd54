"""Modes of movement, one for each sub-generator of Mix-StAGE: k-means of pose ⊕ velocity ⊕ speed (Ahuja et al. 2020).

A frame is the positions of a person's points, their differences to the frame before (0 in the first of a clip), and the lengths
of these. For the 48 key points of PATS these are 96 + 96 + 48 = 240 numbers, in pixels, as in
`cospeech.metrics.mode_f1.mode_features`. For a body in three dimensions, they are in metres: the joints relative to the hips,
which are turned as in the T-pose.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from warnings import catch_warnings, simplefilter

import numpy as np

from ..corpora.store import Store
from ..errors import InputError
from ..metrics._scipy import scipy
from ..motion.motion import Motion
from ..motion.points import Points
from ..motion.poses import Pose, find_pose
from ..motion.poses.keypoints2d import KEYPOINTS2D
from ..motion.rotations import Array

__all__ = ["find_centres", "movement", "with_modes"]

FRAMES = 50_000  # ours: frames for k-means, drawn from the training split
SEED = 0  # ours: of the draw and of the first centres, so that a store always gives the same modes
ROUNDS = 50  # ours: of Lloyd's algorithm, which has settled by then


def _positions(vectors: Array, pose: Pose, fps: float) -> Array:
    """(T, K, J) coordinates of the points, in the order of PATS: all x, then all y."""
    vectors = np.asarray(vectors, np.float64)
    if pose.name == KEYPOINTS2D.name:
        return vectors.reshape(len(vectors), 2, -1)
    body = pose.decode(vectors, fps)
    if isinstance(body, Points):
        return (body.values - body.values[:, :1])[:, 1:].transpose(0, 2, 1)
    assert isinstance(body, Motion)
    rotations = np.array(body.rotations, np.float64)
    rotations[:, 0] = body.skeleton.rest[0]
    positions, _ = body.skeleton.forward(rotations, np.zeros((len(rotations), 3)))
    return positions[:, 1:].transpose(0, 2, 1)


def movement(vectors: Array, pose: Pose, fps: float) -> Array:
    """(T, D) poses of one clip → (T, (2 K + 1) J) pose ⊕ velocity (per frame) ⊕ speed."""
    if not len(vectors):
        return np.zeros((0, 0))
    points = _positions(vectors, pose, fps)
    velocity = np.diff(points, axis=0, prepend=points[:1])
    flat = [x.reshape(len(x), -1) for x in (points, velocity)]
    return np.concatenate([*flat, np.linalg.norm(velocity, axis=1)], axis=1)


def find_centres(features: Array, modes: int) -> Array:
    """(N, F) → (modes, F) float32 centres of k-means (k-means++, Lloyd's algorithm).

    Raises:
        InputError: fewer different frames than modes.
    """
    vq = scipy("cluster.vq")
    draw = np.random.default_rng(SEED)
    if len(features) > FRAMES:
        features = features[np.sort(draw.choice(len(features), FRAMES, replace=False))]
    if len(features) < modes or len(np.unique(features, axis=0)) < modes:
        raise InputError(f"{len(features)} frames for {modes} modes", "more training data, or fewer modes")
    with catch_warnings():
        simplefilter("ignore", UserWarning)  # a centre that loses all its frames stays where it was
        centres, _ = vq.kmeans2(features, modes, iter=ROUNDS, minit="++", missing="warn", rng=draw)
    return np.asarray(centres, np.float32)


def with_modes(store: Store, modes: int) -> tuple[Store, Array]:
    """The same store with the array ``cluster`` (N,) int32, and the centres; the files stay as they are.

    Args:
        store: its training split is what is clustered, or all of it where there is none.
        modes: M.

    Returns:
        the store, each frame with the number of its nearest centre; and (modes, F) the centres.

    Raises:
        InputError: see `find_centres`.
    """
    pose = find_pose(store.pose)
    parts = [movement(store.clip(clip)["pose"], pose, store.fps) for clip in store.clips]
    train = [part for clip, part in zip(store.clips, parts, strict=True) if clip.split == "train" and len(part)]
    centres = find_centres(np.concatenate(train or [part for part in parts if len(part)]), modes)
    square = np.square(centres.astype(np.float64)).sum(1)
    cluster = np.full(len(store.arrays["pose"]), -1, np.int32)  # of rows that belong to no clip
    for clip, part in zip(store.clips, parts, strict=True):
        cluster[clip.offset : clip.offset + clip.frames] = np.argmin(square - 2 * part @ centres.T, axis=1)
    more = copy(store)
    more.arrays = store.arrays | {"cluster": cluster}
    more.clips = tuple(replace(clip, has=(*clip.has, "cluster")) for clip in store.clips)
    return more, centres
