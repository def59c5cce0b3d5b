"""The skin of hands and forearms as points, and what they may sink into: capsules, or the inside of a mesh as balls.

A ball of the medial axis touches the skin in two places and lies inside; balls show more than a few capsules do. One is
found from one of the two places by shrinking: the largest ball that touches there and whose inside holds no other point
of the skin (J. Ma, S. W. Bae, S. Choi, "3D medial axis point approximation using nearest neighbors and the normal
field", The Visual Computer 28, 2012). Holes, seams and layers of clothes do no harm, as each ball sees only what is
near it. Points are in patches and capsules in clusters, each within a ball: what is apart need not be looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from distretarget.measure.skin_depths import LIMBS, Clusters, Patches
from distretarget.numerics.vectors import Array, Flags, Numbers, cross, lengths, normalised, spread_out
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SkinnedMesh

MOST = (128, 128, 64, 64)  # points of each limb
INFLUENCES = 4  # most joints that move a point
PATCH = 8  # most points of a patch
BLENDED = 1.2  # room for points that other joints move as well [radii of a patch]
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))  # between neighbouring points of a spiral over a surface [rad]
SPACING = 0.02  # between neighbouring places where balls touch the skin [extents of the mesh]
LARGEST_BALL = 0.25  # radius from which balls shrink [extents of the mesh]
SAME = 0.004  # balls that stick out of another by less than this are left out [extents of the mesh]
MOST_PARTS = 12  # into which an edge of a large triangle is divided
SHRINKS = 30  # most steps of shrinking
CLUSTER = 8  # most capsules of a cluster
STEEP = 1e9  # slope of a capsule of which one end is within the other


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of the skin, bound to joints as a mesh is."""

    limbs: Numbers  # (points,), of each, a number of `LIMBS`
    joints: Numbers  # (points, influences), the joints that move each
    weights: Array  # (points, influences), their shares, which sum to 1
    offsets: Array  # (points, influences, 3), from each of these joints to the point in the rest pose [file units]
    counts: Array  # (points,), the number of vertices of the mesh that each stands for, those nearest to it

    def __len__(self) -> int:
        return len(self.limbs)

    def __getitem__(self, chosen: Flags | Numbers) -> SkinPoints:
        return SkinPoints(*(each[chosen] for each in vars(self).values()))


def points_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton, segments: Numbers) -> SkinPoints:
    """Return vertices of a mesh, spread over each limb; `segments`, (joints,), are those that joints carry, or -1."""
    strongest = mesh.joints[np.arange(len(mesh.joints)), mesh.weights.argmax(axis=1)]
    chosen, limbs, counts = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)]
    for limb, name in enumerate(LIMBS):
        on = np.flatnonzero(segments[strongest] == SEGMENTS.index(name))
        if len(on):
            chosen.append(on[spread_out(mesh.vertices[on], MOST[limb])])
            limbs.append(np.full(len(chosen[-1]), limb))
            nearest = KDTree(mesh.vertices[chosen[-1]]).query(mesh.vertices[on])[1]
            counts.append(np.bincount(nearest, minlength=len(chosen[-1])).astype(np.float64))
    vertices = np.concatenate(chosen)
    order = np.argsort(-mesh.weights[vertices], axis=1, kind="stable")[:, :INFLUENCES]
    joints = np.take_along_axis(mesh.joints[vertices], order, axis=1)
    weights = np.take_along_axis(mesh.weights[vertices], order, axis=1)
    weights = weights / weights.sum(axis=1, keepdims=True)
    offsets = mesh.vertices[vertices][:, None] - skeleton.rest_positions[joints]
    return SkinPoints(np.concatenate(limbs), joints, weights, offsets, np.concatenate(counts))


