"""The skin of the parts of a body as points, in patches within balls: what is apart need not be looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from distretarget.measure.skin_depths import PARTS, Patches
from distretarget.measure.solids import strongest
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, normalised, spread_out
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
    joints: Numbers  # (points, influences), the joints that move each
    weights: Array  # (points, influences), their shares, which sum to 1
    offsets: Array  # (points, influences, 3), from each of these joints to the point in the rest pose [file units]
    counts: Array  # (points,), the number of vertices of the mesh that each stands for, those nearest to it

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, chosen: Flags | Numbers) -> SkinPoints:
        return SkinPoints(*(each[chosen] for each in vars(self).values()))


def points_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton, segments: Numbers) -> SkinPoints:
    """Return vertices of a mesh, spread over each part; `segments`, (joints,), are those that joints carry, or -1."""
    joints, weights = strongest(mesh)
    of_vertex = segments[joints[:, 0]]
    chosen, parts, counts = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)]
    for part in range(len(PARTS)):
        on = np.flatnonzero(of_vertex == part)
        if len(on):
            chosen.append(on[spread_out(mesh.vertices[on], _most(part))])
            parts.append(np.full(len(chosen[-1]), part))
            nearest = KDTree(mesh.vertices[chosen[-1]]).query(mesh.vertices[on])[1]
            counts.append(np.bincount(nearest, minlength=len(chosen[-1])).astype(np.float64))
    vertices = np.concatenate(chosen)
    offsets = mesh.vertices[vertices][:, None] - skeleton.rest_positions[joints[vertices]]
    return SkinPoints(np.concatenate(parts), joints[vertices], weights[vertices], offsets, np.concatenate(counts))


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
    return SkinPoints(np.array(parts, np.intp), moved, np.ones(moved.shape), places, np.ones(len(parts)))


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


def patches_of(points: SkinPoints) -> Patches:
    """Return points in patches."""
    rows, most = np.arange(len(points)), points.weights.argmax(axis=1)
    joints, offsets = points.joints[rows, most], points.offsets[rows, most]
    parts, patches, balls = [0], [], []
    order: list[int] = []
    for part in range(len(PARTS)):
        for joint in np.unique(joints[points.parts == part]).tolist():
            for patch in _halves(offsets, np.flatnonzero((points.parts == part) & (joints == joint)), PATCH):
                middle = offsets[patch].mean(axis=0)
                patches.append((joint, len(order)))
                balls.append((*middle, BLENDED * lengths(offsets[patch] - middle).max()))
                order.extend(patch.tolist())
        parts.append(len(patches))
    points = points[np.array(order, np.intp)]
    return Patches(
        parts=np.array(parts, np.intp),
        patches=np.array([*patches, (-1, len(order))], np.intp),
        balls=np.array(balls).reshape(-1, 4),
        joints=points.joints,
        bound=np.concatenate([points.offsets, points.weights[..., None]], axis=2),
        counts=points.counts,
    )


def one_by_one(points: SkinPoints) -> Patches:
    """Return points as patches of one point each, each a part of its own."""
    rows = np.arange(len(points) + 1)
    most = points.weights.argmax(axis=1)[:, None]
    joints = np.append(np.take_along_axis(points.joints, most, axis=1)[:, 0], -1)
    middles = np.take_along_axis(points.offsets, most[..., None], axis=1)[:, 0]
    bound = np.concatenate([points.offsets, points.weights[..., None]], axis=2)
    balls = np.column_stack([middles, np.zeros(len(points))])
    return Patches(rows, np.column_stack([joints, rows]), balls, points.joints, bound, points.counts)


def _halves(places: Array, on: Numbers, most: int) -> list[Numbers]:
    """Some of the places in halves of halves along their longest extent, down to parts of `most` at most."""
    if len(on) <= most:
        return [on]
    in_line = on[np.argsort(places[on, np.ptp(places[on], axis=0).argmax()], kind="stable")]
    half = len(on) // 2
    return _halves(places, in_line[:half], most) + _halves(places, in_line[half:], most)
