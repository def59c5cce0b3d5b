# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of an armature of the scene, which is a clip like that of a file."""

import bpy
import numpy as np

from .character import Arrays, rest_arrays


def title_of(armature: bpy.types.Object) -> str:
    """The name of its action, or its own where it has none, as with NLA tracks."""
    return (_action_of(armature) or armature).name


def motion_of(armature: bpy.types.Object, scene: bpy.types.Scene) -> Arrays:
    """Return the joints of an armature, as `rest_arrays`, and where they are in each frame of its action, or of the
    scene where it has none: `places`, (frames, joints, 3), `turns` from the rest pose in the world, (frames, joints,
    4), x y z w, and `frame_time`. Constraints, drivers and NLA tracks count; the scene is at its frame again.
    """
    action = _action_of(armature)
    first, last = action.frame_range if action else (scene.frame_start, scene.frame_end)
    arrays, bones, now = rest_arrays(armature), armature.pose.bones, scene.frame_current_final
    names = arrays["names"].tolist()
    rests = {bone.name: armature.matrix_world @ bone.bone.matrix_local for bone in bones}
    back = [rests.get(name, armature.matrix_world).to_quaternion().inverted() for name in names]
    places, turns = [], []
    for frame in range(round(first), round(last) + 1):
        scene.frame_set(frame)
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        world, bones = shown.matrix_world, shown.pose.bones
        posed = [world @ bones[name].matrix if name in bones else world for name in names]
        places.append([[*matrix.translation] for matrix in posed])
        turned = [matrix.to_quaternion() @ start for matrix, start in zip(posed, back, strict=True)]
        turns.append([[q.x, q.y, q.z, q.w] for q in turned])
    scene.frame_set(int(now), subframe=now - int(now))
    frame_time = scene.render.fps_base / scene.render.fps
    return arrays | {"places": np.array(places), "turns": np.array(turns), "frame_time": np.array(frame_time)}


def _action_of(armature: bpy.types.Object) -> bpy.types.Action | None:
    return armature.animation_data.action if armature.animation_data else None
