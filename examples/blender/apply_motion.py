"""Put a retargeted BVH on the character whose rest pose was the target, and save it with its mesh.

blender --background --python apply_motion.py -- CHARACTER.fbx MOTION.bvh OUT.glb

OUT is a glTF, FBX or .blend file. Also runs with `pip install bpy`, without `blender --background --python`. Bones are
found by their names; a bone whose name is not in MOTION keeps its rest pose.
"""

import sys
from pathlib import Path

import bpy
from mathutils import Matrix

sys.path.append(str(Path(__file__).parent))  # Blender does not look beside a script
from character import open_character


def import_motion(path: str) -> bpy.types.Object:
    """Import a BVH in Blender's axes, as export_target.py writes them, with its frame rate."""
    bpy.ops.import_anim.bvh(
        filepath=path, axis_forward="Y", axis_up="Z", rotate_mode="QUATERNION", update_scene_fps=True
    )
    return bpy.context.object


def copy_pose(motion: bpy.types.Object, character: bpy.types.Object, frame: int) -> None:
    """Set keys for the character: each bone turns from its rest as in the motion, and its head is where it is there."""
    poses: dict[str, Matrix] = {}
    for bone in character.pose.bones:  # parents come before their children
        rest, parent = bone.bone.matrix_local, bone.parent
        rest_below = parent.bone.matrix_local.inverted() @ rest if parent else rest
        above = poses[parent.name] if parent else Matrix()
        moved = motion.pose.bones.get(bone.name)
        if moved:
            turn = moved.matrix.to_3x3() @ moved.bone.matrix_local.to_3x3().inverted()
            poses[bone.name] = Matrix.Translation(moved.matrix.translation) @ (turn @ rest.to_3x3()).to_4x4()
            bone.rotation_mode = "QUATERNION"
            bone.matrix_basis = rest_below.inverted() @ above.inverted() @ poses[bone.name]
            bone.keyframe_insert("rotation_quaternion", frame=frame)
            bone.keyframe_insert("location", frame=frame)
        else:
            poses[bone.name] = above @ rest_below


def save(path: Path) -> None:
    """Save the scene in the format that the suffix names."""
    if path.suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    elif path.suffix.lower() == ".fbx":
        bpy.ops.export_scene.fbx(filepath=str(path), add_leaf_bones=False, bake_anim_simplify_factor=0)
    else:
        bpy.ops.export_scene.gltf(filepath=str(path), export_animations=True)


def main() -> None:
    """Copy the motion frame by frame."""
    character_file, motion_file, out = sys.argv[sys.argv.index("--") + 1 :]
    character = open_character(Path(character_file))
    character.animation_data_clear()
    motion = import_motion(motion_file)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = map(round, motion.animation_data.action.frame_range)
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        copy_pose(motion, character, frame)
    bpy.data.objects.remove(motion)
    save(Path(out))
    print(f"{out}: {scene.frame_end} frames")


if __name__ == "__main__":
    main()