def points_of_capsules(capsules: Capsules) -> SkinPoints:
    """Return points spread over the capsules of each limb, without those within another capsule of the same joint."""
    joints, offsets, limbs = [], [], []
    for limb, name in enumerate(LIMBS):
        on = np.flatnonzero(capsules.segments == SEGMENTS.index(name))
        for capsule in on.tolist():
            points = _spiral(capsules.ends[capsule], capsules.radii[capsule], max(MOST[limb] // len(on), 4))
            joints += [capsules.joints[capsule]] * len(points)
            limbs += [limb] * len(points)
            offsets.append(points)
    moved = np.array(joints, np.intp)[:, None]
    places = np.concatenate([np.zeros((0, 3)), *offsets])[:, None]
    return SkinPoints(np.array(limbs, np.intp), moved, np.ones(moved.shape), places, np.ones(len(limbs)))


def _spiral(ends: Array, radii: Array, count: int) -> Array:
    """Points on a tapered capsule, (count, 3), on a spiral from one tip to the other."""
    (start, end), (first, last) = ends, radii
    length = float(lengths(end - start))
    along = normalised(end - start) if length else np.array([0.0, 1.0, 0.0])
    across = normalised(np.cross(along, np.eye(3)[np.abs(along).argmin()]))
    places = -first + (np.arange(count) + 0.5) / count * (first + length + last)
    angles = GOLDEN_ANGLE * np.arange(count)
    on_axis = np.clip(places, 0.0, length)
    radii = first + (last - first) * (on_axis / length if length else 0.0)
    beyond = places - on_axis
    radii = np.sqrt(np.maximum(radii**2 - beyond**2, 0.0))
    around = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * np.cross(along, across)
    return np.asarray(start + places[:, None] * along + radii[:, None] * around)


def patches_of(points: SkinPoints) -> Patches:
    """Return points in patches."""
    rows, strongest = np.arange(len(points)), points.weights.argmax(axis=1)
    joints, offsets = points.joints[rows, strongest], points.offsets[rows, strongest]
    limbs, patches, balls = [0], [], []
    order: list[int] = []
    for limb in range(len(LIMBS)):
        for joint in np.unique(joints[points.limbs == limb]).tolist():
            for patch in _halves(offsets, np.flatnonzero((points.limbs == limb) & (joints == joint)), PATCH):
                middle = offsets[patch].mean(axis=0)
                patches.append((joint, len(order)))
                balls.append((*middle, BLENDED * lengths(offsets[patch] - middle).max()))
                order.extend(patch.tolist())
        limbs.append(len(patches))
    points = points[np.array(order, np.intp)]
    return Patches(
        limbs=np.array(limbs, np.intp),
        patches=np.array([*patches, (-1, len(order))], np.intp),
        balls=np.array(balls).reshape(-1, 4),
        joints=points.joints,
        bound=np.concatenate([points.offsets, points.weights[..., None]], axis=2),
        counts=points.counts,
    )


class _Surface(NamedTuple):
    """Points of the skin."""

    places: Array  # (points, 3)
    normals: Array  # (points, 3)
    vertices: Numbers  # (points,), the vertex that moves each


def inner_balls(mesh: SkinnedMesh, skeleton: Skeleton, segments: Numbers) -> Capsules:
    """Return balls, capsules without length, that fill a mesh in its bind pose. `segments`, (joints,), is the part of
    the body that each joint of the skeleton carries, -1 for none.
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


def _inside_out(corners: Array, areas: Array, joined: Numbers, count: int) -> Flags:
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


def clusters_of(capsules: Capsules) -> Clusters:
    """Return the capsules of a body in clusters."""
    middles, groups, balls = capsules.ends.mean(axis=1), [], []
    clusters: list[Numbers] = []
    for joint, segment in np.unique(np.stack([capsules.joints, capsules.segments], axis=1), axis=0).tolist():
        on = np.flatnonzero((capsules.joints == joint) & (capsules.segments == segment))
        groups.append((joint, segment, len(clusters)))
        balls.append(_ball_around(capsules, on))
        clusters += _halves(middles, on, CLUSTER)
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


def _halves(places: Array, on: Numbers, most: int) -> list[Numbers]:
    """Some of the places in halves of halves along their longest extent, down to parts of `most` at most."""
    if len(on) <= most:
        return [on]
    in_line = on[np.argsort(places[on, np.ptp(places[on], axis=0).argmax()], kind="stable")]
    half = len(on) // 2
    return _halves(places, in_line[:half], most) + _halves(places, in_line[half:], most)
