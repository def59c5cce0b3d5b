"""Write the skeleton of a character in a .blend file, which is a target for distretarget.

blender --background --python export_target.py -- HERO.blend HERO.json [--armature NAME]

Also runs with `pip install bpy`, without `blender --background --python`. The skeleton has the bones that the meshes of
the character need, in their rest pose, in the axes and units of the scene. It has no End Sites: Blender gives every
bone a tail, also where nobody has measured one.
"""

import json
import sys
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.append(str(Path(__file__).parent))  # Blender does not look beside a script
from character import open_character, parse_arguments, warn_of_rig
from rig import Joints, skeleton

USAGE = "blender --background --python export_target.py -- HERO.blend HERO.json [--armature NAME]"
CHANNELS = [kind + what for what in ("position", "rotation") for kind in "XYZ"]
UNITS = {1.0: "m", 0.1: "dm", 0.01: "cm", 0.001: "mm", 0.0254: "in", 0.3048: "ft"}  # by the scene's unit scale


def document(armature: bpy.types.Object, joints: Joints) -> dict[str, object]:
    """A skeleton file (full form); see docs/formats.md."""
    heads = dict.fromkeys(joints, armature.matrix_world.translation)
    heads |= {bone.name: armature.matrix_world @ bone.head_local for bone in armature.data.bones}
    entries = [
        {
            "name": name,
            "parent": parent,
            "offset": list(heads[name] - heads.get(parent, Vector())),
            "channels": CHANNELS,
        }
        for name, parent in joints.items()
    ]
    units = UNITS.get(round(bpy.context.scene.unit_settings.scale_length, 6))
    head = {"format": "distretarget-skeleton", "version": 1, "name": armature.name, "units": units, "up": "Z"}
    return {key: value for key, value in head.items() if value is not None} | {"joints": entries}


def main() -> None:
    """Write the file."""
    files = parse_arguments(USAGE, "character", "target")
    armature = open_character(files.character, files.armature)
    joints = skeleton(armature)
    warn_of_rig(armature, joints)
    files.target.write_text(json.dumps(document(armature, joints), indent=1, ensure_ascii=False), "utf-8")
    print(f"{files.target}: {len(joints)} joints of the {len(armature.data.bones)} bones of {armature.name!r}")


if __name__ == "__main__":
    main()
