"""Run by a Python that has bpy: python check_character.py FILE FPS FRAME... prints what Blender made of the file, as JSON.

FILE is a .glb or an .fbx. World positions of the pose bones' heads are glTF's (Y up, metres) again, at the given frames.
"""

import json
import sys

import bpy

path, fps, *frames = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = int(fps)
if path.endswith(".fbx"):
    bpy.ops.import_scene.fbx(filepath=path)
else:
    bpy.ops.import_scene.gltf(filepath=path)
armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
meshes = [o for o in bpy.data.objects if o.type == "MESH"]
result = {
    "empties": [o.name for o in bpy.data.objects if o.type == "EMPTY"],
    "armatures": [o.name for o in armatures],
    "actions": [a.name for a in bpy.data.actions],
    "frame_range": [min(a.frame_range[0] for a in bpy.data.actions), max(a.frame_range[1] for a in bpy.data.actions)],
    "meshes": {
        o.name: {
            "vertices": len(o.data.vertices),
            "skinned": any(m.type == "ARMATURE" for m in o.modifiers),
            "keys": [k.name for k in o.data.shape_keys.key_blocks][1:] if o.data.shape_keys else [],
        }
        for o in meshes
    },
    "samples": [],
}
for frame in map(int, frames):
    bpy.context.scene.frame_set(frame)
    graph = bpy.context.evaluated_depsgraph_get()
    positions = {}
    for armature in armatures:
        pose_of_frame = armature.evaluated_get(graph)
        for bone in pose_of_frame.pose.bones:
            x, y, z = pose_of_frame.matrix_world @ bone.head
            positions[bone.name] = [x, z, -y]
    weights, boxes = {}, {}
    for o in meshes:
        if o.data.shape_keys:
            keys = o.data.shape_keys.evaluated_get(graph).key_blocks
            weights[o.name] = {k.name: k.value for k in keys[1:]}
        object_of_frame = o.evaluated_get(graph)
        mesh = object_of_frame.to_mesh()
        points = [object_of_frame.matrix_world @ v.co for v in mesh.vertices]
        points = [(p.x, p.z, -p.y) for p in points]
        if points:
            boxes[o.name] = [[f(p[k] for p in points) for k in range(3)] for f in (min, max)]
        object_of_frame.to_mesh_clear()
    result["samples"].append({"frame": frame, "positions": positions, "weights": weights, "boxes": boxes})
print("RESULT " + json.dumps(result))
