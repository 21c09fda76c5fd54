"""Run by a Python that has ``bpy``: import a BVH into Blender as a user would, and compare bones with forward kinematics.

Usage: ``python check_bvh.py talk.bvh positions.npz``, where the npz holds ``names (J,)`` and ``positions (T, J, 3)`` in the
file's units and axes. Prints one line of JSON; it is the caller who judges.
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


def largest_step(armature: bpy.types.Object) -> float:
    """Largest change of an Euler curve from key to key, in degrees; a jump of 360° would show here."""
    animation = armature.animation_data
    bag = animation.action.layers[0].strips[0].channelbag(animation.action_slot)
    steps = [0.0]
    for curve in bag.fcurves:
        if curve.data_path.endswith("rotation_euler"):
            values = np.array([point.co[1] for point in curve.keyframe_points])
            steps.append(float(np.abs(np.diff(values)).max(initial=0)))
    return float(np.degrees(max(steps)))


def main(bvh: str, expected: str) -> None:
    """Import, compare, print."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_anim.bvh(filepath=bvh, update_scene_fps=True, frame_start=1)
    armature = bpy.context.object
    with np.load(expected, allow_pickle=False) as data:
        names, positions = [str(name) for name in data["names"]], data["positions"]
    heads = bone_heads(armature, names, len(positions), 1)
    ours = np.stack([positions[..., 0], -positions[..., 2], positions[..., 1]], -1)  # Y up, as Blender turns it: Z up
    scene = bpy.context.scene
    result = {
        "bones": sorted(bone.name for bone in armature.data.bones),
        "frames": int(armature.animation_data.action.frame_range[1]),
        "fps": scene.render.fps / scene.render.fps_base,
        "largest_error": float(np.abs(heads - ours).max()),
        "largest_step": largest_step(armature),
        "order": armature.pose.bones[names[0]].rotation_mode,
    }
    sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
