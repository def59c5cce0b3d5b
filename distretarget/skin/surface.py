"""The surface of a mesh as points spread over its triangles, and the gaps between its parts in poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Flags, Numbers, bisected, cross, extent, lengths, normalised
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SAME_PLACE, SAME_SHARE, SkinnedMesh
from distretarget.skin.surface_gaps import RUN, Bound, GapWorkspace, Points, Runs, write_gaps

# The number of points of each segment: limbs are thin, and the parts that they touch are large.
POINTS = {"hand": 220, "forearm": 180, "chest": 400, "belly": 300, "pelvis": 300, "head": 400, "thigh": 200}
OTHER_POINTS = 120
STEPS = (0.7548776662466927, 0.5698402909980532)  # of a low-discrepancy sequence on the unit square
AT_CORNER = 0.98  # the barycentric coordinate of a point at a corner of its triangle
OBLIQUE = Rotation.from_euler("xyz", [0.5, 0.7, 0.9]).as_matrix()  # axes along which the corners of a box differ
OF_SIDE = [np.array([name.startswith(side) for name in SEGMENTS]) for side in ("left", "right")]

Part = tuple[int, ...]  # the indices of its segments


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Points on the outside of a mesh, bound to the joints of its skeleton. Each moves exactly as the skinned triangle
    on which it is, since its binding is the weighted sum of those of the corners.
    """

    points: Points  # [file units]

    @classmethod
    def of(cls, mesh: SkinnedMesh, skeleton: Skeleton, of_joint: Numbers, capsules: Capsules) -> SurfaceSamples:
        """Return the surface of a body with these capsules; `of_joint`, (joints,), are the segments of its joints."""
        plane = _middle_plane(skeleton, capsules)
        folded, sides = _folded(mesh.vertices, *plane)
        triangles, numbers, radii, segments = _spread(mesh, skeleton, of_joint, capsules, folded, sides)
        corners, count = mesh.triangles[np.abs(triangles) - 1], len(triangles)
        order = folded[corners, 0].argsort(axis=1)
        corners, is_even = np.take_along_axis(corners, order, axis=1), (order[:, 1] - order[:, 0]) % 3 == 1
        normals = cross(*(mesh.vertices[corners[:, k]] - mesh.vertices[corners[:, 0]] for k in (1, 2)))
        are_large = 0.5 * lengths(normals) > np.pi * radii**2
        shares, leads_in = _shares(triangles, numbers, are_large), (triangles > 0) != is_even
        corners = np.where(leads_in[:, None], corners[:, [0, 2, 1]], corners)
        shares, normals = np.where(leads_in, shares[[0, 2, 1]], shares), np.where(leads_in[:, None], -normals, normals)
        groups = _by_neighbours(*_folded((shares.T[..., None] * mesh.vertices[corners]).sum(axis=1), *plane), segments)
        order = np.concatenate([segments[:0], *groups])
        corners, shares, radii, are_large = corners[order], shares[:, order], radii[order], are_large[order]
        none, one = np.zeros(count), np.ones(count)
        rows, vertices = np.repeat(np.arange(count), 3), _bound(mesh, skeleton)
        size = count, len(mesh.vertices)
        places, first, second = (
            _rows(csr_array((np.transpose(each).ravel(), (rows, corners.ravel())), size) @ vertices)
            for each in (shares, [-one, one, none], [-one, none, one])
        )
        dipoles = (np.pi * radii**2)[:, None] * normalised(normals[order])
        runs = _runs(places, dipoles, np.cumsum([0, *map(len, groups)]), segments)
        return cls(Points(places, first, second, radii, np.ascontiguousarray(shares[1:].T), are_large, runs))

    def gaps(self, motion: Motion, parts: Sequence[tuple[int, Part]], wanted: Flags, farthest: float) -> Array:
        """Return the gaps between limbs and parts in each frame, (frames, pairs), negative for depths, and at most
        `farthest` [file units].

        Args:
            motion: of the mesh.
            parts: (pairs,), the segment of the limb, and the segments of the part.
            wanted: (frames, pairs), the gaps to find; others are `farthest`.
            farthest: [file units]
        """
        frames, gaps = np.flatnonzero(wanted.any(axis=1)), np.full(wanted.shape, farthest)
        some, found = motion[frames], np.full((len(frames), len(parts)), farthest)
        matrices = Rotation.from_quat(some.world_rotations.reshape(-1, 4)).as_matrix()
        matrices = matrices.reshape(*some.positions.shape[:2], 3, 3)
        transforms = np.concatenate([matrices, some.positions[..., None]], axis=3)
        limbs, members = np.array([limb for limb, _ in parts], np.intp), np.zeros((len(parts), len(SEGMENTS)), bool)
        for pair, (_, part) in enumerate(parts):
            members[pair, [*part]] = True
        room = GapWorkspace.of(self.points, len(parts))
        write_gaps(self.points, transforms, limbs, members, np.ascontiguousarray(wanted[frames]), farthest, room, found)
        gaps[frames] = found
        return gaps


