# SPDX-License-Identifier: GPL-3.0-or-later
"""A result as a new action of an armature."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from .rig import moved_bones

Poses = dict[str, list[Matrix]]  # of bones in the space of their armature, by frame

STILL = 1e-5  # locations up to this get no keys [of the bone]
ALIKE = 1e-6  # transforms up to this from none get no keys


@dataclass(frozen=True)
class Result:
    """A motion of the joints of a character: `matrices`, (frames, joints, 4, 4), from the rest pose without its places
    to the world.
    """

    names: list[str]
    matrices: np.ndarray
    frame_time: float

    @classmethod
    def load(cls, folder: Path) -> "Result":
        """Return that which the worker wrote."""
        arrays = np.load(folder / "result.npz")
        return cls(arrays["names"].tolist(), arrays["matrices"], float(arrays["frame_time"]))


def keyed_joints(armature: bpy.types.Object, result: Result, name: str, times: np.ndarray) -> bpy.types.Action:
    """Give the armature an action with the motion at some frames of the scene, and return it."""
    poses, action = poses_of(armature, result), new_action(armature, name)
    for bone in moved_bones(armature, result.names):
        above = poses[bone.parent.name] if bone.parent else [None] * len(times)
        bases = [converted(bone, *each, invert=True) for each in zip(poses[bone.name], above, strict=True)]
        set_keys(action, bone, bases, times)
    return action


def keyed_controls(
    armature: bpy.types.Object,
    controls: Mapping[str, np.ndarray],
    switches: list[tuple[str, str, float]],
    name: str,
    times: np.ndarray,
) -> bpy.types.Action:
    """Give the armature an action with keys on its controls at some frames of the scene, and return it.

    `controls` are their `names`, (controls,), and transforms, `bases`, (controls, frames, 4, 4); `switches` are custom
    properties: a bone, a name and a value each.
    """
    action = new_action(armature, name)
    for control, bases in zip(controls["names"].tolist(), controls["bases"], strict=True):
        if np.abs(bases - np.eye(4)).max() > ALIKE:
            set_keys(action, armature.pose.bones[control], [*map(Matrix, bases.tolist())], times)
    for owner, switch, value in switches:
        bone = armature.pose.bones[owner]
        bone[switch] = type(bone[switch])(value)
        bone.keyframe_insert(f'["{bpy.utils.escape_identifier(switch)}"]', frame=times[0], group=bone.name)
    return action


def without_action(armature: bpy.types.Object) -> bpy.types.AnimData:
    """Take its action from the armature, which stays in the file; show its pose, with all bones in the rest pose.

    Return what holds actions.
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


def new_action(armature: bpy.types.Object, name: str) -> bpy.types.Action:
    """Give the armature an empty action that counts in full; the one that it had stays in the file."""
    data = without_action(armature)
    data.action = bpy.data.actions.new(name)
    data.action_blend_type, data.action_influence = "REPLACE", 1.0
    return data.action


def set_keys(action: bpy.types.Action, bone: bpy.types.PoseBone, bases: list[Matrix], times: np.ndarray) -> None:
    """Set the keys of a bone: its own transforms at some times; locations only where it has any."""
    parts = [basis.decompose()[:2] for basis in bases]
    locations, rotations = (np.array([[*part[index]] for part in parts]) for index in (0, 1))
    flips = np.cumprod(np.where((rotations[1:] * rotations[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    rotations[1:] *= flips[:, None]
    bone.rotation_mode = "QUATERNION"
    tracks = {"rotation_quaternion": rotations}
    if np.abs(locations).max() > STILL * bone.bone.length:
        tracks["location"] = locations
    for path, values in tracks.items():
        setattr(bone, path, values[0])
        bone.keyframe_insert(path, frame=times[0], group=bone.name)
        full = bone.path_from_id(path)
        for curve in (each for each in _curves(action) if each.data_path == full):
            points = curve.keyframe_points
            points.add(len(times) - 1)
            points.foreach_set("co", np.column_stack([times, values[:, curve.array_index]]).ravel())
            points.foreach_set("interpolation", np.full(len(times), 1, np.int32))  # linear
            curve.update()


def _curves(action: bpy.types.Action) -> list[bpy.types.FCurve]:
    """The curves of an action, also where it has slots."""
    if getattr(action, "layers", None):
        strips = [strip for layer in action.layers for strip in layer.strips]
        return [curve for strip in strips for bag in strip.channelbags for curve in bag.fcurves]
    return [*action.fcurves]


def poses_of(armature: bpy.types.Object, result: Result) -> Poses:
    """Poses of the bones of joints, and of those above them, which keep to their parents."""
    world = np.array(armature.matrix_world)
    number = {name: index for index, name in enumerate(result.names)}
    back, poses = np.linalg.inv(world), {}
    for bone in moved_bones(armature, result.names):
        if bone.name in number:
            axes = world @ np.array(bone.bone.matrix_local)
            axes[:3, 3] = 0.0
            poses[bone.name] = [*map(Matrix, (back @ result.matrices[:, number[bone.name]] @ axes).tolist())]
        else:
            above = poses[bone.parent.name] if bone.parent else [None] * len(result.matrices)
            poses[bone.name] = [converted(bone, Matrix(), parent, invert=False) for parent in above]
    return poses


def converted(bone: bpy.types.PoseBone, matrix: Matrix, parent: Matrix | None, invert: bool) -> Matrix:
    """A bone's own transform as its pose in the armature, or the other way round with `invert`."""
    if parent is None:
        return bone.bone.convert_local_to_pose(matrix, bone.bone.matrix_local, invert=invert)
    above = bone.bone.parent.matrix_local
    return bone.bone.convert_local_to_pose(
        matrix, bone.bone.matrix_local, parent_matrix=parent, parent_matrix_local=above, invert=invert
    )
