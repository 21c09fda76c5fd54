"""Linear discriminants with a shrunk covariance (Friedman 1989): they name the class of rows."""

from __future__ import annotations

import numpy as np

from ..motion.rotations import Array

__all__ = ["LinearDiscriminants"]

SHRINK = 0.3  # [ours] share of the mean variance in the covariance
_TINY = 1e-6  # [ours] added to deviations, so that none is 0


class LinearDiscriminants:
    """A classifier that learns from labelled rows.

    Args:
        rows: (N, F) features.
        labels: (N,) 0 … classes − 1, each at least once.
        classes: number of classes.
    """

    def __init__(self, rows: Array, labels: Array, classes: int) -> None:
        self._middle, self._scale = rows.mean(0), rows.std(0) + _TINY
        rows = (rows - self._middle) / self._scale
        centres = np.stack([rows[labels == k].mean(0) for k in range(classes)])
        within = np.cov((rows - centres[labels]).T)
        within = (1 - SHRINK) * within + SHRINK * np.eye(len(within)) * np.trace(within) / len(within)
        self._weights = np.linalg.solve(within, centres.T)
        self._bias = -0.5 * (centres * self._weights.T).sum(1)

    def vote(self, rows: Array) -> Array:
        """(classes,) mean log-probability of each class over rows (N, F)."""
        scores = (rows - self._middle) / self._scale @ self._weights + self._bias
        votes: Array = (scores - np.logaddexp.reduce(scores, 1, keepdims=True)).mean(0)
        return votes
