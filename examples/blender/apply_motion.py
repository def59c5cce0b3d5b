"""Put a retargeted BVH on the character in a .blend file whose skeleton was the target, and save it under a new name.

blender --background --python apply_motion.py -- HERO.blend WALK.bvh HERO_WALK.blend [--armature NAME]

Also runs with `pip install bpy`, without `blender --background --python`. Every joint of the motion must be a bone of
the armature. Constraints and drivers that would move these bones are muted. In the end the joints are compared with the
motion in all frames; the exit code is 1 if one is off by more than a millimetre on a body of 1.7 m.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

sys.path.append(str(Path(__file__).parent))  # Blender does not look beside a script
from bvh import Clip, read_clip
from character import fail, listed, open_character, parse_arguments, warn, warn_of_rig
from rig import constraints_on, drivers_on, moved_bones, skeleton

USAGE = "blender --background --python apply_motion.py -- HERO.blend WALK.bvh HERO_WALK.blend [--armature NAME]"
BODY = 1700.0  # height of the body on which distances are stated [mm]
TOLERANCE = 1.0  # distance that counts as an error [mm on that body]
STILL = 1e-6  # locations up to this get no keys [of the body]


def check_names(armature: bpy.types.Object, clip: Clip, path: Path) -> None:
    """End if the motion has joints that the armature lacks; name the joints of the mesh that the motion lacks."""
    bones = armature.data.bones
    unknown = [name for name, parent in clip.parents.items() if name not in bones and (parent or name != armature.name)]
    if unknown:
        fail(f"{path}: {len(unknown)} joints are no bones of {armature.name!r}: {listed(unknown)}")
    missing = [name for name in skeleton(armature) if name not in clip.parents]
    if missing:
        warn(f"{len(missing)} bones are not in {path} and keep their rest pose: {listed(missing)}")


def check_rest(armature: bpy.types.Object, clip: Clip, path: Path) -> None:
    """End if the bones of the motion are not those of the armature in its rest pose."""
    rests, size = rest_poses(armature, clip), body_size(armature, clip)
    for name, parent in clip.parents.items():
        if parent:
            offset = (rests[name] - rests[parent])[:3, 3]
            if np.linalg.norm(offset - clip.offsets[name]) > TOLERANCE / BODY * size:
                here, there = (np.round(each, 4).tolist() for each in (offset, clip.offsets[name]))
                fail(f"{path}: {name!r} has the offset {there}, in {armature.name!r} {here}; make the target anew")


def rest_poses(armature: bpy.types.Object, clip: Clip) -> dict[str, np.ndarray]:
    """(4, 4), the rest pose of each joint in the world."""
    world, bones = np.array(armature.matrix_world), armature.data.bones
    return {name: world @ np.array(bones[name].matrix_local) if name in bones else world for name in clip.parents}


def body_size(armature: bpy.types.Object, clip: Clip) -> float:
    """The height of the joints in the rest pose, or their width if that is larger [units of the scene]."""
    heads = np.array([rest[:3, 3] for rest in rest_poses(armature, clip).values()])
    return float(np.ptp(heads, axis=0).max())


def clear_animation(armature: bpy.types.Object, moved: list[bpy.types.PoseBone]) -> None:
    """Leave every bone in its rest pose, with nothing but keys to move the bones `moved`."""
    for _, constraint in constraints_on(armature, moved):
        constraint.mute = True
    for _, curve in drivers_on(armature, moved):
        curve.mute = True
    data = armature.animation_data_create()
    data.use_tweak_mode = False
    data.action, data.action_blend_type, data.action_influence = None, "REPLACE", 1.0
    for track in data.nla_tracks:
        track.mute = True
    armature.data.pose_position = "POSE"
    for bone in armature.pose.bones:
        bone.matrix_basis = Matrix()


def set_keys(armature: bpy.types.Object, moved: list[bpy.types.PoseBone], clip: Clip, name: str) -> None:
    """Give the armature an action in which each joint turns from its rest pose as in the motion, at its place there."""
    armature.animation_data.action = bpy.data.actions.new(name)
    back, rests = np.linalg.inv(armature.matrix_world), rest_poses(armature, clip)
    still = STILL * body_size(armature, clip) * np.linalg.norm(back[0, :3])
    poses: dict[str, list[Matrix]] = {}
    for bone in moved:
        parents = poses[bone.parent.name] if bone.parent else [Matrix()] * len(clip)
        if bone.name not in clip.parents:
            poses[bone.name] = [converted(bone, Matrix(), parent, invert=False) for parent in parents]
            continue
        axes = np.eye(4)
        axes[:3, :3] = rests[bone.name][:3, :3]
        poses[bone.name] = list(map(Matrix, back @ clip.poses[bone.name] @ axes))
        keys = [
            converted(bone, pose, parent, invert=True).decompose()[:2]
            for pose, parent in zip(poses[bone.name], parents, strict=True)
        ]
        bone.rotation_mode = "QUATERNION"
        moving = max(location.length for location, _ in keys) > still
        for frame, (location, rotation) in enumerate(keys, 1):
            rotation.make_compatible(bone.rotation_quaternion)
            bone.location, bone.rotation_quaternion = location, rotation
            bone.keyframe_insert("rotation_quaternion", frame=frame)
            if moving:
                bone.keyframe_insert("location", frame=frame)


def converted(bone: bpy.types.PoseBone, matrix: Matrix, parent: Matrix, invert: bool) -> Matrix:
    """A bone's own transform as its pose in the armature, or the other way round with `invert`."""
    above = bone.bone.parent.matrix_local if bone.parent else Matrix()
    return bone.bone.convert_local_to_pose(
        matrix, bone.bone.matrix_local, parent_matrix=parent, parent_matrix_local=above, invert=invert
    )


