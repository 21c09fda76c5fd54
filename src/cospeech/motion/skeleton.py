"""Skeleton: names, parents, offsets and the T-pose; forward kinematics; named groups of joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property, lru_cache
from importlib import import_module
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from .rotations import Array, quat_identity, quat_multiply, quat_rotate
from .skeletons import SKELETONS

if TYPE_CHECKING:
    from ..export.bvh_layout import BvhLayout

__all__ = ["Skeleton", "find_skeleton", "humanoid"]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints.

    Args:
        names: J unique joint names, parents before children; the first is the root.
        parents: J indices, −1 for the root.
        offsets: (J, 3) metres, from the parent joint in the parent's frame. The root's offset is its T-pose position.
        rest: (J, 4) local rotations, xyzw, that put this skeleton into the T-pose (facing +Z, Y up); identity for our humanoid.
        ends: leaf name → (3,) offset of the bone's tip, metres.
        kind: table of the names: ``"humanoid"``, ``"mixamo"``, …; ``"custom"`` for files of unknown make.
        floor: height of the floor of the T-pose, metres; 0 unless the skeleton comes from a file with another floor.
        bone_map: our name → its name, as found when the file was read; if empty, it is found when it is needed.
        layout: order, units and channels of the BVH file that the skeleton was read from; None without such a file. Skeletons
            with different layouts may be equal.

    Raises:
        InputError: names repeat, a parent comes after its child, shapes disagree, or a value is not finite.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    rest: Array = None  # type: ignore[assignment]  # filled in below
    ends: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    kind: str = "custom"
    floor: float = 0.0
    bone_map: Mapping[str, str] = field(default_factory=dict)
    layout: BvhLayout | None = None

    def __post_init__(self) -> None:
        names, parents = tuple(self.names), tuple(int(p) for p in self.parents)
        offsets = np.array(self.offsets, np.float64)
        rest = quat_identity(len(names)) if self.rest is None else np.array(self.rest, np.float64)
        if not names or len(parents) != len(names) or offsets.shape != (len(names), 3) or rest.shape != (len(names), 4):
            raise InputError(f"skeleton of {len(names)} names, {len(parents)} parents, offsets {offsets.shape}")
        if not (np.isfinite(offsets).all() and np.isfinite(rest).all()):
            raise InputError("a skeleton's offsets or rest hold values that are not finite")
        if len(set(names)) != len(names):
            duplicates = sorted(name for name, count in Counter(names).items() if count > 1)
            raise InputError(f"joint names repeat: {', '.join(duplicates)[:200]}")
        if parents[0] != -1 or any(not 0 <= p < k for k, p in enumerate(parents) if k):
            raise InputError("a skeleton has one root, first, and parents stand before their children")
        for name, value in (("names", names), ("parents", parents), ("offsets", offsets), ("rest", rest)):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return f"Skeleton({self.kind!r}, {len(self)} joints)"

    def __len__(self) -> int:
        return len(self.names)

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, Skeleton)
            and self.names == other.names
            and self.parents == other.parents
            and np.allclose(self.offsets, other.offsets, atol=1e-6)
            and np.allclose(np.abs(np.sum(self.rest * other.rest, -1)), 1, atol=1e-9)
        )

    __hash__ = None  # type: ignore[assignment]

    @cached_property
    def index(self) -> dict[str, int]:
        """Name → position."""
        return {name: k for k, name in enumerate(self.names)}

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Children of every joint."""
        kids: list[list[int]] = [[] for _ in self.names]
        for k, p in enumerate(self.parents):
            if p >= 0:
                kids[p].append(k)
        return tuple(tuple(c) for c in kids)

    @cached_property
    def _levels(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        depth = [0] * len(self)
        for k, p in enumerate(self.parents):
            depth[k] = depth[p] + 1 if p >= 0 else 0
        order = np.argsort(depth, kind="stable")  # by depth, and in the skeleton's order within
        cuts = np.flatnonzero(np.diff(np.array(depth)[order])) + 1
        parents = np.array(self.parents)
        return tuple((joints, parents[joints]) for joints in np.split(order, cuts)[1:])

    def group(self, *prefixes: str) -> tuple[int, ...]:
        """Indices of the joints whose name starts with one of ``prefixes``, in skeleton order."""
        return tuple(k for k, n in enumerate(self.names) if n.startswith(prefixes))

    @cached_property
    def left_hand(self) -> tuple[int, ...]:
        """The 15 finger joints of the left hand (humanoid names)."""
        return self.group(*(f"left{f}" for f in ("Thumb", "Index", "Middle", "Ring", "Little")))

    @cached_property
    def right_hand(self) -> tuple[int, ...]:
        """The 15 finger joints of the right hand (humanoid names)."""
        return self.group(*(f"right{f}" for f in ("Thumb", "Index", "Middle", "Ring", "Little")))

    @cached_property
    def lower_body(self) -> tuple[int, ...]:
        """Hips, legs, feet and toes (humanoid names)."""
        return self.group("hips", *(s + part for s in ("left", "right") for part in ("UpperLeg", "LowerLeg", "Foot", "Toes")))

    @cached_property
    def upper_body(self) -> tuple[int, ...]:
        """Everything above the hips without the fingers (humanoid names)."""
        other = {*self.lower_body, *self.left_hand, *self.right_hand}
        return tuple(k for k in range(len(self)) if k not in other)

    def forward(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Forward kinematics.

        Args:
            rotations: (..., J, 4) local rotations, xyzw.
            root: (..., 3) position of the root joint in metres.

        Returns:
            positions (..., J, 3) in metres and world rotations (..., J, 4).
        """
        if rotations.shape[-2:] != (len(self), 4):
            raise InputError(f"rotations of shape {rotations.shape} for a skeleton of {len(self)} joints")
        world = np.empty(rotations.shape, np.float64)
        positions = np.empty((*rotations.shape[:-1], 3), np.float64)
        world[..., 0, :], positions[..., 0, :] = rotations[..., 0, :], root
        for joints, parents in self._levels:
            above = world[..., parents, :]
            world[..., joints, :] = quat_multiply(above, rotations[..., joints, :])
            positions[..., joints, :] = positions[..., parents, :] + quat_rotate(above, self.offsets[joints])
        return positions, world

    def place(self, world: Array) -> Array:
        """(..., J, 3) positions of the joints in metres, from their world rotations (..., J, 4); the root is at the origin."""
        positions = np.zeros((*world.shape[:-1], 3))
        for joints, parents in self._levels:
            positions[..., joints, :] = positions[..., parents, :] + quat_rotate(world[..., parents, :], self.offsets[joints])
        return positions

    @cached_property
    def tpose(self) -> Array:
        """(J, 3) joint positions in the T-pose, metres."""
        return self.forward(self.rest, self.offsets[0])[0]


def from_table(
    joints: Sequence[tuple[str, str | None, tuple[float, float, float]]],
    ends: Mapping[str, tuple[float, float, float]],
    kind: str,
) -> Skeleton:
    """Build a skeleton from a table of ``(name, parent, offset)`` rows, parents first."""
    index = {name: k for k, (name, _, _) in enumerate(joints)}
    return Skeleton(
        names=tuple(index),
        parents=tuple(-1 if parent is None else index[parent] for _, parent, _ in joints),
        offsets=np.array([offset for _, _, offset in joints]),
        ends=dict(ends),
        kind=kind,
    )


@lru_cache
def find_skeleton(name: str) -> Skeleton:
    """A skeleton of the table `cospeech.motion.skeletons.SKELETONS`.

    Raises:
        InputError: unknown name; the message lists the known ones and the nearest.

    >>> find_skeleton("mixamo").names[0]
    'mixamorig:Hips'
    """
    if name not in SKELETONS:
        near = get_close_matches(str(name).lower(), SKELETONS, 1, 0.5)
        names = f"known: {', '.join(SKELETONS)}"
        if PurePath(str(name)).suffix:
            raise InputError(
                f"unknown skeleton {name!r}", f"of a file: cospeech.export.target_skeleton.find_target({str(name)!r}); {names}"
            )
        raise InputError(f"unknown skeleton {name!r}", f"did you mean {near[0]!r}? {names}" if near else names)
    table = import_module(SKELETONS[name])
    return from_table(table.JOINTS, table.ENDS, name)


def humanoid() -> Skeleton:
    """Our humanoid (`cospeech.motion.skeletons.humanoid`): 55 joints, T-pose, 1.72 m.

    >>> len(humanoid()), humanoid().names[0]
    (55, 'hips')
    """
    return find_skeleton("humanoid")
