"""The solid parts of a body: balls that touch a mesh from within, more detail than a few capsules have, in clusters.

A ball of the medial axis touches the skin in two places and lies inside. It is found from one of them by shrinking: the
largest ball that touches there and whose inside holds no other point of the skin (J. Ma, S. W. Bae, S. Choi, "3D medial
axis point approximation using nearest neighbors and the normal field", The Visual Computer 28, 2012). Holes, seams and
layers of clothes do no harm, as each ball sees only what is near it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from distretarget.measure.skin_points import halves
from distretarget.numerics.vectors import cross, lengths, normalised
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

SPACING = 0.02  # between neighbouring places where balls touch the skin [extents of the mesh]
LARGEST_BALL = 0.25  # radius from which balls shrink [extents of the mesh]
SAME = 0.004  # balls that stick out of another by less than this are left out [extents of the mesh]
MOST_PARTS = 12  # into which an edge of a large triangle is divided
SHRINKS = 30  # most steps of shrinking
CLUSTER = 8  # most capsules of a cluster
STEEP = 1e9  # slope of a capsule of which one end is within the other


@dataclass(frozen=True, eq=False)
class _Surface:
    """Points of the skin: (points, 3) places and normals, and (points,) the vertex that moves each."""

    places: Array
    normals: Array
    vertices: Numbers


def inner_balls(mesh: SkinnedMesh, skeleton: Skeleton, segments: Numbers) -> Capsules:
    """Return balls, capsules without length, that fill a mesh in its bind pose.

    `segments`, (joints,), is the part of the body that each joint of the skeleton carries, -1 for none.
    """
    size = float(np.ptp(mesh.vertices, axis=0).max())
    surface = _surface(mesh, SPACING * size)
    _, first = np.unique(np.floor(surface.places / (SPACING * size)).astype(np.int64), axis=0, return_index=True)
    first = np.sort(first[lengths(surface.normals[first]) > 0.5])
    centres, radii, others = _shrunk(surface, first, LARGEST_BALL * size)
    shares = np.zeros((len(first), len(skeleton)))
    for touched in (surface.vertices[first], surface.vertices[others]):
        rows = np.arange(len(first))[:, None]
        np.add.at(shares, (rows, mesh.joints[touched]), mesh.weights[touched])
    joints = shares.argmax(axis=1)
    closed = np.flatnonzero((radii < LARGEST_BALL * size) & (segments[joints] >= 0))
    kept = closed[_not_within_others(centres[closed], radii[closed], joints[closed], SAME * size)]
    joints = joints[kept]
    ends = np.repeat((centres[kept] - skeleton.rest_positions[joints])[:, None], 2, axis=1)
    return Capsules(joints, ends, np.repeat(radii[kept, None], 2, axis=1), segments[joints])


def _surface(mesh: SkinnedMesh, spacing: float) -> _Surface:
    """The vertices, those at one place once, and points on triangles whose sides are longer than the spacing."""
    extent = np.abs(mesh.vertices).max(initial=0.0)
    _, first, same = np.unique(
        np.round(mesh.vertices / (1e-6 * extent)).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    corners = mesh.vertices[mesh.triangles]
    areas = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    joined = same.ravel()[mesh.triangles]
    areas[_inside_out(corners, areas, joined, len(first))] *= -1.0
    normals = np.zeros((len(first), 3))
    for corner in range(3):
        np.add.at(normals, joined[:, corner], areas)
    longest = np.max([lengths(corners[:, k] - corners[:, k - 1]) for k in range(3)], axis=0)
    parts = np.minimum(np.ceil(longest / spacing), MOST_PARTS).astype(int)
    places, directions, vertices = [mesh.vertices[first]], [normals], [first]
    for count in np.unique(parts[parts > 1]).tolist():
        large = np.flatnonzero(parts == count)
        for shares in _grid(count):
            places.append(np.einsum("k,tkc->tc", shares, corners[large]))
            directions.append(areas[large])
            vertices.append(mesh.triangles[large, shares.argmax()])
    return _Surface(np.concatenate(places), normalised(np.concatenate(directions)), np.concatenate(vertices))


def _inside_out(corners: Array, areas: Array, joined: Numbers, count: int) -> NDArray[np.bool_]:
    """(triangles,), whether each belongs to a part of the mesh whose triangles face inwards, by the sign of its volume.

    `joined`, (triangles, 3), are the numbers of their corners, below `count`.
    """
    edges = np.concatenate([joined[:, :2], joined[:, 1:]])
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(count, count))
    part = connected_components(graph, directed=False)[1][joined[:, 0]]
    sums = np.stack([np.bincount(part, corners[:, 0, axis]) for axis in range(3)], axis=1)
    middles = sums / np.maximum(np.bincount(part), 1)[:, None]
    volumes = np.bincount(part, ((corners[:, 0] - middles[part]) * areas).sum(axis=1))
    return np.asarray(volumes[part] < 0.0)


def _grid(count: int) -> Array:
    """Barycentric coordinates of the points that divide a triangle's sides into `count` parts, without its corners."""
    shares = [(a, b, count - a - b) for a in range(count + 1) for b in range(count + 1 - a)]
    return np.array([each for each in shares if max(each) < count]) / count


