"""An armature's rest pose, and an action made of world rotations."""

from __future__ import annotations

import re

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion

from .bvh import Frames
from .errors import CospeechError

__all__ = ["Rig", "check_tweaks", "key_shapes"]

TO_BVH = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From Blender's axes, Z up and facing −Y, to Y up and facing +Z."""


EYE = re.compile(r"eye(?!.*(lid|brow|lash))", re.I)
"""The name of a bone of an eye [ours]."""
LOOKS = "eyelook"
"""Begin of the names of shapes that turn eyes, in small letters."""
EQUAL = 1e-6
"""A smaller change of a location or a scale counts as none."""


class Rig:
    """The bones of an armature: the largest tree, parents first.

    Args:
        armature: an object of the type ARMATURE.
    """

    def __init__(self, armature: bpy.types.Object) -> None:
        self.armature = armature
        roots = [bone for bone in armature.data.bones if bone.parent is None]
        if not roots:
            raise CospeechError(f"{armature.name!r} has no bones")
        root = max(roots, key=lambda bone: len(bone.children_recursive))
        self.bones = [root, *root.children_recursive]
        place = {bone.name: k for k, bone in enumerate(self.bones)}
        self.bones.sort(key=lambda bone: (_depth(bone), place[bone.name]))
        index = {bone.name: k for k, bone in enumerate(self.bones)}
        self.parents = [index[bone.parent.name] if bone.parent else -1 for bone in self.bones]
        own = armature.matrix_world
        self.world = Matrix.Rotation(-own.to_euler().z, 4, "Z") @ Matrix.Translation(-own.translation) @ own
        """From the armature to metres, Z up, facing −Y, at the origin: the object's place and heading stay its own."""
        self.names = _plain_names([bone.name for bone in self.bones])

    def points(self, which: str) -> np.ndarray:
        """(J, 3) heads or tails in the world, metres, Y up."""
        places = [self.world @ getattr(bone, f"{which}_local") for bone in self.bones]
        return np.array(places) @ TO_BVH.T

    @property
    def constrained(self) -> list[str]:
        """Bones with constraints that are at work."""
        poses = (self.armature.pose.bones[bone.name] for bone in self.bones)
        return [pose.name for pose in poses if any(not each.mute and each.influence > 0 for each in pose.constraints)]

    def key(self, motion: Frames, rest: Frames, action: bpy.types.Action, first: float, *, looks: bool = False) -> None:
        """Write keys for all bones.

        Args:
            motion: rotations from a T-pose.
            rest: one frame: those of the rest pose from the same T-pose.
            action: gets the keys.
            first: frame of the first key.
            looks: shape keys turn the eyes, so that their bones rest.
        """
        turn = np.array(self.world.to_3x3().normalized())
        into = turn.T @ TO_BVH.T  # from the axes of the BVH to those of the armature
        at = {name: k for k, name in enumerate(motion.names)}
        columns = [at[name] for name in self.names]
        away = motion.rotations[:, columns] @ np.swapaxes(rest.rotations[:, columns], -1, -2)
        away = into @ away @ into.T
        rests = np.array([np.array(bone.matrix_local.to_3x3()) for bone in self.bones])
        rotations = away @ rests
        bag = _bag(action, self.armature)
        for k, bone in enumerate(self.bones):
            parent = self.parents[k]
            above = rotations[:, parent] if parent >= 0 else rests[:1]
            between = (rests[parent].T if parent >= 0 else rests[0].T) @ (rests[k] if parent >= 0 else rests[0])
            local = between.T @ np.swapaxes(above, -1, -2) @ rotations[:, k]
            local = np.broadcast_to(np.eye(3), local.shape) if looks and EYE.search(bone.name) else local
            quaternions = np.array([Matrix(matrix).to_quaternion() for matrix in local])
            flips = np.sign((quaternions[1:] * quaternions[:-1]).sum(-1))
            quaternions[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
            pose = self.armature.pose.bones[bone.name]
            path = f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"]'
            _write(bag, f"{path}.{_rotation_of(pose)}", _in_mode(pose, quaternions), first)
            for name, usual in (("location", 0.0), ("scale", 1.0)):  # of a pose before, which would stay
                if any(abs(value - usual) > EQUAL for value in getattr(pose, name)) and (k or name == "scale"):
                    _write(bag, f"{path}.{name}", np.full((1, 3), usual), first)
        scale = self.world.median_scale
        places = (motion.root - rest.root * (0, 1, 0)) @ into.T / scale @ rests[0]
        path = f'pose.bones["{bpy.utils.escape_identifier(self.bones[0].name)}"].location'
        _write(bag, path, places, first)


def check_tweaks(owner: bpy.types.ID) -> None:
    """Check that no strip is tweaked: Blender then sets no other action.

    Raises:
        CospeechError: one is.
    """
    if owner.animation_data is not None and owner.animation_data.use_tweak_mode:
        raise CospeechError(f"an NLA strip of {owner.name!r} is being tweaked: leave tweak mode first (Tab)")


def key_shapes(armature: bpy.types.Object, names: list[str], weights: np.ndarray, name: str, first: float) -> tuple[int, bool]:
    """Write keys for the shape keys of the armature's meshes that have these names, in upper or lower case.

    Args:
        armature: whose meshes.
        names: C channels.
        weights: (T, C).
        name: of the actions.
        first: frame of the first key.

    Returns:
        How many shape keys there were, and whether some of them turn the eyes.
    """
    count, looks, key_names = 0, False, set[str]()
    for mesh in bpy.data.objects:
        has_modifier = any(each.type == "ARMATURE" and each.object == armature for each in mesh.modifiers)
        if mesh.type != "MESH" or mesh.data.shape_keys is None or not (has_modifier or _hangs_on(mesh, armature)):
            continue
        keys = mesh.data.shape_keys
        if keys.name_full in key_names:  # objects may share a mesh
            continue
        key_names.add(keys.name_full)
        check_tweaks(keys)
        blocks = {each.name.lower(): each.name for each in keys.key_blocks}
        pairs = [(k, blocks[channel.lower()]) for k, channel in enumerate(names) if channel.lower() in blocks]
        if not pairs:
            continue
        action = bpy.data.actions.new(f"{name} face")
        bag = _bag(action, keys)
        for k, key in pairs:
            _write(bag, f'key_blocks["{bpy.utils.escape_identifier(key)}"].value', weights[:, k : k + 1], first)
        count += len(pairs)
        looks = looks or any(key.lower().startswith(LOOKS) for _, key in pairs)
    return count, looks


def _bag(action: bpy.types.Action, owner: bpy.types.ID) -> bpy.types.ActionChannelbag:
    """Let the owner play an action; returns the place for its curves (Blender 4.4 and later)."""
    data = owner.animation_data or owner.animation_data_create()
    slot = action.slots.new(id_type=owner.id_type, name=owner.name)
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    if data.action is not None:
        data.action.use_fake_user = True  # a file that is saved would lose it
    data.action, data.action_slot = action, slot
    data.action_influence, data.action_blend_type = 1.0, "REPLACE"
    return strip.channelbag(slot, ensure=True)


def _hangs_on(mesh: bpy.types.Object, armature: bpy.types.Object) -> bool:
    """Whether an object is a child of the armature, or of a child of it."""
    above = mesh.parent
    while above is not None and above != armature:
        above = above.parent
    return above is not None


def _rotation_of(pose: bpy.types.PoseBone) -> str:
    """The property that turns a bone; a bone keeps its mode, or actions of before would turn it no more."""
    if pose.rotation_mode == "AXIS_ANGLE":
        pose.rotation_mode = "QUATERNION"
    return "rotation_quaternion" if pose.rotation_mode == "QUATERNION" else "rotation_euler"


def _in_mode(pose: bpy.types.PoseBone, quaternions: np.ndarray) -> np.ndarray:
    """(T, 4) rotations as the bone has them: the same, or (T, 3) angles without jumps by a turn."""
    if pose.rotation_mode == "QUATERNION":
        return quaternions
    angles: list[Euler] = []
    for each in quaternions:
        before = angles[-1:]
        angles.append(Quaternion(each).to_euler(pose.rotation_mode, *before))
    return np.array(angles)


def _write(bag: bpy.types.ActionChannelbag, path: str, values: np.ndarray, first: float) -> None:
    """A curve for each column of ``values (T, n)``, with a key on each frame."""
    frames = first + np.arange(len(values))
    for column in range(values.shape[1]):
        curve = bag.fcurves.new(path, index=column)
        curve.keyframe_points.add(len(values))
        curve.keyframe_points.foreach_set("co", np.stack([frames, values[:, column]], -1).ravel())
        curve.update()


def _depth(bone: bpy.types.Bone) -> int:
    return len(bone.parent_recursive)


def _plain_names(names: list[str]) -> list[str]:
    """Names as BVH files take them: without blanks and braces, each once."""
    plain: list[str] = []
    for name in names:
        word = re.sub(r"[\s{}]+", "_", name)
        while word in plain:
            word += "_"
        plain.append(word)
    return plain
