# SPDX-License-Identifier: GPL-3.0-or-later
"""A result as a new action of an armature."""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from .rig import constraints_on, drivers_on, moved_bones

STILL = 1e-6  # locations up to this get no keys [of the body]


@dataclass(frozen=True)
class Result:
    """A motion of the joints of a character, in the world: `places`, (frames, joints, 3), and `turns` from the rest
    pose, (frames, joints, 4), x y z w.
    """

    names: list[str]
    places: np.ndarray
    turns: np.ndarray
    frame_time: float


def new_action(armature: bpy.types.Object, result: Result, name: str, start: int, rate: float) -> bpy.types.Action:
    """Give the armature an action with the motion from a frame on, at a scene's frame rate; return it.

    What it had as action stays in the file. Constraints and drivers that would move its bones are muted.
    """
    moved = moved_bones(armature, result.names)
    for _, constraint in constraints_on(armature, moved):
        constraint.mute = True
    for _, curve in drivers_on(armature, moved):
        curve.mute = True
    keys = _local(armature, moved, result)
    data = armature.animation_data_create()
    if data.action is not None:
        data.action.use_fake_user = True
    data.action = bpy.data.actions.new(name)
    times = start + np.arange(len(result.places)) * result.frame_time * rate
    still = STILL * float(np.ptp(result.places[0], axis=0).max())
    for bone in moved:
        locations, rotations = keys[bone.name]
        bone.rotation_mode = "QUATERNION"
        tracks = {"rotation_quaternion": rotations}
        if np.abs(locations).max() > still:
            tracks["location"] = locations
        for path, values in tracks.items():
            setattr(bone, path, values[0])
            bone.keyframe_insert(path, frame=times[0], group=bone.name)
            full = bone.path_from_id(path)
            for curve in (each for each in _curves(data.action) if each.data_path == full):
                points = curve.keyframe_points
                points.add(len(times) - 1)
                points.foreach_set("co", np.column_stack([times, values[:, curve.array_index]]).ravel())
                points.foreach_set("interpolation", np.full(len(times), 1, np.int32))  # linear
                curve.update()
    return data.action


def _curves(action: bpy.types.Action) -> list[bpy.types.FCurve]:
    """The curves of an action, also where it has slots."""
    if getattr(action, "layers", None):
        strips = [strip for layer in action.layers for strip in layer.strips]
        return [curve for strip in strips for bag in strip.channelbags for curve in bag.fcurves]
    return [*action.fcurves]


def _local(
    armature: bpy.types.Object, moved: list[bpy.types.PoseBone], result: Result
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Locations, (frames, 3), and rotations, (frames, 4), w x y z, of bones relative to their rest pose and parent."""
    frames, world = len(result.places), np.array(armature.matrix_world)
    number = {name: index for index, name in enumerate(result.names)}
    back, poses, found = np.linalg.inv(world), {}, {}
    for bone in moved:
        above = poses[bone.parent.name] if bone.parent else [Matrix()] * frames
        rest = bone.bone.matrix_local
        over = bone.bone.parent.matrix_local if bone.parent else Matrix()
        own = []
        if bone.name in number:
            joint, axes = number[bone.name], (world @ np.array(rest))[:3, :3]
            poses[bone.name] = [
                Matrix(back @ _matrix(place, turn, axes))
                for place, turn in zip(result.places[:, joint], result.turns[:, joint], strict=True)
            ]
            for pose, parent in zip(poses[bone.name], above, strict=True):
                local = bone.bone.convert_local_to_pose(
                    pose, rest, parent_matrix=parent, parent_matrix_local=over, invert=True
                )
                own.append(local.decompose()[:2])
        else:
            poses[bone.name] = [
                bone.bone.convert_local_to_pose(Matrix(), rest, parent_matrix=parent, parent_matrix_local=over)
                for parent in above
            ]
            own = [(Matrix().translation, Quaternion())] * frames
        rotations = np.array([[*rotation] for _, rotation in own])
        flips = np.cumprod(np.where((rotations[1:] * rotations[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
        rotations[1:] *= flips[:, None]
        found[bone.name] = np.array([[*location] for location, _ in own]), rotations
    return found


def _matrix(place: np.ndarray, turn: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(4, 4), a bone at a place in the world, turned from its rest pose there."""
    x, y, z, w = turn
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(Quaternion((w, x, y, z)).to_matrix()) @ axes
    matrix[:3, 3] = place
    return matrix
