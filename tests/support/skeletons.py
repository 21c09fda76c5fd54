"""Skeletons changed for tests: joints taken out, joints with other names."""

from __future__ import annotations

import re

import numpy as np

from cospeech.motion.skeleton import Skeleton

__all__ = ["rename_joints", "without"]


def without(skeleton: Skeleton, pattern: str) -> Skeleton:
    """Take joints out; their children become children of the joint above."""
    is_out = [bool(re.fullmatch(pattern, n)) for n in skeleton.names]
    keep = [k for k, out in enumerate(is_out) if not out]

    def above(k: int) -> int:
        k = skeleton.parents[k]
        while k >= 0 and is_out[k]:
            k = skeleton.parents[k]
        return k

    offsets = [skeleton.tpose[k] - (skeleton.tpose[above(k)] if above(k) >= 0 else 0) for k in keep]
    parents = tuple(keep.index(above(k)) if above(k) >= 0 else -1 for k in keep)
    return Skeleton(tuple(skeleton.names[k] for k in keep), parents, np.array(offsets), ends=skeleton.ends)


def rename_joints(skeleton: Skeleton, names: dict[str, str]) -> Skeleton:
    return Skeleton(tuple(names.get(n, n) for n in skeleton.names), skeleton.parents, skeleton.offsets, ends={
        names.get(n, n): e for n, e in skeleton.ends.items()})  # fmt: skip