def _shrunk(surface: _Surface, chosen: Numbers, largest: float) -> tuple[Array, Array, Numbers]:
    """Centres and radii of the balls that touch the skin at the chosen points, and the points that they touch too."""
    tree, p, n = KDTree(surface.places), surface.places[chosen], surface.normals[chosen]
    radii, others, shrinking = np.full(len(chosen), largest), chosen.copy(), np.arange(len(chosen))
    for _ in range(SHRINKS):
        away, found = tree.query(p[shrinking] - radii[shrinking, None] * n[shrinking])
        nearest = np.asarray(found, np.intp)
        smaller = (away < radii[shrinking] * (1.0 - 1e-6)) & (nearest != chosen[shrinking])
        shrinking, nearest = shrinking[smaller], nearest[smaller]
        if not len(shrinking):
            break
        apart = p[shrinking] - surface.places[nearest]
        radii[shrinking] = (apart**2).sum(axis=1) / (2.0 * (apart * n[shrinking]).sum(axis=1))
        others[shrinking] = nearest
    return p - radii[:, None] * n, radii, others


def _not_within_others(centres: Array, radii: Array, joints: Numbers, margin: float) -> Numbers:
    """The numbers of the balls that stick out of each other ball on their joint by more than a margin."""
    kept = []
    for joint in np.unique(joints).tolist():
        on = np.flatnonzero(joints == joint)
        on = on[np.argsort(-radii[on], kind="stable")]
        while len(on):
            kept.append(on[0])
            out = lengths(centres[on] - centres[on[0]]) + radii[on] > radii[on[0]] + margin
            out[0] = False
            on = on[out]
    return np.array(sorted(kept), np.intp)


@dataclass(frozen=True, eq=False)
class Clusters:
    """Capsules in groups of one joint and one segment, and these in clusters of a few neighbours, each within a ball.

    Attributes:
        groups: (groups + 1, 3), the joint and the segment of each, and its first cluster; the last is their end.
        first: (clusters + 1,), the first capsule of each; the last is their end.
        balls: (groups + clusters, 4), centre relative to the joint, and radius [file units].
        capsules: (capsules, 10), where the axis begins relative to the joint, its direction and its length, the radius
            where it begins, the change of the radius along it, and how far along it, over a point's distance to the
            axis, the nearest ball is off the point's foot.
    """

    groups: Numbers
    first: Numbers
    balls: Array
    capsules: Array


def clusters_of(capsules: Capsules) -> Clusters:
    """Return the capsules of a body in clusters."""
    middles, groups, balls = capsules.ends.mean(axis=1), [], []
    clusters: list[Numbers] = []
    for joint, segment in np.unique(np.stack([capsules.joints, capsules.segments], axis=1), axis=0).tolist():
        on = np.flatnonzero((capsules.joints == joint) & (capsules.segments == segment))
        groups.append((joint, segment, len(clusters)))
        balls.append(_ball_around(capsules, on))
        clusters += halves(middles, on, CLUSTER)
    balls += [_ball_around(capsules, on) for on in clusters]
    order = np.concatenate([np.zeros(0, np.intp), *clusters])
    ends, radii = capsules.ends[order], capsules.radii[order]
    axes = ends[:, 1] - ends[:, 0]
    along = lengths(axes)
    known = np.where(along > 0.0, along, 1.0)
    taper = np.where(along > 0.0, radii[:, 1] - radii[:, 0], 0.0) / known
    cosine = np.sqrt(np.maximum(1.0 - taper**2, 0.0))
    slope = np.divide(taper, cosine, out=STEEP * np.sign(taper), where=cosine > 1.0 / STEEP)
    return Clusters(
        groups=np.array([*groups, (-1, -1, len(clusters))], np.intp),
        first=np.cumsum([0, *map(len, clusters)]),
        balls=np.array(balls).reshape(-1, 4),
        capsules=np.column_stack([ends[:, 0], axes / known[:, None], along, radii[:, 0], taper, slope]),
    )


def _ball_around(capsules: Capsules, on: Numbers) -> Array:
    """A ball around some of the capsules of a joint: centre and radius."""
    ends = capsules.ends[on]
    centre = ends.mean(axis=(0, 1))
    return np.append(centre, (lengths(ends - centre) + capsules.radii[on]).max())
