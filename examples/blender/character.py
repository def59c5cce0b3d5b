"""Open a character in Blender."""

from pathlib import Path

import bpy


def open_character(path: Path) -> bpy.types.Object:
    """Open an FBX, glTF or .blend file in an empty scene; return its armature."""
    if path.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path))
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        read = bpy.ops.import_scene.fbx if path.suffix.lower() == ".fbx" else bpy.ops.import_scene.gltf
        read(filepath=str(path))
    armatures = [each for each in bpy.context.scene.objects if each.type == "ARMATURE"]
    if len(armatures) != 1:
        raise SystemExit(f"{path}: expected one armature, found {len(armatures)}")
    return armatures[0]
