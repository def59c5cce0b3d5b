"""Write the rest pose of a character as BVH, which is a target for distretarget.

blender --background --python export_target.py -- CHARACTER.fbx TARGET.bvh

CHARACTER is an FBX, glTF or .blend file with one armature. Also runs with `pip install bpy`, without `blender
--background --python`.
"""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))  # Blender does not look beside a script
from character import open_character


def main() -> None:
    """Export the armature in its rest pose, a frame long."""
    character, target = sys.argv[sys.argv.index("--") + 1 :]
    armature = open_character(Path(character))
    armature.data.pose_position = "REST"
    armature.animation_data_clear()
    bpy.context.view_layer.objects.active = armature
    bpy.ops.export_anim.bvh(filepath=target, frame_start=1, frame_end=1, root_transform_only=False)
    print(f"{target}: {len(armature.data.bones)} bones of {armature.name}")


if __name__ == "__main__":
    main()
