# SPDX-License-Identifier: GPL-3.0-or-later
"""An armature: the joints that its meshes need, its meshes at rest, its motion, and what else moves its bones."""

import itertools
from collections.abc import Collection, Iterator
from contextlib import contextmanager

import bpy
import numpy as np

SAME = 1e-4  # largest difference between the rest matrices of bones that coincide, with a body of size 1
MOVES = ("location", "rotation", "scale", "constraints")  # properties of bones whose drivers move them
Joints = dict[str, str | None]
Arrays = dict[str, np.ndarray]


def skinned_meshes(armature: bpy.types.Object) -> list[bpy.types.Object]:
    """The meshes that an armature deforms."""
    meshes = [each for each in bpy.context.scene.objects if each.type == "MESH"]
    return [each for each in meshes if any(one.type == "ARMATURE" and one.object == armature for one in each.modifiers)]


def skeleton(armature: bpy.types.Object) -> Joints:
    """The joints that meshes need, each with its parent, parents first.

    These are the bones that deform or carry a mesh, the bones at which their lines meet, and the bones above them all.
    A bone of a control rig counts as the deforming bone in the same place: in a Rigify rig, DEF-thigh.L hangs from
    ORG-spine, and so from DEF-spine. Bones without a common root hang from the armature, a joint with its name.
    """
    needed = _needed_bones(armature)
    parents = _parents(armature, needed)
    lines = [[*_line(name, parents), None] for name in needed]
    children: dict[str | None, set[str | None]] = {}
    for child, parent in itertools.chain.from_iterable(map(itertools.pairwise, lines)):
        children.setdefault(parent, set()).add(child)
    meeting = {parent for parent, below in children.items() if len(below) > 1}
    above = set.intersection(*map(set, lines)) - {None}
    kept = [bone.name for bone in armature.data.bones if bone.name in {*needed, *meeting, *above}]
    top = armature.name if None in meeting else None
    joints: Joints = {} if top is None else {top: None}
    for name in sorted(kept, key=lambda name: len(list(_line(name, parents)))):
        line = itertools.islice(_line(name, parents), 1, None)
        joints[name] = next((each for each in line if each in kept), top)
    return joints


def _needed_bones(armature: bpy.types.Object) -> dict[str, None]:
    """The bones that carry or deform meshes; not those that have no weights and only steer other bones."""
    bones, meshes = armature.data.bones, skinned_meshes(armature)
    weighted = {group.name for mesh in meshes for group in mesh.vertex_groups}
    carrying = {each.parent_bone for each in armature.children if each.parent_type == "BONE" and each.type == "MESH"}
    steering = {
        name
        for bone in armature.pose.bones
        for constraint in bone.constraints
        for name in (getattr(constraint, "subtarget", ""), getattr(constraint, "pole_subtarget", ""))
    }
    needed = {bone.name for bone in bones if bone.use_deform} - (steering - weighted if meshes else set()) | carrying
    return dict.fromkeys(bone.name for bone in bones if bone.name in needed or not needed)


def _parents(armature: bpy.types.Object, needed: Collection[str]) -> Joints:
    """The parent of each bone, replaced by a needed bone in the same place where it is not needed itself."""
    bones = armature.data.bones
    parents: Joints = {bone.name: bone.parent.name if bone.parent else None for bone in bones}
    rests = {bone.name: np.array(bone.matrix_local) for bone in bones}
    places = np.array([rests[name] for name in needed])
    size = np.ones((4, 4))
    size[:3, 3] = np.ptp(places[:, :3, 3], axis=0).max() or 1.0
    for name, parent in parents.items():
        if parent is not None and parent not in needed:
            same = (abs(places - rests[parent]) < SAME * size).all(axis=(1, 2))
            alike = (each for each in itertools.compress(needed, same) if name not in _line(each, parents))
            parents[name] = next(alike, parent)
    return parents


def _line(name: str | None, parents: Joints) -> Iterator[str]:
    """A bone and the bones above it."""
    while name is not None:
        yield name
        name = parents[name]


def moved_bones(armature: bpy.types.Object, joints: Collection[str]) -> list[bpy.types.PoseBone]:
    """The bones of joints and the bones above them, parents first."""
    bones = [armature.pose.bones[name] for name in joints if name in armature.pose.bones]
    names = {each.name for bone in bones for each in (bone, *bone.parent_recursive)}
    return [bone for bone in armature.pose.bones if bone.name in names]


