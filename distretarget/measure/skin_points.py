"""Points on the skin of hands and forearms, which move with the joints of a body, in patches of neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from distretarget.numerics.vectors import lengths, normalised, spread_out
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SkinnedMesh

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

LIMBS = ("left hand", "right hand", "left forearm", "right forearm")
MOST = (128, 128, 64, 64)  # points of each limb
INFLUENCES = 4  # most joints that move a point
PATCH = 8  # most points of a patch
BLENDED = 1.2  # room for points that other joints move as well [radii of a patch]
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))  # between neighbouring points of a spiral over a surface [rad]


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of the skin, bound to joints as a mesh is.

    Attributes:
        limbs: (points,), of each, a number of `LIMBS`.
        joints: (points, influences), the joints that move each.
        weights: (points, influences), their shares, which sum to 1.
        offsets: (points, influences, 3), from each of these joints to the point while no joint is turned [file units].
        counts: (points,), the number of vertices of the mesh that each stands for, those nearest to it.
    """

    limbs: Numbers
    joints: Numbers
    weights: Array
    offsets: Array
    counts: Array

    def __len__(self) -> int:
        return len(self.limbs)

    def __getitem__(self, chosen: NDArray[np.bool_] | Numbers) -> SkinPoints:
        limbs, joints, weights = self.limbs[chosen], self.joints[chosen], self.weights[chosen]
        return SkinPoints(limbs, joints, weights, self.offsets[chosen], self.counts[chosen])


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


@dataclass(frozen=True, eq=False)
class Patches:
    """Points of one limb that one joint moves most, in patches of a few neighbours.

    Attributes:
        limbs: (limbs + 1,), the first patch of each; the last is their end.
        patches: (patches + 1, 2), joint and first point of each; the last is their end.
        balls: (patches, 4), centre relative to the joint, and radius [file units].
        points: the points in this order.
    """

    limbs: Numbers
    patches: Numbers
    balls: Array
    points: SkinPoints


def patches_of(points: SkinPoints) -> Patches:
    """Return points in patches."""
    rows, strongest = np.arange(len(points)), points.weights.argmax(axis=1)
    joints, offsets = points.joints[rows, strongest], points.offsets[rows, strongest]
    limbs, patches, balls = [0], [], []
    order: list[int] = []
    for limb in range(len(LIMBS)):
        for joint in np.unique(joints[points.limbs == limb]).tolist():
            for patch in halves(offsets, np.flatnonzero((points.limbs == limb) & (joints == joint)), PATCH):
                middle = offsets[patch].mean(axis=0)
                patches.append((joint, len(order)))
                balls.append((*middle, BLENDED * lengths(offsets[patch] - middle).max()))
                order.extend(patch.tolist())
        limbs.append(len(patches))
    return Patches(
        limbs=np.array(limbs, np.intp),
        patches=np.array([*patches, (-1, len(order))], np.intp),
        balls=np.array(balls).reshape(-1, 4),
        points=points[np.array(order, np.intp)],
    )


def halves(places: Array, on: Numbers, most: int) -> list[Numbers]:
    """Return some of the places in halves of halves along their longest extent, down to parts of `most` at most."""
    if len(on) <= most:
        return [on]
    in_line = on[np.argsort(places[on, np.ptp(places[on], axis=0).argmax()], kind="stable")]
    half = len(on) // 2
    return halves(places, in_line[:half], most) + halves(places, in_line[half:], most)
