"""Render the picture of docs/blender.md.

    PYTHON_WITH_BPY tools/make_blender_picture.py OUT.png

The same clap twice on the same character, made by the operators of the extension: as found, and with hands that are
held apart.
"""

import atexit
import json
import math
import sys
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
import blender  # noqa: E402

FRAME = 67  # of the clip: hands touch
SPAN = [50, 80]
HANDS = {"between": ["left hand", "right hand"], "frames": SPAN}
CONTACTS = ([], [HANDS | {"gap": 20}])  # of the two characters
APART = 1.2  # distance between the characters [m]


def performer(number: int, contacts: list) -> None:
    """Add a character with the motion and some contacts at its place in the row."""
    scene, before = bpy.context.scene, {*bpy.data.objects}
    bpy.ops.import_scene.gltf(filepath=str(ROOT / "sample_characters" / "hero.glb"))
    new = [each for each in bpy.data.objects if each not in before]
    armature = next(each for each in new if each.type == "ARMATURE")
    bpy.context.view_layer.objects.active = armature
    settings = scene.distretarget
    settings.contacts.clear()
    for entry in contacts:
        row = settings.contacts.add()
        row.clip, row.entry = settings.clip_key, json.dumps(entry)
    bpy.ops.distretarget.retarget()
    next(each for each in new if each.parent is None).location.x = (number - 0.5) * APART  # motions are in the world
    for mesh in (each for each in new if each.type == "MESH"):
        shade(mesh)


def shade(mesh: bpy.types.Object) -> None:
    """Give a mesh a plain colour and smooth shading."""
    material = bpy.data.materials.new("Clay")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.55, 0.36, 0.24, 1.0)
    mesh.data.materials.clear()
    mesh.data.materials.append(material)
    mesh.data.shade_smooth()


def stage() -> None:
    """Add a floor, a sun and a camera."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60)
    bpy.ops.object.light_add(type="SUN", rotation=(math.radians(40), math.radians(15), 0))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 1.6, 0.2
    bpy.ops.object.camera_add(location=(0, -6.0, 0.95), rotation=(math.radians(89.5), 0, 0))
    scene.camera, scene.camera.data.lens = bpy.context.object, 70
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.55, 0.55, 0.55)
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 64
    scene.cycles.use_denoising = True
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 440, 270, 100
    scene.render.image_settings.color_mode, scene.render.image_settings.compression = "RGB", 100


def main() -> None:
    """Render the picture."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender.register()
    atexit.register(blender.unregister)
    scene = bpy.context.scene
    scene.render.fps = 60
    scene.distretarget.clip = str(ROOT / "sample_bvh" / "clap.bvh")
    for number, contacts in enumerate(CONTACTS):
        performer(number, contacts)
    stage()
    scene.frame_set(1 + FRAME)
    scene.render.filepath = str(Path(sys.argv[1]).resolve())
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