def constraints_on(
    armature: bpy.types.Object, moved: Collection[bpy.types.PoseBone]
) -> list[tuple[bpy.types.PoseBone, bpy.types.Constraint]]:
    """The constraints that move some bones, each with the bone that has it."""
    names = {bone.name for bone in moved}
    found = []
    for bone in armature.pose.bones:
        for constraint in bone.constraints:
            chain = [bone, *bone.parent_recursive]
            reach = getattr(constraint, "chain_count", 1) or len(chain)
            if not constraint.mute and names.intersection(each.name for each in chain[:reach]):
                found.append((bone, constraint))
    return found


def drivers_on(
    armature: bpy.types.Object, moved: Collection[bpy.types.PoseBone]
) -> list[tuple[bpy.types.PoseBone, bpy.types.FCurve]]:
    """The drivers of the transforms and constraints of some bones, each with its bone."""
    paths = {f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].': bone for bone in moved}
    curves = armature.animation_data.drivers if armature.animation_data else []
    return [
        (bone, curve)
        for curve in curves
        for path, bone in paths.items()
        if not curve.mute and curve.data_path.startswith(path) and curve.data_path[len(path) :].startswith(MOVES)
    ]


def arrays_of(armature: bpy.types.Object) -> Arrays:
    """Return the joints that meshes need, and the vertices that move with them, as arrays.

    `names` and `parents` (joints,), `heads` (joints, 3), `vertices` (vertices, 3), `triangles` (triangles, 3), and of
    each influence `moved` (its vertex), `movers` (its joint) and `weights`, (influences,).
    """
    arrays = rest_arrays(armature)
    number = {name: index for index, name in enumerate(arrays["names"].tolist())}
    with _at_rest(armature):
        parts = [_part(mesh, number) for mesh in skinned_meshes(armature)]
    starts = np.cumsum([0, *(len(part["vertices"]) for part in parts)])
    empties = {"vertices": (0, 3), "triangles": (0, 3), "moved": (0,), "movers": (0,), "weights": (0,)}
    for key, empty in empties.items():
        shift = starts if key in ("triangles", "moved") else np.zeros_like(starts)
        values = [part[key] + start for part, start in zip(parts, shift, strict=False)]
        arrays[key] = np.concatenate(values) if values else np.zeros(empty)
    return arrays


def rest_arrays(armature: bpy.types.Object) -> Arrays:
    """Return the joints that its meshes need: `names`, `parents` and `heads`, as `arrays_of`."""
    joints = skeleton(armature)
    names, world, bones = [*joints], armature.matrix_world, armature.data.bones
    number = {name: index for index, name in enumerate(names)}
    heads = [world @ bones[name].head_local if name in bones else world.translation for name in names]
    parents = [-1 if parent is None else number[parent] for parent in joints.values()]
    return {"names": np.array(names), "parents": np.array(parents), "heads": np.array([[*head] for head in heads])}


@contextmanager
def _at_rest(armature: bpy.types.Object) -> Iterator[None]:
    """The armature in its rest pose for a while."""
    before = armature.data.pose_position
    armature.data.pose_position = "REST"
    try:
        yield
    finally:
        armature.data.pose_position = before


def _part(mesh: bpy.types.Object, number: dict[str, int]) -> Arrays:
    """A mesh with its modifiers, in the world."""
    shown = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    data = shown.to_mesh()
    try:
        data.calc_loop_triangles()
        places = np.empty(3 * len(data.vertices))
        data.vertices.foreach_get("co", places)
        triangles = np.empty(3 * len(data.loop_triangles), np.int32)
        data.loop_triangles.foreach_get("vertices", triangles)
        groups = {group.index: number[group.name] for group in mesh.vertex_groups if group.name in number}
        influences = [
            (vertex.index, groups[each.group], each.weight)
            for vertex in data.vertices
            for each in vertex.groups
            if each.group in groups and each.weight > 0.0
        ]
    finally:
        shown.to_mesh_clear()
    matrix = np.array(mesh.matrix_world)
    moved, movers, weights = np.array(influences).reshape(-1, 3).T
    return {
        "vertices": places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3],
        "triangles": triangles.reshape(-1, 3).astype(np.int64),
        "moved": moved.astype(np.int64),
        "movers": movers.astype(np.int64),
        "weights": weights,
    }


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
