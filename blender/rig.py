# SPDX-License-Identifier: GPL-3.0-or-later
"""Read an armature: the joints that its meshes need, the meshes at rest, the motion, and what else moves its bones."""

import itertools
import json
import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix

from distretarget.errors import SettingsError

if TYPE_CHECKING:  # they are imported when they are needed, so that Blender starts quickly
    from distretarget import Motion, Skeleton
    from distretarget.skin.mesh import SkinnedMesh

SAME = 1e-4  # tolerance for rest matrices of bones that coincide, for a body of size 1
MOST_TRIANGLES = 30_000  # of a finer mesh every second, third ... triangle is taken
MOVES = ("location", "rotation", "scale", "constraints")  # drivers on these properties move a bone or an object
RIGID = 1e-5  # translations that change less than this count as constant [of the body]
Joints = dict[str, str | None]


def skinned_meshes(armature: bpy.types.Object) -> list[bpy.types.Object]:
    """The meshes that an armature deforms."""
    meshes = [each for each in bpy.context.scene.objects if each.type == "MESH"]
    return [each for each in meshes if any(one.type == "ARMATURE" and one.object == armature for one in each.modifiers)]


def skeleton(armature: bpy.types.Object) -> Joints:
    """The joints that meshes need, each with its parent, parents first.

    These are the bones that deform or carry a mesh, the bones at which their chains branch, and their common ancestors.
    A bone of a control rig counts as the deforming bone that coincides with it: in a Rigify rig, the parent of
    DEF-thigh.L is ORG-spine, so here DEF-spine. Without a common root, the armature is the root, a joint of its name.
    """
    needed = _needed_bones(armature)
    parents = _parents(armature, needed)
    lines = {name: [*_line(name, parents)] for name in parents}
    links = {link for name in needed for link in itertools.pairwise([*lines[name], None])}
    branching = {parent for parent, times in Counter(parent for _, parent in links).items() if times > 1}
    names = {*needed, *branching}.union(set.intersection(*(set(lines[name]) for name in needed)))
    root = armature.name if None in branching else None
    joints: Joints = {} if root is None else {root: None}
    for name in sorted((each for each in lines if each in names), key=lambda each: len(lines[each])):
        joints[name] = next((each for each in lines[name][1:] if each in names), root)
    return joints


def _needed_bones(armature: bpy.types.Object) -> dict[str, None]:
    """The bones that carry or deform meshes, without targets of constraints that have no weights; all if none does."""
    bones, meshes = armature.data.bones, skinned_meshes(armature)
    weighted = {group.name for mesh in meshes for group in mesh.vertex_groups}
    carrying = {each.parent_bone for each in armature.children if each.parent_type == "BONE" and each.type == "MESH"}
    constraints = [each for bone in armature.pose.bones for each in bone.constraints]
    targets = {getattr(each, end, "") for each in constraints for end in ("subtarget", "pole_subtarget")}
    needed = {bone.name for bone in bones if bone.use_deform} - (targets - weighted if meshes else set()) | carrying
    return dict.fromkeys(bone.name for bone in bones if bone.name in needed or not needed)


def _parents(armature: bpy.types.Object, needed: Collection[str]) -> Joints:
    """The parent of each bone; a parent that is not needed is replaced by a needed bone that coincides with it."""
    bones = armature.data.bones
    parents: Joints = {bone.name: bone.parent.name if bone.parent else None for bone in bones}
    rests = {bone.name: np.array(bone.matrix_local) for bone in bones}
    matrices = np.array([rests[name] for name in needed])
    size = np.ones((4, 4))
    size[:3, 3] = np.ptp(matrices[:, :3, 3], axis=0).max() or 1.0
    for name, parent in parents.items():
        if parent is not None and parent not in needed:
            same = (abs(matrices - rests[parent]) < SAME * size).all(axis=(1, 2))
            coinciding = (each for each in itertools.compress(needed, same) if name not in _line(each, parents))
            parents[name] = next(coinciding, parent)
    return parents


def _line(name: str | None, parents: Joints) -> Iterator[str]:
    """Yield a bone and its ancestors."""
    while name is not None:
        yield name
        name = parents[name]


