"""Print where Blender finds the joints of a BVH file: python blender.py FILE FRAMES, with the package bpy."""

import json
import sys

import bpy

file, frames = sys.argv[1], int(sys.argv[2])
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=file, axis_forward="Y", axis_up="Z", rotate_mode="NATIVE", frame_start=1)
body = bpy.context.object
positions = []
for frame in range(frames):
    bpy.context.scene.frame_set(1 + frame)
    positions.append([list(body.matrix_world @ bone.head) for bone in body.pose.bones])
sys.stdout.write("\n" + json.dumps({"names": [bone.name for bone in body.pose.bones], "positions": positions}) + "\n")
