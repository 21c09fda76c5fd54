"""The rest pose of the bones of an FBX file: the pose to which the skin is bound, if the file has it.

The properties of a bone give the pose at the moment when the file was saved, which may be a frame of a dance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ...limits import GLTF_NODES
from ...motion.rotations import Array, quat_to_matrix
from ..rig import rotation_of
from .document import MODEL, Document, FbxModel, Transform

__all__ = ["bind_models"]

_LEAST_SIZE = 1e-12  # least determinant of a place that counts; ours


def bind_models(fbx: Document, models: Sequence[FbxModel], parents: Sequence[int]) -> list[Transform]:
    """The rest place of each model, relative to its parent.

    Args:
        fbx: the file.
        models: of it.
        parents: index of the parent of each model, -1 for none.

    Raises:
        InputError: a model hangs on itself, or there are too many.
    """
    if len(models) > GLTF_NODES:
        raise InputError(f"{fbx.name} has {len(models):,} bones and meshes", "is this a character?")
    binds = _read_bind_pose(fbx)
    rests = [model.rest for model in models]
    worlds: dict[int, Array] = {}
    for k in _sort_by_depth(fbx, parents):
        above = worlds[parents[k]] if parents[k] >= 0 else np.eye(4)
        world = binds.get(models[k].object.number)
        if world is not None:
            rests[k] = _split(np.linalg.inv(above) @ world)
        worlds[k] = world if world is not None else above @ _join(rests[k])
        if abs(np.linalg.det(worlds[k][:3, :3])) < _LEAST_SIZE:
            worlds[k] = np.eye(4)  # of no size; nothing visible hangs on it
    return rests


def _read_bind_pose(fbx: Document) -> dict[int, Array]:
    """Number of a model → (4, 4) place in the world: from the clusters of skins, and from the bind poses of the file."""
    binds: dict[int, Array] = {}
    for pose in fbx.of_kind("Pose"):
        for node in pose.node.all("PoseNode") if pose.sort == "BindPose" else ():
            number, matrix = node.value("Node"), node.array("Matrix")
            if isinstance(number, int) and (model := fbx.objects.get(number)) is not None and model.sort == "LimbNode":
                binds[number] = matrix.reshape(4, 4).T
    for cluster in fbx.of_kind("Deformer"):
        for model, _ in fbx.below(cluster.number, MODEL) if cluster.sort == "Cluster" else ():
            binds[model.number] = cluster.node.array("TransformLink").reshape(4, 4).T
    return {k: world for k, world in binds.items() if np.isfinite(world).all() and np.linalg.det(world[:3, :3]) > _LEAST_SIZE}


def _sort_by_depth(fbx: Document, parents: Sequence[int]) -> list[int]:
    """Models, parents before children."""
    children: dict[int, list[int]] = {}
    for k, parent in enumerate(parents):
        children.setdefault(parent, []).append(k)
    order = list(children.get(-1, []))
    for k in order:
        order += children.get(k, [])
    if len(order) != len(parents):
        raise InputError(f"{fbx.name} is damaged: a bone hangs on itself", "export it again")
    return order


def _join(place: Transform) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = quat_to_matrix(place.rotation) * place.scale, place.translation
    return matrix


def _split(matrix: Array) -> Transform:
    """Split a matrix, without its shear, which glTF does not have."""
    return Transform(matrix[:3, 3], rotation_of(matrix), np.linalg.norm(matrix[:3, :3], axis=0))