def _middle_plane(skeleton: Skeleton, capsules: Capsules) -> tuple[Array, Array]:
    """A point between the left and the right of a body with these capsules and the unit vector to its left, (3,) each;
    zeros if either side has none.
    """
    middles = capsules.ends.mean(axis=1) + skeleton.rest_positions[capsules.joints]
    halves_of = [middles[of_side[capsules.segments]] for of_side in OF_SIDE]
    if not all(map(len, halves_of)):
        return np.zeros(3), np.zeros(3)
    left, right = (each.mean(axis=0) for each in halves_of)
    return 0.5 * (left + right), normalised(left - right)


def _folded(places: Array, middle: Array, left: Array) -> tuple[Array, Array]:
    """Return places, (n, 3), in `OBLIQUE` axes, with the right half of the body mirrored onto the left, and how far
    each is to the left, (n,) [file units]. An order by these coordinates does not depend on the order of the mesh, and
    is the same on the left and on the right of a symmetric mesh.
    """
    off = (places - middle) @ left
    return (places + (np.abs(off) - off)[:, None] * left) @ OBLIQUE, off


def _spread(
    mesh: SkinnedMesh, skeleton: Skeleton, of_joint: Numbers, capsules: Capsules, folded: Array, sides: Array
) -> tuple[Numbers, Numbers, Array, Numbers]:
    """The triangles of points that stand for equal shares of each segment's surface, (points,), as indices counted from
    1, negative if the normal leads into the body; the indices of points within the left or right half of their segment;
    the radii of discs of the area that a point stands for; and the segments of points. `folded` and `sides` are those
    of `_folded`.
    """
    corners = mesh.vertices[mesh.triangles]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas, middles = 0.5 * lengths(normals), corners.mean(axis=1)
    folded_middles, of_left = folded[mesh.triangles].mean(axis=1), sides[mesh.triangles].mean(axis=1) >= 0.0
    owners = mesh.owners(of_joint, mesh.triangles)
    none, slack = np.zeros(0, np.intp), SAME_PLACE * extent(np.ptp(mesh.vertices, axis=0))
    found = [(none, none, np.zeros(0), none)]
    for segment, name in enumerate(SEGMENTS):
        own = capsules[capsules.segments == segment]
        on = np.flatnonzero((owners == segment) & (areas > 0.0))
        if len(on) and len(own):
            out = middles[on] - _nearest_on(own.ends + skeleton.rest_positions[own.joints, None], middles[on])
            outwards = (normals[on] * out).sum(axis=1)
            outwards = np.where(np.abs(outwards) < slack * areas[on], 0.0, np.sign(outwards))
            mostly = areas[on] @ outwards >= 0.0
            on = on[outwards >= 0.0 if mostly else outwards <= 0.0]  # others are back faces of cloth, or skin beneath
            points = next((count for part, count in POINTS.items() if name.endswith(part)), OTHER_POINTS)
            for half in (on[of_left[on]], on[~of_left[on]]):
                area = areas[half].sum()
                if count := round(points * area / areas[on].sum()):
                    chosen = (1 if mostly else -1) * (_evenly_chosen(half, folded_middles, areas, count) + 1)
                    radius = np.sqrt(area / (np.pi * count))
                    found.append((chosen, np.arange(count), np.full(count, radius), np.full(count, segment)))
    triangles, numbers, radii, segments = map(np.concatenate, zip(*found, strict=True))
    return triangles, numbers, radii, segments


def _evenly_chosen(triangles: Numbers, middles: Array, areas: Array, count: int) -> Numbers:
    """Return `count` of some triangles at equal steps of area, in an order in which neighbours follow each other;
    `middles` and `areas` are those of all triangles.
    """
    in_line = triangles[KDTree(middles[triangles], leafsize=1).indices]
    steps = np.cumsum(areas[in_line])
    return np.asarray(in_line[np.searchsorted(steps, (np.arange(count) + 0.5) / count * steps[-1])])


