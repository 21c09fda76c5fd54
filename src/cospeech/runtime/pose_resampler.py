"""Poses at the network's rate → smoothed ones at the rate of the motion."""

from __future__ import annotations

from math import comb

import numpy as np

from ..motion.curves import clip
from ..motion.rotations import Array

__all__ = ["MOST_LAG", "PoseResampler"]

MOST_LAG = 16.0  # ours: frames of the model that a pose of the motion is behind at most: 2 of the cubic and 8 of the smoothing


class PoseResampler:
    """Binomial smoothing, and cubics (Catmull-Rom) through the smooth poses; every number follows from its frame's index alone.

    Args:
        takes: N.
        width: D.
        smooth: how many frames to either side are averaged over.
        step: frames of the model in one of the motion.
    """

    def __init__(self, takes: int, width: int, *, smooth: int, step: float) -> None:
        self._smooth, self._step = smooth, step
        taps = 2 * smooth
        self._taps = [np.float32(comb(taps, n) / 2**taps) for n in range(taps + 1)]
        self._poses = np.zeros((takes, 0, width), np.float32)
        self._first = 0  # index of the first pose of the model that is kept
        self._end = 0  # frames of the motion handed out

    def push(self, rows: Array, total: int | None = None, last: int | None = None) -> tuple[Array, Array]:
        """The poses that further poses of the model make certain.

        Args:
            rows: (N, k, D).
            total: frames of the motion in all, once they are known.
            last: index of the model's last pose, once it is known.

        Returns:
            (N, n, D) the next poses, and (n,) where in the model's frames they lie.
        """
        self._poses = np.concatenate([self._poses, rows], 1)
        limit = self._first + self._poses.shape[1]
        end = self._end
        if total is not None:
            end = total
        else:  # frame j lies between poses m and m + 1; the cubic takes m − 1 … m + 2, each smoothed
            while int(end * self._step) + 2 + self._smooth < limit:
                end += 1
        at = np.arange(self._end, end) * self._step
        poses = self._at(at, limit - 1 if last is None else last) if len(at) else self._poses[:, :0]
        self._end = end
        keep = int(end * self._step) - 1 - self._smooth
        if keep > self._first and last is None:
            self._poses, self._first = self._poses[:, keep - self._first :].copy(), keep
        return poses, at

    def _at(self, at: Array, last: int) -> Array:
        """(N, n, D) of these places; ends are held."""
        low = np.floor(at).astype(int)
        t = (at - low).astype(np.float32)[:, None]
        before, here, there, after = np.split(self._smooth_poses(np.concatenate([low + n for n in (-1, 0, 1, 2)]), last), 4, 1)
        bend = 2 * before - 5 * here + 4 * there - after + (3 * (here - there) + after - before) * t
        return here + np.float32(0.5) * t * (there - before + t * bend)

    def _smooth_poses(self, poses: Array, last: int) -> Array:
        """(N, n, D) of these indices."""
        total = np.zeros((len(self._poses), len(poses), self._poses.shape[2]), np.float32)
        for n, tap in enumerate(self._taps):
            index = clip(poses + n - self._smooth, 0, last)
            total += tap * self._poses[:, np.maximum(index - self._first, 0)]
        return total
