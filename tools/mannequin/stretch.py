"""How much the edges of the mesh are stretched when the character moves, against their length in the T-pose."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cospeech.export.mannequin.character import Character, skin
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import Array

__all__ = ["LIMIT", "Stretch", "measure_stretch"]

LIMIT = 0.30  # of an edge's length: the house's mark for ordinary motion
_SHORT = 1e-4  # metres; ours: the crease of a shoe's sole has edges of no length


class Stretch(NamedTuple):
    """What a motion does to one part of the character.

    Attributes:
        most: the greatest stretch of an edge in any frame; 0.3 is 30 %.
        ever: share of the edges that some frame stretches by more than `LIMIT`.
        mean: share of the edges that a frame stretches by more than `LIMIT`, averaged over the frames.
    """

    most: float
    ever: float
    mean: float


def measure_stretch(character: Character, motion: Motion, parts: Iterable[str], every: int = 1) -> dict[str, Stretch]:
    """Stretch of parts of the character over every ``every``-th frame of ``motion``, which is on the character's skeleton."""
    positions, world = character.skeleton.forward(motion.rotations[::every], motion.root[::every])
    pieces = {name: _edges(character[name].triangles, character[name].vertices) for name in parts}
    selection = Character(character.skeleton, tuple(character[name] for name in pieces))
    ratios: dict[str, list[Array]] = {name: [] for name in pieces}
    for turn, place in zip(world, positions, strict=True):
        for (name, edges), vertices in zip(pieces.items(), skin(selection, turn, place), strict=True):
            rest = character[name].vertices
            ratios[name].append(_lengths(vertices, edges) / _lengths(rest, edges) - 1)
    result = {}
    for name, rows in ratios.items():
        table = np.stack(rows)
        result[name] = Stretch(float(table.max()), float(np.mean(table.max(0) > LIMIT)), float(np.mean(table > LIMIT)))
    return result


def _edges(triangles: Array, points: Array) -> Array:
    """(E, 2) every edge of some length once."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    pairs = np.unique(np.sort(pairs, 1), axis=0)
    return pairs[_lengths(points, pairs) > _SHORT]


def _lengths(points: Array, edges: Array) -> Array:
    return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
