# SPDX-License-Identifier: GPL-3.0-or-later
"""What the retargeting has to know of a character: its joints and its meshes, in the rest pose and the scene's axes."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from .rig import skeleton, skinned_meshes

Arrays = dict[str, np.ndarray]


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