def _shares(triangles: Numbers, numbers: Numbers, are_large: Flags) -> Array:
    """(3, points), the barycentric coordinates of each point in its triangle: spread evenly, but the first three points
    of a large triangle are at its corners, which reach out farthest.
    """
    u, v = np.remainder(np.outer(STEPS, numbers) + 0.5, 1.0)
    u, v = np.where(u + v > 1.0, 1.0 - np.array([u, v]), [u, v])  # the other half of the square
    shares = np.array([1.0 - u - v, u, v])
    _, first, of_triangle = np.unique(triangles, return_index=True, return_inverse=True)
    rank = np.arange(len(triangles)) - first[of_triangle]
    at_corner = np.flatnonzero(are_large & (rank < 3))
    shares[:, at_corner] = (1.0 - AT_CORNER) / 2.0
    shares[rank[at_corner], at_corner] = AT_CORNER
    return shares


def _by_neighbours(places: Array, sides: Array, segments: Numbers) -> list[Numbers]:
    """Points in runs of neighbours, one segment after the other, and alike on the left and on the right; `places` and
    `sides` are those of `_folded`.
    """
    halves = 2 * segments + (sides < 0.0)
    groups = [np.flatnonzero(halves == half) for half in np.unique(halves)]
    return [run for group in groups for run in bisected(places, group, RUN)]


def _runs(places: Bound, dipoles: Array, first: Numbers, segments: Numbers) -> Runs:
    """The runs of points that begin at the indices `first`; `places` and `segments`, (points,), are those of the points
    in order, `dipoles`, (points, 3), their normals times areas.

    A point is the sum of w q over joints, with weights w and places q that move with one joint each. The centre c of a
    run is the sum of w' q' with the means w' and q', so the offset of a point from it is the sum of w (q - q') +
    (w - w') (q' - c).
    """
    bounds, joints, means, radii, spread, sums = [0], [], [], [], [], [np.zeros((0, 3))]
    for begin, end in pairwise(first):
        rows, count = slice(places.first[begin], places.first[end]), np.diff(places.first[begin : end + 1])
        own, column = np.unique(places.joints[rows], return_inverse=True)
        b = np.zeros((end - begin, len(own), 4))
        b[np.repeat(np.arange(end - begin), count), column] = places.b[rows]
        mean = b.mean(axis=0)
        shares = b[..., 3:] / mean[:, 3:]
        radii.append(lengths(b[..., :3] - shares * mean[:, :3]).sum(axis=1).max())
        spread.append(np.abs(shares - 1.0).max(axis=(0, 2)))
        means.append(mean)
        sums.append(b[..., 3].T @ dipoles[begin:end])
        joints.append(own)
        bounds.append(bounds[-1] + len(own))
    middles = Bound(np.array(bounds), np.concatenate([first[:0], *joints]), np.concatenate([np.zeros((0, 4)), *means]))
    more = np.concatenate([np.zeros(0), *spread])
    of_segment = np.searchsorted(segments[first[:-1]], np.arange(len(SEGMENTS) + 1))
    more = np.where(more < SAME_SHARE, 0.0, more)
    return Runs(first, of_segment, middles, np.array(radii), np.concatenate(sums), more)


def _nearest_on(ends: Array, points: Array) -> Array:
    """(points, 3), the nearest places to points, (points, 3), on axes with ends, (axes, 2, 3)."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    t = np.clip(((points[:, None] - start) * along).sum(axis=2) / square, 0.0, 1.0)
    feet = start + t[..., None] * along
    return np.asarray(feet[np.arange(len(points)), lengths(points[:, None] - feet).argmin(axis=1)])


def _bound(mesh: SkinnedMesh, skeleton: Skeleton) -> csr_array:
    """(vertices, 4 joints), the binding of vertices: for each joint the vertex's offset from it in the rest pose, and
    1, times its weight.
    """
    off = mesh.vertices[:, None] - skeleton.rest_positions[mesh.joints]
    values = mesh.weights[..., None] * np.concatenate([off, np.ones((*mesh.joints.shape, 1))], axis=2)
    columns = 4 * mesh.joints[..., None] + np.arange(4)
    rows = np.broadcast_to(np.arange(len(mesh.vertices))[:, None, None], columns.shape)
    return csr_array((values.ravel(), (rows.ravel(), columns.ravel())), (len(mesh.vertices), 4 * len(skeleton)))


def _rows(matrix: csr_array) -> Bound:
    """The rows of a matrix, (vectors, 4 joints), as vectors that are bound to joints."""
    blocks = matrix.tobsr((1, 4))
    return Bound(blocks.indptr.astype(np.intp), blocks.indices.astype(np.intp), blocks.data[:, 0].copy())
