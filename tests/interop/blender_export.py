"""Let Blender export a character in several ways: python blender_export.py FILE FOLDER, with the package bpy.

Writes FOLDER/WAY.glb for each way. The last line printed has, by way, where the heads of the bones are at rest, by
their names, in the axes of glTF.
"""

import json
import sys

import bpy
from mathutils import Matrix

MOVED = Matrix.Translation((1, 2, 0.5)) @ Matrix.Rotation(0.7, 4, "Z") @ Matrix.Scale(0.5, 4)
WAYS = {  # by name, the settings of the exporter
    "usual": {},
    "moved": {},
    "another pose": {"export_rest_position_armature": False},
    "no armature": {"export_armature_object_remove": True},
    "applied": {},
}
answer = {}
for way, settings in WAYS.items():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=sys.argv[1])
    body = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    if way == "moved":
        body.matrix_world = MOVED @ body.matrix_world
    if way == "applied":
        bpy.ops.object.select_all(action="SELECT")
        bpy.context.view_layer.objects.active = body
        bpy.ops.object.transform_apply(location=False, rotation=True, scale=True)
    bpy.context.scene.frame_set(10)
    heads = {bone.name: body.matrix_world @ bone.head_local for bone in body.data.bones}
    answer[way] = {name: [place.x, place.z, -place.y] for name, place in heads.items()}
    bpy.ops.export_scene.gltf(filepath=f"{sys.argv[2]}/{way}.glb", export_format="GLB", **settings)
sys.stdout.write("\n" + json.dumps(answer) + "\n")
