"""The inside of a body's capsules, or of its mesh.

The inside of a mesh is that of its bind pose: the left arm, the right arm and the rest are solids of their own, each
with distances from the skin on a lattice around it. Points of a posed body are brought back to the bind pose first.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from distretarget.measure.solid_depths import Solids
from distretarget.measure.surface_distances import distances_on_lattice
from distretarget.numerics.vectors import Array, Numbers, lengths
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SkinnedMesh

SPACING = 0.01  # of the lattices [extents of the mesh]
ROOM = 4.0  # of a lattice around its solid; beyond, the distance to the lattice is added [spacings]
DEEPEST = 30.0  # largest distance on a lattice [spacings]
INFLUENCES = 4  # most joints that move a point
STEEP = 1e9  # slope of a capsule with one end ball inside the other
# (segments,), the solid of each: 0 for the body without arms, 1 for the left and 2 for the right arm
SOLID_OF = np.array([(name.endswith(("arm", "hand"))) * (1 + name.startswith("right")) for name in SEGMENTS])


def solids_of_capsules(capsules: Capsules, skeleton: Skeleton) -> Solids:
    """Return the inside of capsules as solids."""
    capsules = capsules[np.lexsort((capsules.segments, capsules.joints))]
    carried = np.stack([capsules.joints, capsules.segments], axis=1)
    groups, first = np.unique(carried, axis=0, return_index=True)
    ends, radii, axes = capsules.ends, capsules.radii, capsules.ends[:, 1] - capsules.ends[:, 0]
    along = lengths(axes)
    known = np.where(along > 0.0, along, 1.0)
    taper = np.where(along > 0.0, radii[:, 1] - radii[:, 0], 0.0) / known
    cosine = np.sqrt(np.maximum(1.0 - taper**2, 0.0))
    slope = np.divide(taper, cosine, out=STEEP * np.sign(taper), where=cosine > 1.0 / STEEP)
    within = np.split(np.arange(len(capsules)), first[1:]) if len(first) else []
    return Solids(
        groups=np.column_stack(
            [np.vstack([groups, [[-1, -1]]]), np.append(first, len(capsules)), [-1] * (len(groups) + 1)]
        ),
        balls=np.reshape([_ball_around(ends[on].reshape(-1, 3), radii[on].ravel()) for on in within], (-1, 4)),
        boxes=np.reshape([_box_around(ends[on].reshape(-1, 3), radii[on].ravel()) for on in within], (-1, 6)),
        capsules=np.column_stack([ends[:, 0], axes / known[:, None], along, radii[:, 0], taper, slope]),
        lattices=np.zeros((0, 4)),
        sizes=np.zeros((0, 4), np.intp),
        distances=np.zeros(0),
        nearest=np.zeros(0, np.intp),
        triangles=np.zeros((0, 3), np.intp),
        beside=np.zeros((0, 3), np.intp),
        vertices=np.zeros((0, 3)),
        joints=np.zeros((0, INFLUENCES), np.intp),
        weights=np.zeros((0, INFLUENCES)),
        segments=np.zeros(0, np.intp),
        rest=skeleton.rest_positions.copy(),
    )


def solids_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton, segments: Numbers) -> Solids:
    """Return the inside of a mesh; `segments`, (joints,), has the segment that each joint carries, or -1."""
    joints, weights = strongest(mesh)
    of_vertex, triangles = segments[joints[:, 0]], welded(mesh)
    of_triangle = np.sort(of_vertex[triangles], axis=1)[:, 1]
    triangles = triangles[of_triangle >= 0]
    solids = SOLID_OF[of_triangle[of_triangle >= 0]]
    spacing = SPACING * float(np.ptp(mesh.vertices[of_vertex >= 0], axis=0).max(initial=0.0))
    groups, balls, boxes, lattices, sizes, distances, nearest, nodes = [], [], [], [], [], [], [], 0
    for solid in np.unique(solids).tolist():
        chosen = np.flatnonzero(solids == solid)
        on = np.unique(triangles[chosen])
        origin = mesh.vertices[on].min(axis=0) - ROOM * spacing
        shape = np.ceil(np.ptp(mesh.vertices[on], axis=0) / spacing + 2.0 * ROOM).astype(int) + 1
        fans, rims = _fans(triangles[chosen], len(mesh.vertices))
        places = np.concatenate([mesh.vertices, *(mesh.vertices[rim].mean(axis=0)[None] for rim in rims)])
        corners = ((places - origin) / spacing)[np.concatenate([triangles[chosen], fans])]
        found, triangle = distances_on_lattice(corners[: len(chosen)], corners, tuple(shape.tolist()), DEEPEST)
        distances.append(spacing * found.ravel())
        nearest.append(np.append(chosen, -1)[triangle].ravel())
        lattices.append((*origin, spacing))
        sizes.append((*shape, nodes))
        nodes += found.size
        for joint in np.unique(joints[on, 0]).tolist():
            carried = on[joints[on, 0] == joint]
            if segments[joint] >= 0:
                groups.append((joint, segments[joint], 0, len(lattices) - 1))
                offsets = mesh.vertices[carried] - skeleton.rest_positions[joint]
                balls.append(_ball_around(offsets, np.zeros(len(carried))))
                boxes.append(_box_around(offsets, np.zeros(len(carried))))
    return Solids(
        groups=np.array([*groups, (-1, -1, 0, -1)], np.intp),
        balls=np.reshape(balls, (-1, 4)),
        boxes=np.reshape(boxes, (-1, 6)),
        capsules=np.zeros((0, 10)),
        lattices=np.reshape(lattices, (-1, 4)),
        sizes=np.reshape(sizes, (-1, 4)).astype(np.intp),
        distances=np.concatenate([np.zeros(0), *distances]),
        nearest=np.concatenate([np.zeros(0, np.intp), *nearest]),
        triangles=triangles,
        beside=_beside(triangles, solids, len(mesh.vertices)),
        vertices=np.ascontiguousarray(mesh.vertices),
        joints=joints,
        weights=weights,
        segments=of_vertex,
        rest=skeleton.rest_positions.copy(),
    )


def strongest(mesh: SkinnedMesh) -> tuple[Numbers, Array]:
    """Return the joints that move each vertex most, the strongest first, and their weights, (vertices, influences)."""
    order = np.argsort(-mesh.weights, axis=1, kind="stable")[:, :INFLUENCES]
    joints, weights = (np.take_along_axis(each, order, axis=1) for each in (mesh.joints, mesh.weights))
    room = ((0, 0), (0, INFLUENCES - order.shape[1]))
    return np.pad(joints, room), np.pad(weights / weights.sum(axis=1, keepdims=True), room)


def welded(mesh: SkinnedMesh) -> Numbers:
    """Return the triangles of a mesh with vertices at one place merged, without those that have no area then."""
    triangles = mesh.firsts[mesh.triangles]
    return np.asarray(triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)])


def _beside(triangles: Numbers, solids: Numbers, count: int) -> Numbers:
    """(triangles, 3), the triangle of the same solid beyond each edge, -1 for none."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    forth, back = ((solids[:, None] * count + ends[..., a]) * count + ends[..., 1 - a] for a in (0, 1))
    order = np.argsort(forth, axis=None)
    at = np.searchsorted(forth.ravel(), back, sorter=order)
    found = order[np.minimum(at, forth.size - 1)]
    return np.where(forth.ravel()[found] == back, found // 3, -1)


def _fans(triangles: Numbers, count: int) -> tuple[Numbers, list[Numbers]]:
    """Triangles that close a surface's holes by fans from new vertices, numbered from `count`; the holes' vertices."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    forth, back = edges @ [count, 1], edges @ [1, count]
    rim = edges[~np.isin(forth, back)]
    parts = connected_components(coo_array((np.ones(len(rim)), rim.T), shape=(count, count)), directed=False)[1]
    holes, hole = np.unique(parts[rim[:, 0]], return_inverse=True)
    fans = np.column_stack([rim[:, ::-1], count + hole])
    return fans, [np.unique(rim[hole == number]) for number in range(len(holes))]


def _ball_around(places: Array, radii: Array) -> Array:
    """A bounding ball of balls: centre and radius, (4,)."""
    centre = places.mean(axis=0)
    return np.append(centre, (lengths(places - centre) + radii).max())


def _box_around(places: Array, radii: Array) -> Array:
    """The bounding box of balls: its lowest and its highest corner, (6,)."""
    return np.append((places - radii[:, None]).min(axis=0), (places + radii[:, None]).max(axis=0))
