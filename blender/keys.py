# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion as a new action of an armature."""

from collections.abc import Iterable, Mapping, Sequence

import bpy
import numpy as np
from mathutils import Matrix

from .rig import moved_bones

STILL = 1e-5  # smaller locations get no keys [of the bone's length]
LINEAR = 1  # Blender's number of linear interpolation
Frames = dict[str, list[Matrix]]  # by bone, a matrix per frame


def poses_of(armature: bpy.types.Object, joints: Sequence[str], matrices: np.ndarray) -> tuple[Frames, Frames]:
    """Poses in armature space, and transforms relative to the rest pose, of the bones of joints and of their ancestors,
    which stay at rest.

    `matrices`, (frames, joints, 4, 4), have the joints' world positions and their rotations from the rest pose.
    """
    world, poses, transforms = np.array(armature.matrix_world), {}, {}
    for bone in moved_bones(armature, joints):
        above = poses[bone.parent.name] if bone.parent else [None] * len(matrices)
        if bone.name in joints:
            axes = world @ np.array(bone.bone.matrix_local)
            axes[:3, 3] = 0.0
            posed = np.linalg.inv(world) @ matrices[:, joints.index(bone.name)] @ axes
            poses[bone.name] = [*map(Matrix, posed.tolist())]
            pairs = zip(poses[bone.name], above, strict=True)
            transforms[bone.name] = [converted(bone, pose, parent, invert=True) for pose, parent in pairs]
        else:
            transforms[bone.name] = [Matrix()] * len(matrices)
            poses[bone.name] = [converted(bone, Matrix(), parent, invert=False) for parent in above]
    return poses, transforms


def converted(bone: bpy.types.PoseBone, matrix: Matrix, parent: Matrix | None, invert: bool) -> Matrix:
    """A bone's pose in armature space, from its transform relative to its rest pose, or with `invert` the reverse."""
    above = {} if parent is None else {"parent_matrix": parent, "parent_matrix_local": bone.bone.parent.matrix_local}
    return bone.bone.convert_local_to_pose(matrix, bone.bone.matrix_local, invert=invert, **above)


def without_action(armature: bpy.types.Object) -> bpy.types.AnimData:
    """Unlink the armature's action, which stays in the file, put all bones in the rest pose, and show it as the pose;
    return the armature's animation data.
    """
    data = armature.animation_data_create()
    data.use_tweak_mode = False
    if data.action is not None:
        data.action.use_fake_user = True
    data.action = None
    armature.data.pose_position = "POSE"
    for bone in armature.pose.bones:
        bone.matrix_basis = Matrix()
    return data


def keyed(
    armature: bpy.types.Object,
    name: str,
    times: np.ndarray,
    transforms: Mapping[str, Sequence[Matrix]],
    switches: Iterable[tuple[str, str, float]],
) -> bpy.types.Action:
    """Give the armature a new action with full influence, and return it.

    `transforms` of bones are relative to the rest pose, one for each of the `times` [frames of the scene]; `switches`
    are constant custom properties, (bone, property, value) each.
    """
    data = without_action(armature)
    action = data.action = bpy.data.actions.new(name)
    data.action_blend_type, data.action_influence = "REPLACE", 1.0
    for bone, each in transforms.items():
        _set_keys(action, armature.pose.bones[bone], each, times)
    for owner, switch, value in switches:
        bone = armature.pose.bones[owner]
        set_switch(bone, switch, value)
        bone.keyframe_insert(f'["{bpy.utils.escape_identifier(switch)}"]', frame=times[0], group=bone.name)
    return action


def set_switch(bone: bpy.types.PoseBone, name: str, value: float) -> None:
    """Set a custom property of a bone, which keeps its type."""
    bone[name] = type(bone[name])(value)


def curves_of(action: bpy.types.Action) -> bpy.types.bpy_prop_collection:
    """The curves of an action, which Blender 5.0 and later have in layers."""
    return action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves


def _set_keys(
    action: bpy.types.Action, bone: bpy.types.PoseBone, transforms: Sequence[Matrix], times: np.ndarray
) -> None:
    """Set the keys of a bone: rotations, in its own mode for the sake of its other actions and of drivers that read it,
    and locations unless all are `STILL`.
    """
    locations, rotations, _ = zip(*(Matrix(transform).decompose() for transform in transforms), strict=True)
    if bone.rotation_mode == "AXIS_ANGLE":  # which does not interpolate well
        bone.rotation_mode = "QUATERNION"
    turns = []
    for rotation in rotations:
        if bone.rotation_mode == "QUATERNION":
            rotation.make_compatible(*turns[-1:] or [rotation])
            turns.append(rotation)
        else:
            turns.append(rotation.to_euler(bone.rotation_mode, *turns[-1:]))
    tracks = {"rotation_quaternion" if bone.rotation_mode == "QUATERNION" else "rotation_euler": turns}
    if np.abs(locations).max() > STILL * bone.bone.length:
        tracks["location"] = locations
    for path, values in ((path, np.array(each)) for path, each in tracks.items()):
        setattr(bone, path, values[0])
        bone.keyframe_insert(path, frame=times[0], group=bone.name)
        for curve in (each for each in curves_of(action) if each.data_path == bone.path_from_id(path)):
            points = curve.keyframe_points
            points.add(len(times) - 1)
            points.foreach_set("co", np.column_stack([times, values[:, curve.array_index]]).ravel())
            points.foreach_set("interpolation", np.full(len(times), LINEAR, np.int32))
            curve.update()
