"""Run by a Python that has ``bpy``: import a BVH into Blender as a user would, and compare bones with forward kinematics.

Usage: ``python check_bvh.py talk.bvh positions.npz``, where the npz holds ``names (J,)``, ``positions (T, J, 3)`` and
``rest (J, 3)`` in the file's units and axes. Prints one line of JSON; it is the caller who judges.
"""

from __future__ import annotations

import json
import sys

import bpy
import numpy as np


def bone_heads(armature: bpy.types.Object, names: list[str], frames: int, start: int) -> np.ndarray:
    """(T, J, 3) world positions of the bones' heads, in Blender's axes."""
    scene, heads = bpy.context.scene, np.empty((frames, len(names), 3))
    for frame in range(frames):
        scene.frame_set(start + frame)
        world = armature.matrix_world
        for k, name in enumerate(names):
            heads[frame, k] = world @ armature.pose.bones[name].head
    return heads


def z_up(positions: np.ndarray) -> np.ndarray:
    """From the file's axes to Blender's, as its importer turns them: Y up → Z up."""
    return np.stack([positions[..., 0], -positions[..., 2], positions[..., 1]], -1)


def main(bvh: str, expected: str) -> None:
    """Import, compare, print."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_anim.bvh(filepath=bvh, update_scene_fps=True, frame_start=1)
    armature = bpy.context.object
    with np.load(expected, allow_pickle=False) as data:
        names, positions, rest = [str(name) for name in data["names"]], data["positions"], data["rest"]
    heads = bone_heads(armature, names, len(positions), 1)
    rest_heads = np.array([armature.matrix_world @ armature.data.bones[name].head_local for name in names])
    scene = bpy.context.scene
    result = {
        "bones": sorted(bone.name for bone in armature.data.bones),
        "frames": int(armature.animation_data.action.frame_range[1]),
        "fps": scene.render.fps / scene.render.fps_base,
        "largest_error": float(np.abs(heads - z_up(positions)).max()),
        "rest_error": float(np.abs(rest_heads - z_up(rest)).max()),
        "order": armature.pose.bones[names[0]].rotation_mode,
    }
    sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
