"""Play a glTF file in Blender: python blender_gltf.py TASK, the path of a JSON file, with the package bpy.

The task has file, animation (a number, or null), times and nodes.
The last line printed has the positions of the nodes in the axes of glTF.
"""

import json
import sys
from pathlib import Path

import bpy
from io_scene_gltf2.blender.imp.animation import BlenderAnimation
from io_scene_gltf2.blender.imp.blender_gltf import BlenderGlTF

FPS = 60

task = json.loads(Path(sys.argv[1]).read_text("utf-8"))
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = FPS
read = []
create = BlenderGlTF.create


def keep(gltf):
    read.append(gltf)
    if task["animation"] is None:
        gltf.data.animations = None  # Blender would show the first
    create(gltf)


BlenderGlTF.create = staticmethod(keep)
bpy.ops.import_scene.gltf(filepath=task["file"])
gltf = read[0]
if task["animation"] is not None:
    BlenderAnimation.restore_animation(gltf, gltf.data.animations[task["animation"]].track_name)


def place(node):
    """Where a node of the file is now, None where Blender left it out."""
    found = gltf.vnodes[node]
    if name := getattr(found, "blender_bone_name", None):
        body = gltf.vnodes[found.bone_arma].blender_object
        x, y, z = body.matrix_world @ body.pose.bones[name].head
    elif thing := getattr(found, "blender_object", None):
        x, y, z = thing.matrix_world.translation
    else:
        return None
    return [x, z, -y]


positions = []
for time in task["times"]:
    frame = time * FPS
    scene.frame_set(int(frame), subframe=frame % 1)
    positions.append([place(node) for node in task["nodes"]])

sys.stdout.write("\n" + json.dumps(positions) + "\n")