def set_times(scene: bpy.types.Scene, clip: Clip) -> None:
    """Play the frames of the motion, from 1, at its frame rate."""
    scene.frame_start, scene.frame_end = 1, len(clip)
    scene.render.fps = max(1, round(1 / clip.frame_time))
    scene.render.fps_base = scene.render.fps * clip.frame_time


@contextmanager
def visible(armature: bpy.types.Object) -> Iterator[None]:
    """Show an armature for a while: Blender does not move what is hidden or in an excluded collection."""
    objects, hidden = bpy.context.scene.collection.objects, armature.hide_viewport
    linked = armature.name in objects
    if not linked:
        objects.link(armature)
    armature.hide_viewport = False
    yield
    armature.hide_viewport = hidden
    if not linked:
        objects.unlink(armature)


def farthest(armature: bpy.types.Object, clip: Clip) -> tuple[float, str, int]:
    """How far Blender has a joint from its place in the motion [mm on a body of 1.7 m], with joint and frame."""
    scene, worst = bpy.context.scene, (0.0, "", 0)
    scale = BODY / body_size(armature, clip)
    names = [name for name in clip.parents if name in armature.pose.bones]
    for frame in range(len(clip)):
        scene.frame_set(frame + 1)
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        heads = np.array([shown.matrix_world @ shown.pose.bones[name].head for name in names])
        places = np.array([clip.poses[name][frame, :3, 3] for name in names])
        off = np.linalg.norm(heads - places, axis=1) * scale
        worst = max(worst, (float(off.max()), names[off.argmax()], frame + 1))
    return worst


def main() -> None:
    """Set the keys, save the file, and look whether the joints are where they should be."""
    files = parse_arguments(USAGE, "character", "motion", "out")
    if files.out.suffix != ".blend" or files.out.resolve() == files.character.resolve():
        fail(f"{files.out}: expected another name that ends with .blend; save as other formats in Blender")
    clip = read_clip(files.motion)
    armature = open_character(files.character, files.armature)
    check_names(armature, clip, files.motion)
    check_rest(armature, clip, files.motion)
    warn_of_rig(armature, clip.parents)
    moved = moved_bones(armature, clip.parents)
    clear_animation(armature, moved)
    set_keys(armature, moved, clip, files.motion.stem)
    set_times(bpy.context.scene, clip)
    with visible(armature):
        distance, joint, frame = farthest(armature, clip)
    bpy.context.scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(files.out.resolve()))
    print(f"{files.out}: {len(clip)} frames on {len(clip.parents)} bones of {armature.name!r}")
    off = f"joints are up to {distance:.3f} mm from the motion on a body of 1.7 m: {joint!r} in frame {frame}"
    if not distance <= TOLERANCE:
        fail(f"{files.out} is saved, but {off}")
    print(off)


if __name__ == "__main__":
    main()
