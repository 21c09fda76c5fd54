"""Run by a Python that has bpy: python export_fbx.py FILE.glb FILE.fbx FRAMES FORWARD UP SCALE: an FBX as Blender writes it."""

import sys

import bpy

source, target, frames, forward, up, scale = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 30
bpy.ops.import_scene.gltf(filepath=source)
for item in list(bpy.data.objects):
    if item.name.startswith("Icosphere"):  # Blender's own bone shape
        bpy.data.objects.remove(item)
bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, int(frames) - 1
options = {"axis_forward": forward, "axis_up": up, "apply_scale_options": scale}
bpy.ops.export_scene.fbx(filepath=target, bake_anim_simplify_factor=0, **options)
