"""The skin of the parts of a body as points, in patches within balls: what is apart need not be looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from distretarget.measure.skin_depths import PARTS, Patches
from distretarget.measure.solids import strongest, welded
from distretarget.numerics.vectors import Array, Flags, Numbers, halves, lengths, normalised, spread_out
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh

# points of each part at most
MOST = {"hand": 256, "forearm": 128, "upper arm": 48, "thigh": 48, "shin": 32, "foot": 32, "head": 64}
PATCH = 8  # most points of a patch
BLENDED = 1.2  # room for points that other joints move as well [radii of a patch]
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))  # between neighbouring points of a spiral over a surface [rad]


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of the skin, bound to joints as a mesh is."""

    parts: Numbers  # (points,), the part of the body of each, a number of `PARTS`
    joints: Numbers  # (points, influences), the joints that move each, the strongest first
    weights: Array  # (points, influences), their shares, which sum to 1
    offsets: Array  # (points, influences, 3), from each of these joints to the point in the rest pose [file units]
    edges: Numbers  # (edges, 2), those of the mesh between two points

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, chosen: Flags | Numbers) -> SkinPoints:
        """Return some of the points, with the edges between two of these."""
        numbers = np.full(len(self), -1)
        numbers[chosen] = np.arange(len(self.parts[chosen]))
        edges = numbers[self.edges]
        kept = edges[(edges >= 0).all(axis=1)]
        return SkinPoints(self.parts[chosen], self.joints[chosen], self.weights[chosen], self.offsets[chosen], kept)


def points_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton, segments: Numbers) -> SkinPoints:
    """Return the vertices of a mesh on `PARTS`, of those at one place the first; `segments`, (joints,), are those that
    joints carry, or -1.
    """
    joints, weights = strongest(mesh)
    triangles, of_vertex = welded(mesh), segments[joints[:, 0]]
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    offsets = mesh.vertices[:, None] - skeleton.rest_positions[joints]
    points = SkinPoints(of_vertex, joints, weights, offsets, edges)
    return points[np.unique(triangles[np.isin(of_vertex[triangles], range(len(PARTS)))])]


def points_of_capsules(capsules: Capsules) -> SkinPoints:
    """Return points spread over the capsules of each part."""
    joints, offsets, parts = [], [], []
    for part in range(len(PARTS)):
        on = np.flatnonzero(capsules.segments == part)
        for capsule in on.tolist():
            points = _spiral(capsules.ends[capsule], capsules.radii[capsule], max(_most(part) // len(on), 4))
            joints += [capsules.joints[capsule]] * len(points)
            parts += [part] * len(points)
            offsets.append(points)
    moved = np.array(joints, np.intp)[:, None]
    places = np.concatenate([np.zeros((0, 3)), *offsets])[:, None]
    return SkinPoints(np.array(parts, np.intp), moved, np.ones(moved.shape), places, np.zeros((0, 2), np.intp))


def _most(part: int) -> int:
    """The number of points of a part, at most."""
    return MOST[PARTS[part].removeprefix("left ").removeprefix("right ")]


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


def patches_of(points: SkinPoints, rest: Array) -> Patches:
    """Return points in patches; `rest`, (joints, 3), are the places of the joints in the rest pose."""
    joints, offsets = points.joints[:, 0], points.offsets[:, 0]
    places = rest[joints] + offsets
    parts, patches, balls = [0], [], []
    order: list[int] = []
    counts = np.zeros(len(points))
    for part in range(len(PARTS)):
        on = np.flatnonzero(points.parts == part)
        chosen = on
        if len(on):
            chosen = on[spread_out(places[on], _most(part))]
            counts[chosen] = np.bincount(KDTree(places[chosen]).query(places[on])[1], minlength=len(chosen))
        for joint in np.unique(joints[chosen]).tolist():
            for patch in halves(offsets, chosen[joints[chosen] == joint], PATCH):
                middle = offsets[patch].mean(axis=0)
                patches.append((joint, len(order)))
                balls.append((*middle, BLENDED * lengths(offsets[patch] - middle).max()))
                order.extend(patch.tolist())
        parts.append(len(patches))
    in_patches = np.array(order, np.intp)
    points = points[np.append(in_patches, np.setdiff1d(np.arange(len(points)), in_patches))]
    first, neighbours = _neighbours(points)
    return Patches(
        parts=np.array(parts, np.intp),
        patches=np.array([*patches, (-1, len(order))], np.intp),
        balls=np.array(balls).reshape(-1, 4),
        joints=points.joints,
        bound=np.concatenate([points.offsets, points.weights[..., None]], axis=2),
        counts=counts[in_patches],
        first=first,
        neighbours=neighbours,
    )


def one_by_one(points: SkinPoints) -> Patches:
    """Return points as patches of one point each, each a part of its own."""
    rows = np.arange(len(points) + 1)
    bound = np.concatenate([points.offsets, points.weights[..., None]], axis=2)
    balls = np.column_stack([points.offsets[:, 0], np.zeros(len(points))])
    patches = np.column_stack([np.append(points.joints[:, 0], -1), rows])
    alone = np.zeros(len(rows), np.intp), np.zeros(0, np.intp)
    return Patches(rows, patches, balls, points.joints, bound, np.ones(len(points)), *alone)


def _neighbours(points: SkinPoints) -> tuple[Numbers, Numbers]:
    """The points at the other ends of the edges of each point: the first of each, (points + 1,), and all."""
    on = points.edges[(points.parts[points.edges] == points.parts[points.edges[:, :1]]).all(axis=1)]
    there = np.concatenate([on, on[:, ::-1]])
    there = there[np.argsort(there[:, 0], kind="stable")]
    return np.searchsorted(there[:, 0], np.arange(len(points) + 1)), np.ascontiguousarray(there[:, 1])