def moved_bones(armature: bpy.types.Object, joints: Collection[str]) -> list[bpy.types.PoseBone]:
    """The bones of joints and their ancestors, parents first."""
    bones = [armature.pose.bones[name] for name in joints if name in armature.pose.bones]
    names = {each.name for bone in bones for each in (bone, *bone.parent_recursive)}
    return [bone for bone in armature.pose.bones if bone.name in names]


def other_animation(armature: bpy.types.Object, joints: Collection[str]) -> dict[str, tuple[str, Any]]:
    """What moves the bones of joints besides an action, by keys that last: constraints and drivers with the name of
    their bone, and NLA tracks, which move all bones, with their own name.
    """
    moved, data, found = moved_bones(armature, joints), armature.animation_data, {}
    names = {bone.name for bone in moved}
    for bone in armature.pose.bones:
        chain = [each.name for each in (bone, *bone.parent_recursive)]
        for each in bone.constraints:
            if names.intersection(chain[: getattr(each, "chain_count", 1) or len(chain)]):
                found[each.path_from_id()] = bone.name, each
    for bone in moved if data else ():
        paths = tuple(f"{bone.path_from_id()}.{each}" for each in MOVES)
        curves = [curve for curve in data.drivers if curve.data_path.startswith(paths)]
        found |= {f"{curve.data_path} {curve.array_index}": (bone.name, curve) for curve in curves}
    return found | {track.name: (track.name, track) for track in (data.nla_tracks if data else ())}


def mute_others(armature: bpy.types.Object, joints: Collection[str]) -> list[str]:
    """Mute `other_animation`, after what an earlier call muted is turned on again; return its names."""
    unmute(armature, json.loads(armature.distretarget_muted))
    others = {key: pair for key, pair in other_animation(armature, joints).items() if not pair[1].mute}
    for _, each in others.values():
        each.mute = True
    armature.distretarget_muted = json.dumps([*others])
    return [*dict.fromkeys(name for name, _ in others.values())]


def unmute(armature: bpy.types.Object, keys: Collection[str]) -> None:
    """Turn what has these keys in `other_animation` on again."""
    every = other_animation(armature, armature.pose.bones.keys())
    for key in every.keys() & {*keys}:
        every[key][1].mute = False


def carriers(armature: bpy.types.Object) -> list[str]:
    """The objects that may move an armature: its parents, and with constraints or drivers of the object itself."""
    found, each = [], armature
    while each is not None:
        data = each.animation_data
        drivers = [curve for curve in data.drivers if curve.data_path.startswith((*MOVES, "delta_"))] if data else []
        if each.constraints or (drivers if each == armature else data):
            found.append(each.name)
        each = each.parent
    return found


def shape_of(armature: bpy.types.Object) -> "tuple[Skeleton, SkinnedMesh | None]":
    """Return the skeleton of the joints that meshes need, and the meshes as one, None without weights, in the rest pose
    and the world; a SettingsError if there are no bones.
    """
    from distretarget.skeleton import DEFAULT_ROOT, DEFAULT_ROTATIONS, Skeleton

    if not armature.data.bones:
        raise SettingsError(f"{armature.name!r} has no bones")
    joints, world, bones = skeleton(armature), armature.matrix_world, armature.data.bones
    number = {name: index for index, name in enumerate(joints)}
    heads = np.array([world @ bones[name].head_local if name in bones else world.translation for name in joints])
    parents = np.array([number.get(parent, -1) for parent in joints.values()])
    tree = Skeleton(
        names=tuple(joints),
        parents=parents,
        offsets=heads - np.where((parents >= 0)[:, None], heads[parents], 0.0),
        channels=(DEFAULT_ROOT, *[DEFAULT_ROTATIONS] * (len(joints) - 1)),
        end_sites=np.zeros(len(joints), bool),
        up="Z",
        floor_at_zero=True,
    )
    before, armature.data.pose_position = armature.data.pose_position, "REST"
    mesh = _mesh(skinned_meshes(armature), number, heads[0])
    armature.data.pose_position = before
    return tree, mesh


