"""Rotations and places of joints from the vectors of a pose, in PyTorch, for losses on bones."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...motion.poses import POSES, find_pose
from ...motion.rotations import quat_to_matrix
from ...motion.skeleton import find_skeleton

__all__ = ["Bones", "bones_of", "euler_to_matrix", "rot6d_to_matrix", "rotation_angle"]

SMALL = 1e-6  # ours: keeps gradients finite where a length is 0


def euler_to_matrix(degrees: Tensor) -> Tensor:
    """(…, 3) intrinsic X, Y, Z in degrees → (…, 3, 3)."""
    (a, b, c), (i, j, k) = degrees.deg2rad().cos().unbind(-1), degrees.deg2rad().sin().unbind(-1)
    rows = [b * c, -b * k, j, a * k + i * j * c, a * c - i * j * k, -i * b, i * k - a * j * c, i * c + a * j * k, a * b]
    return torch.stack(rows, -1).unflatten(-1, (3, 3))


def rot6d_to_matrix(columns: Tensor) -> Tensor:
    """(…, 6) two columns → (…, 3, 3), by Gram and Schmidt (Zhou et al. 2019)."""
    a, b = columns.chunk(2, -1)
    x = F.normalize(a, dim=-1, eps=SMALL)
    y = F.normalize(b - (x * b).sum(-1, keepdim=True) * x, dim=-1, eps=SMALL)
    return torch.stack([x, y, torch.linalg.cross(x, y)], -1)


def rotation_angle(one: Tensor, other: Tensor) -> Tensor:
    """(…, 3, 3) twice → (…,) the angle between two rotations in radians: |R − R'| = 2 √2 sin(θ / 2)."""
    apart = ((one - other).square().sum((-2, -1)) + SMALL**2).sqrt() / 8**0.5
    return 2 * torch.asin(apart.clamp_max(1 - SMALL))


_MATRICES: dict[str, tuple[int, Callable[[Tensor], Tensor]]] = {"euler": (3, euler_to_matrix), "rot6d": (6, rot6d_to_matrix)}
"""Representation, up to its first hyphen → numbers of a joint, and the function that makes a matrix of them."""


class Bones(nn.Module):
    """Rotations of the joints of a representation, and the places of all joints that they move, in metres from the hips.

    Args:
        representation: name of `cospeech.motion.poses.POSES`, of joints in Euler angles or in six numbers.
    """

    rest: Tensor
    order: Tensor

    def __init__(self, representation: str) -> None:
        super().__init__()
        pose = find_pose(representation)
        self.width, self._to_matrix = _MATRICES[representation.partition("-")[0]]
        skeleton, joint_names = find_skeleton(pose.skeleton), tuple(pose.joints)  # type: ignore[attr-defined]
        rest = torch.from_numpy(quat_to_matrix(skeleton.rest)).float()
        offsets = torch.from_numpy(skeleton.offsets).float()
        depth, is_moved = [0] * len(skeleton), [False] * len(skeleton)
        for k, parent in enumerate(skeleton.parents[1:], 1):
            depth[k] = depth[parent] + 1
            is_moved[k] = is_moved[parent] or skeleton.names[parent] in joint_names
        self.joint_indices = tuple(skeleton.index[name] for name in joint_names)
        self.levels: list[tuple[str, ...]] = []
        levels = [[k for k in range(len(skeleton)) if depth[k] == level] for level in range(max(depth) + 1)]
        self.register_buffer("rest", rest, persistent=False)
        self.register_buffer("order", torch.tensor(self.joint_indices), persistent=False)
        for level, (above, joints) in enumerate(zip([[0], *levels], levels, strict=False)):
            own = {
                "joints": torch.tensor(joints), "offsets": offsets[joints],
                "parents": torch.tensor([above.index(max(0, skeleton.parents[k])) for k in joints]),
                "moved": torch.tensor([n for n, k in enumerate(joints) if is_moved[k]], dtype=torch.long),
            }  # fmt: skip
            self.levels.append(tuple(f"{name}{level}" for name in own))
            for name, value in own.items():
                self.register_buffer(f"{name}{level}", value, persistent=False)

    def rotations(self, vectors: Tensor) -> Tensor:
        """(…, D) vectors in the units of the representation → (…, K, 3, 3) of its joints."""
        return self._to_matrix(vectors.unflatten(-1, (-1, self.width)))

    def places(self, rotations: Tensor) -> Tensor:
        """(…, K, 3, 3) → (…, M, 3) of the joints below those, by forward kinematics; the hips stand still."""
        local = self.rest.expand(*rotations.shape[:-3], *self.rest.shape).index_copy(-3, self.order, rotations)
        places = list[Tensor]()
        world, place = local[..., :1, :, :], local.new_zeros(*rotations.shape[:-3], 1, 3)
        for level in self.levels[1:]:
            joints, offsets, parents, below = (getattr(self, name) for name in level)
            above = world[..., parents, :, :]
            place = place[..., parents, :] + (above @ offsets[..., None]).squeeze(-1)
            world = above @ local[..., joints, :, :]
            places.append(place[..., below, :])
        return torch.cat(places, -2)


def bones_of(representation: str) -> Bones | None:
    """The bones of a representation; None where its vectors are no rotations that `Bones` can read."""
    has_rotations = representation in POSES and representation.partition("-")[0] in _MATRICES
    return Bones(representation) if has_rotations else None
