"""Play a glTF file in Blender: python blender_gltf.py TASK, the path of a JSON file, with the package bpy.

The task has file, animation (a number, or null), times, nodes, and for a picture camera, size and picture (a path).
The last line printed has the positions of the nodes in the axes of glTF.
"""

import json
import sys
from pathlib import Path

import bpy
from io_scene_gltf2.blender.imp.animation import BlenderAnimation
from io_scene_gltf2.blender.imp.blender_gltf import BlenderGlTF
from mathutils import Vector

FPS = 60
SIDE = 3  # of the camera, as in players_page.mjs

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

if "camera" in task:
    x, y, z = task["camera"]["centre"]
    half, sign = task["camera"]["half"], -1 if task["camera"].get("back") else 1
    centre = Vector((x, -z, y))
    view = bpy.data.objects.new("view", bpy.data.cameras.new("view"))
    view.data.type, view.data.ortho_scale = "ORTHO", 2 * half
    view.data.clip_end = 20 * half
    view.location = centre + SIDE * half * Vector((0.5 * sign, -sign, 0.25))
    view.rotation_euler = (centre - view.location).to_track_quat("-Z", "Y").to_euler()
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 0.5, view.rotation_euler
    for thing in (view, sun):
        scene.collection.objects.link(thing)
    for body in [thing for thing in scene.objects if thing.type == "ARMATURE"]:
        body.hide_render = True
    world = bpy.data.worlds.new("white")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)
    scene.world, scene.camera = world, view
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.device, scene.cycles.max_bounces = 2, "CPU", 1
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x = scene.render.resolution_y = task["size"]
    scene.render.image_settings.file_format, scene.render.filepath = "PNG", task["picture"]
    bpy.ops.render.render(write_still=True)
sys.stdout.write("\n" + json.dumps(positions) + "\n")
