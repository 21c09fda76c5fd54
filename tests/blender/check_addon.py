"""Run by a Python that has bpy: python check_addon.py ZIP SOUND RIG COMMAND prints what the add-on made, as JSON.

RIG is a .glb to import, or "a-pose": an armature whose arms hang at 45 degrees, with a mesh that has two shape keys.
"""

import json
import sys
import zipfile
from pathlib import Path

import bpy
from mathutils import Vector

archive, sound, rig, command = sys.argv[1:]
folder = Path(archive).parent / "addons" / "cospeech_addon"
zipfile.ZipFile(archive).extractall(folder)
sys.path.insert(0, str(folder.parent))
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 30


def a_pose() -> bpy.types.Object:
    """Mixamo's names; Z up, facing −Y; metres. The bone of a hand points where its forearm does."""
    places = {"Hips": (None, (0, 0, 1.0)), "Spine": ("Hips", (0, 0, 1.1)), "Spine1": ("Spine", (0, 0, 1.22))}
    places |= {"Spine2": ("Spine1", (0, 0, 1.34)), "Neck": ("Spine2", (0, 0, 1.5)), "Head": ("Neck", (0, 0, 1.6))}
    for side, x in (("Left", 1), ("Right", -1)):
        places[f"{side}Shoulder"] = ("Spine2", (0.05 * x, 0, 1.45))
        places[f"{side}Arm"] = (f"{side}Shoulder", (0.18 * x, 0, 1.45))
        places[f"{side}ForeArm"] = (f"{side}Arm", (0.38 * x, 0, 1.25))
        places[f"{side}Hand"] = (f"{side}ForeArm", (0.56 * x, 0, 1.07))
        places[f"{side}UpLeg"] = ("Hips", (0.1 * x, 0, 0.95))
        places[f"{side}Leg"] = (f"{side}UpLeg", (0.1 * x, 0, 0.5))
        places[f"{side}Foot"] = (f"{side}Leg", (0.1 * x, 0, 0.08))
        places[f"{side}ToeBase"] = (f"{side}Foot", (0.1 * x, -0.13, 0.02))
    body = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    scene.collection.objects.link(body)
    bpy.context.view_layer.objects.active = body
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (parent, head) in places.items():
        bone = body.data.edit_bones.new(f"mixamorig:{name}")
        bone.head = head
        after = [Vector(p) for above, p in places.values() if above == name]
        bone.tail = after[0] if after else bone.head + Vector((0, 0, 0.1) if name == "Head" else (0, -0.1, 0))
        if name.endswith("Hand"):
            bone.tail = bone.head + Vector((0.06 if head[0] > 0 else -0.06, 0, -0.06))
        if parent:
            bone.parent = body.data.edit_bones[f"mixamorig:{parent}"]
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = bpy.data.objects.new("Face", bpy.data.meshes.new("Face"))
    mesh.data.from_pydata([(0, 0, 1.6), (0.1, 0, 1.6), (0, 0, 1.7)], [], [(0, 1, 2)])
    scene.collection.objects.link(mesh)
    for name in ("Basis", "JawOpen", "eyeBlinkLeft"):
        mesh.shape_key_add(name=name)
    mesh.modifiers.new("Armature", "ARMATURE").object = body
    body.location, body.rotation_euler = (1.0, 2.0, 0.0), (0, 0, 1.5707963267948966)
    return body


if rig == "a-pose":
    armature = a_pose()
else:
    bpy.ops.import_scene.gltf(filepath=rig)
    armature = next(each for each in bpy.data.objects if each.type == "ARMATURE")
bpy.context.view_layer.update()
editor = scene.sequence_editor_create()
editor.strips.new_sound("Talk", sound, 1, 11)
import cospeech_addon  # noqa: E402

cospeech_addon.register()
bpy.context.view_layer.objects.active = armature
armature.select_set(True)
scene.cospeech.emotion, scene.cospeech.seed, scene.cospeech.style = "happiness", 3, "lively"
before = set(bpy.data.actions)
status = bpy.ops.cospeech.generate(command=command)
result = {"done": sorted(status), "actions": {}, "heads": {}, "tails": {}, "keys": {}}
for action in set(bpy.data.actions) - before:
    curves = action.layers[0].strips[0].channelbags[0].fcurves
    result["actions"][action.name] = {"curves": len(curves), "frames": list(action.frame_range)}
for frame in (11, 40, 70):
    scene.frame_set(frame)
    for what in ("head", "tail"):
        world = {bone.name: armature.matrix_world @ getattr(bone, what) for bone in armature.pose.bones}
        result[f"{what}s"][frame] = {name: list(place) for name, place in world.items()}
    result["keys"][frame] = {
        f"{mesh.name}/{key.name}": key.value
        for mesh in bpy.data.objects
        if mesh.type == "MESH" and mesh.data.shape_keys
        for key in mesh.data.shape_keys.key_blocks
    }
armature.data.name = "again"
try:
    status_of_nonsense = bpy.ops.cospeech.generate(command=f"{command} --nonsense")
except RuntimeError as error:
    result["failure"] = str(error)
cospeech_addon.unregister()
print("RESULT " + json.dumps(result))