def _mesh(meshes: Iterable[bpy.types.Object], number: Mapping[str, int], origin: np.ndarray) -> "SkinnedMesh | None":
    """Meshes as one, as they are evaluated now, with joints by `number`, and relative to the root."""
    from distretarget.io.fbx import influences_of
    from distretarget.skin.mesh import SkinnedMesh

    vertices, triangles, influences, first = [], [], [], 0
    for mesh in meshes:
        data = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get()).data  # with its modifiers
        data.calc_loop_triangles()
        step = len(data.loop_triangles) // MOST_TRIANGLES + 1
        used, corners = np.unique(_read(data.loop_triangles, "vertices")[::step].astype(int), return_inverse=True)
        matrix, positions = np.array(mesh.matrix_world), _read(data.vertices, "co")[used]
        vertices.append(positions @ matrix[:3, :3].T + matrix[:3, 3] - origin)
        triangles.append(first + corners.reshape(-1, 3))
        groups = {group.index: number[group.name] for group in mesh.vertex_groups if group.name in number}
        influences += [
            (first + row, groups[each.group], each.weight)
            for row, vertex in enumerate(used.tolist())
            for each in data.vertices[vertex].groups
            if each.group in groups and each.weight > 0.0
        ]
        first += len(used)
    if not influences:
        return None
    influenced, influencing, weights = np.array(influences).T
    joints, weights = influences_of(first, influenced.astype(int), influencing.astype(int), weights)
    bound = weights.any(axis=1)
    weights[~bound, 0] = 1.0  # vertices without a bone move with the root
    weights /= weights.sum(axis=1, keepdims=True)
    corners = np.concatenate(triangles)
    return SkinnedMesh(np.concatenate(vertices), joints, weights, corners[bound[corners].all(axis=1)])


def _read(items: bpy.types.bpy_prop_collection, name: str) -> np.ndarray:
    """A property of all items that has three numbers, (items, 3)."""
    values = np.empty(3 * len(items))
    items.foreach_get(name, values)
    return values.reshape(-1, 3)


def title_of(armature: bpy.types.Object) -> str:
    """The name of an armature's action, or its own if it has none, as with NLA tracks."""
    return (_action_of(armature) or armature).name


def performance_of(armature: bpy.types.Object, scene: bpy.types.Scene) -> "tuple[Motion, SkinnedMesh | None]":
    """Return the motion of an armature in world space, of its action, or without one of the scene; and its mesh.

    Constraints, drivers and NLA tracks are evaluated; the scene's current frame is restored.
    """
    from scipy.spatial.transform import Rotation

    from distretarget.motion import Motion

    tree, mesh = shape_of(armature)
    action, now, names = _action_of(armature), scene.frame_current_final, tree.names
    first, last = action.frame_range if action else (scene.frame_start, scene.frame_end)
    bones, world = armature.data.bones, armature.matrix_world
    inverse_rests = [(world @ bones[name].matrix_local if name in bones else world).inverted() for name in names]
    frames = []
    for frame in range(round(first), round(last) + 1):
        scene.frame_set(frame)
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        world, bones = shown.matrix_world, shown.pose.bones
        posed = [world @ bones[name].matrix if name in bones else world for name in names]
        turns = [(matrix @ inverse).to_quaternion() for matrix, inverse in zip(posed, inverse_rests, strict=True)]
        places = [matrix.translation for matrix in posed]
        frames.append([Matrix.LocRotScale(*each, None) for each in zip(places, turns, strict=True)])
    scene.frame_set(math.floor(now), subframe=now % 1.0)
    matrices = np.array(frames)
    local = np.linalg.inv(matrices[:, np.maximum(tree.parents, 0)]) @ matrices
    local[:, 0] = matrices[:, 0]
    translations, rotations = local[..., :3, 3], Rotation.from_matrix(local[..., :3, :3]).as_quat()
    rigid = np.abs(translations - tree.offsets).max(axis=(0, 2)) < RIGID * np.ptp(tree.rest_positions)
    translations = np.where(rigid[:, None], tree.offsets, translations)
    return Motion.of_translations(tree, translations, rotations, repr(frame_time_of(scene))), mesh


def frame_time_of(scene: bpy.types.Scene) -> float:
    """The time between the frames of a scene [s]."""
    return scene.render.fps_base / scene.render.fps


def _action_of(armature: bpy.types.Object) -> bpy.types.Action | None:
    return armature.animation_data.action if armature.animation_data else None
