"""The mesh of a character: the skinned meshes of its file, posed with the skeleton in its rest pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from distretarget.character.character import Character
from distretarget.character.nodes import Nodes
from distretarget.errors import FileError
from distretarget.numerics.vectors import Array, normalised
from distretarget.skeleton import LARGEST
from distretarget.skin.mesh import Looks, Material, SkinnedMesh

Number = TypeVar("Number", bound=np.generic)

MOST_TRIANGLES = 30_000  # of a finer mesh every second, third ... triangle is taken
MOST_SHOWN = 200_000  # a mesh of up to this many triangles is shown with all of them
LEAST_WEIGHT = 1e-6  # vertices with a smaller sum of weights are not bound


@dataclass(frozen=True, eq=False)
class MeshPart:
    """A part of a mesh as the file states it."""

    vertices: Array  # (vertices, 3), in the space of the mesh
    bones: NDArray[np.intp]  # (bones,), the nodes that move it
    to_bones: Array  # (bones, 4, 4), from the space of the mesh to that of each node when it was bound
    joints: NDArray[np.intp]  # (vertices, influences), which of the bones move each vertex
    weights: Array  # (vertices, influences), the weights of these bones
    triangles: NDArray[np.intp]  # (triangles, 3), the vertices of each
    materials: NDArray[np.intp]  # (triangles,), the material of each, -1 for none
    uv: Array  # (vertices, 2), texture coordinates
    normals: Array | None = None  # (vertices, 3), in the space of the mesh


def skinned_mesh(
    character: Character, nodes: Nodes, parts: Sequence[MeshPart], materials: tuple[Material, ...] = ()
) -> SkinnedMesh | None:
    """Return the mesh of a character, posed as its skeleton at rest, or None; nodes that are no joints move with the
    nearest above. A FileError if a vertex is too far away.
    """
    count = sum(len(part.triangles) for part in parts)
    step = max(-(-count // MOST_TRIANGLES), 1)
    mesh = assembled(character, nodes, parts, materials, step)
    if mesh is None or step == 1 or count > MOST_SHOWN:
        return mesh
    return replace(mesh, whole=assembled(character, nodes, parts, materials))


def assembled(
    character: Character, nodes: Nodes, parts: Sequence[MeshPart], materials: tuple[Material, ...], step: int = 1
) -> SkinnedMesh | None:
    """Return the mesh as `skinned_mesh`, with one of every `step` triangles and without a limit to their number."""
    binds = character.bind_transforms
    joints = {node: joint for joint, node in enumerate(character.joint_nodes.tolist())}
    found = [own for part in parts if (own := _bound(part, step, nodes, binds, joints)) is not None]
    if not found:
        return None
    if not all((np.abs(part.vertices) <= LARGEST).all() for part in found):
        raise FileError("", f"has vertices beyond {LARGEST:g}; expected a mesh of the size of its skeleton")
    influences = max(part.joints.shape[1] for part in found)
    starts = np.cumsum([0, *(len(part.vertices) for part in found)])
    looks = [part.looks for part in found if part.looks]
    normals = [each.normals for each in looks if each.normals is not None]
    return SkinnedMesh(
        vertices=np.concatenate([part.vertices for part in found]) - character.skeleton.offsets[0],
        joints=np.concatenate([_widened(part.joints, influences) for part in found]),
        weights=np.concatenate([_widened(part.weights, influences) for part in found]),
        triangles=np.concatenate([part.triangles + start for part, start in zip(found, starts, strict=False)]),
        looks=Looks(
            materials,
            np.concatenate([each.of_triangle for each in looks]),
            np.concatenate([each.uv for each in looks]),
            np.concatenate(normals) if len(normals) == len(found) else None,  # none if one part has none
        ),
    )


def _bound(
    part: MeshPart, step: int, nodes: Nodes, binds: Mapping[int, Array], joints: Mapping[int, int]
) -> SkinnedMesh | None:
    """One of every `step` triangles of a part in the world, of those that joints move; None if there are none."""
    placed = [_placed(node, nodes, binds, joints) for node in part.bones.tolist()]
    regular = np.abs(np.linalg.det(part.to_bones[:, :3, :3])) > 0.0
    joint_of = np.where(regular, [joint for joint, _ in placed], -1)
    weights = np.where(joint_of[part.joints] >= 0, np.maximum(part.weights, 0.0), 0.0)
    sums, chosen = weights.sum(axis=1), part.triangles[::step]
    moved = np.isin(np.arange(len(sums)), chosen) & (sums > LEAST_WEIGHT)
    if not moved.any():
        return None
    numbers = np.cumsum(moved) - 1
    kept = moved[chosen].all(axis=1)
    triangles, own = numbers[chosen[kept]], None if part.normals is None else part.normals[moved]
    local, weights = part.joints[moved], weights[moved] / sums[moved, None]
    to_world = np.stack([transform for _, transform in placed]) @ part.to_bones
    vertices, points = np.zeros((len(local), 3)), part.vertices[moved]
    normals = None if own is None else np.zeros(own.shape)
    for place in range(local.shape[1]):
        used = np.flatnonzero(weights[:, place])
        by_bone, share = to_world[local[used, place]], weights[used, place, None]
        vertices[used] += share * (np.einsum("vij,vj->vi", by_bone[:, :, :3], points[used]) + by_bone[:, :, 3])
        if normals is not None and own is not None:
            normals[used] += share * np.einsum("vij,vj->vi", by_bone[:, :, :3], own[used])
    is_mirrored = (np.linalg.det(to_world[:, :, :3]) < 0.0).any()  # whether triangles are, too, depends on the exporter
    if is_mirrored and np.linalg.det(vertices[triangles]).sum() < 0.0:
        triangles = triangles[:, ::-1]
    looks = Looks((), part.materials[::step][kept], part.uv[moved], None if normals is None else normalised(normals))
    return SkinnedMesh(vertices, np.maximum(joint_of[local], 0), weights, triangles, looks)


def _placed(node: int, nodes: Nodes, binds: Mapping[int, Array], joints: Mapping[int, int]) -> tuple[int, Array]:
    """The joint that a node moves with, -1 for none, and the node's world transform in the bind pose, (3, 4)."""
    below, at = np.eye(4), node
    while at >= 0 and at not in binds:
        below = nodes.transforms[at] @ below
        at = nodes.parents.item(at)
    if at < 0:
        return -1, below[:3]
    world, joint = binds[at] @ below, at
    while joint >= 0 and joint not in joints:
        joint = nodes.parents.item(joint)
    return joints.get(joint, -1), world[:3]


def _widened(values: NDArray[Number], influences: int) -> NDArray[Number]:
    """Joints or weights padded with zeros to `influences` columns."""
    return np.pad(values, ((0, 0), (0, influences - values.shape[1])))
