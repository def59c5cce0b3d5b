"""The surface of a mesh as points spread over its triangles, and how far its parts are from each other in poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Flags, Numbers, cross, lengths, normalised
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SkinnedMesh

# How many points a segment of a body has: limbs are thin, and what they touch is large.
POINTS = {"hand": 220, "forearm": 180, "chest": 400, "belly": 300, "pelvis": 300, "head": 400, "thigh": 200}
OTHER_POINTS = 120
STEPS = (0.7548776662466927, 0.5698402909980532)  # between points that spread evenly over a square

Part = tuple[int, ...]  # the numbers of its segments


@dataclass(frozen=True, eq=False)
class Surface:
    """Points on the outside of a mesh, bound to the joints of its skeleton.

    A point is the sum over joints of R b + w x, with the rotations R and the places x of the joints, where b is what
    the corners of its triangle are off the joint in the rest pose, times their weights, and w the sum of these.
    """

    points: csr_array  # (points, 4 joints), b and w of each joint
    edges: tuple[csr_array, csr_array]  # the same of two edges of the triangle, in an order that leads round out of it
    radii: Array  # (points,), of the piece of surface that each stands for, in the rest pose [file units]
    segments: Numbers  # (points,), the segment of each

    @classmethod
    def of(cls, mesh: SkinnedMesh, skeleton: Skeleton, of_joint: Numbers, capsules: Capsules) -> Surface:
        """Return the surface of a body with these capsules, whose joints belong to segments `of_joint`, (joints,)."""
        triangles, radii, segments = _spread(mesh, skeleton, of_joint, capsules)
        corners, count = mesh.triangles[np.abs(triangles) - 1], len(triangles)
        corners = np.where((triangles > 0)[:, None], corners, corners[:, ::-1])
        bound = _bound(mesh, skeleton)
        u, v = np.remainder(np.outer(STEPS, np.arange(count)) + 0.5, 1.0)
        u, v = np.where(u + v > 1.0, 1.0 - np.array([u, v]), [u, v])  # the other half of the square
        none, one = np.zeros(count), np.ones(count)
        shares = [1.0 - u - v, u, v], [-one, one, none], [-one, none, one]
        rows, size = np.repeat(np.arange(count), 3), (count, len(mesh.vertices))
        points, first, second = (
            csr_array((np.transpose(each).ravel(), (rows, corners.ravel())), size) @ bound for each in shares
        )
        return cls(points, (first, second), radii, segments)

    def posed(self, motion: Motion, chosen: Numbers) -> tuple[Array, Array]:
        """Return some points in each frame, and the unit vectors out of the skin there, (frames, points, 3)."""
        rotations, joints = motion.world_rotations, len(motion.skeleton)
        matrices = Rotation.from_quat(rotations.reshape(-1, 4)).as_matrix().reshape(-1, joints, 3, 3)
        moved = np.concatenate([matrices, motion.positions[..., None]], axis=3)  # (frames, joints, 3, 4)
        columns = moved.transpose(1, 3, 0, 2).reshape(4 * joints, -1)
        a, b, c = (
            np.moveaxis((each[chosen] @ columns).reshape(len(chosen), len(motion), 3), 1, 0)
            for each in (self.points, *self.edges)
        )
        return a, normalised(cross(b, c))

    def gaps(self, motion: Motion, parts: Sequence[tuple[Part, Part]], wanted: Flags, farthest: float) -> Array:
        """Return how far parts are from others in each frame, (frames, pairs), negative where they are in, or
        `farthest` where that is less [file units].

        Args:
            motion: its frames.
            parts: (pairs,), the one and the other.
            wanted: (frames, pairs), where to look; elsewhere they are `farthest`.
            farthest: [file units]
        """
        gaps = np.full(wanted.shape, farthest)
        frames: Numbers = np.flatnonzero(wanted.any(axis=1))
        some = {part for pair in np.flatnonzero(wanted.any(axis=0)).tolist() for part in parts[pair]}
        chosen = np.flatnonzero(np.isin(self.segments, [segment for part in some for segment in part]))
        on = {part: np.flatnonzero(np.isin(self.segments[chosen], part)) for part in some}
        places, outwards = self.posed(motion[frames], chosen)
        for row, frame in enumerate(frames.tolist()):
            trees: dict[Part, KDTree] = {}
            for pair in np.flatnonzero(wanted[frame]).tolist():
                one, other = (on[part] for part in parts[pair])
                if not len(other):
                    continue
                tree = trees[parts[pair][1]] = trees.get(parts[pair][1]) or KDTree(places[row, other])
                away, nearest = map(np.asarray, tree.query(places[row, one], distance_upper_bound=farthest))
                near = np.isfinite(away)
                below = other[nearest[near]]
                by = places[row, one[near]] - places[row, below]
                heights = _heights(by, outwards[row, below], self.radii[chosen[below]])
                gaps[frame, pair] = heights.min(initial=farthest)
        return gaps


def _spread(
    mesh: SkinnedMesh, skeleton: Skeleton, of_joint: Numbers, capsules: Capsules
) -> tuple[Numbers, Array, Numbers]:
    """Triangles for points at equal shares of the surface of each segment, (points,), their numbers from 1 on, negative
    where their corners lead round into the body; the radii that the points stand for; and their segments.
    """
    corners = mesh.vertices[mesh.triangles]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas, middles = 0.5 * lengths(normals), corners.mean(axis=1)
    strongest = mesh.joints[np.arange(len(mesh.joints)), mesh.weights.argmax(axis=1)]
    of_corners = of_joint[strongest][mesh.triangles]
    found = [(np.zeros(0, np.intp), np.zeros(0), np.zeros(0, np.intp))]
    for segment, name in enumerate(SEGMENTS):
        own = capsules[capsules.segments == segment]
        on = np.flatnonzero((of_corners == segment).all(axis=1) & (areas > 0.0))
        if len(on) and len(own):
            out = middles[on] - _nearest_on(own.ends + skeleton.rest_positions[own.joints, None], middles[on])
            leads_out = (normals[on] * out).sum(axis=1) > 0.0
            mostly = areas[on] @ leads_out >= 0.5 * areas[on].sum()
            on = on[leads_out == mostly]  # the rest is the other side of cloth, or skin beneath it
            count = next((count for part, count in POINTS.items() if name.endswith(part)), OTHER_POINTS)
            area = areas[on].sum()
            chosen = on[np.searchsorted(np.cumsum(areas[on]), (np.arange(count) + 0.5) / count * area)]
            sign = 1 if mostly else -1
            found.append(
                (sign * (chosen + 1), np.full(count, np.sqrt(area / (np.pi * count))), np.full(count, segment))
            )
    triangles, radii, segments = map(np.concatenate, zip(*found, strict=True))
    return triangles, radii, segments


def _nearest_on(ends: Array, points: Array) -> Array:
    """(points, 3), the nearest places on axes with ends, (axes, 2, 3)."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    t = np.clip(((points[:, None] - start) * along).sum(axis=2) / square, 0.0, 1.0)
    feet = start + t[..., None] * along
    return np.asarray(feet[np.arange(len(points)), lengths(points[:, None] - feet).argmin(axis=1)])


def _bound(mesh: SkinnedMesh, skeleton: Skeleton) -> csr_array:
    """(vertices, 4 joints), how each vertex is bound to each joint, as `Surface.points` are."""
    off = mesh.vertices[:, None] - skeleton.rest_positions[mesh.joints]
    values = mesh.weights[..., None] * np.concatenate([off, np.ones((*mesh.joints.shape, 1))], axis=2)
    columns = 4 * mesh.joints[..., None] + np.arange(4)
    rows = np.broadcast_to(np.arange(len(mesh.vertices))[:, None, None], columns.shape)
    return csr_array((values.ravel(), (rows.ravel(), columns.ravel())), (len(mesh.vertices), 4 * len(skeleton)))


def _heights(by: Array, outwards: Array, radii: Array) -> Array:
    """(points,), how far off a surface points are, by the vectors to them from the nearest of its own points, (points,
    3), which stand for pieces with some radii, (points,); negative beneath.
    """
    height = (by * outwards).sum(axis=1)
    aside = np.maximum(lengths(by - height[:, None] * outwards) - radii, 0.0)
    return np.asarray(np.where((height < 0.0) & (aside <= radii), height, np.hypot(height, aside)))
