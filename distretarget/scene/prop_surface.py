"""The surface of a prop, as far as its files show it, and the places on it that are nearest to points.

An OBJ file shows it by its faces, or without faces by its vertices; a skeleton shows the lines of its bones, such as
a staff. Faces that enclose a volume have an inside and an outside, others are thin sheets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from distretarget.checks import check_kind
from distretarget.errors import SettingsError
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import Array, Flags, Numbers, cross, lengths, normalised

MOST_POINTS = 4000  # into which faces are divided, about
MOST_PARTS = 60  # into which a side of a triangle is divided
CANDIDATES = 6  # triangles that are looked at for the nearest place
LEAST = 1e-9  # a shorter vector has no direction [any unit of length]


@dataclass(frozen=True, eq=False)
class PropSurface:
    """The surface of a rigid prop: triangles, or points that stand alone. Raises a SettingsError if the arrays do not
    fit each other, or there is no triangle.
    """

    # (triangles, 3, 3), relative to the prop's first joint while that is not turned; a point is there three times
    corners: Array  # [file units]
    normals: Array  # (triangles, 3), unit vectors out of the prop; 0 for a point
    closed: Flags  # (triangles,), whether each belongs to triangles that enclose a volume

    def __post_init__(self) -> None:
        for name in ("corners", "normals", "closed"):
            check_kind(name, getattr(self, name), np.ndarray)
        count = len(self.corners)
        shapes = self.corners.shape, self.normals.shape, self.closed.shape
        if not count or shapes != ((count, 3, 3), (count, 3), (count,)):
            raise SettingsError(
                "a surface has corners (triangles, 3, 3), normals (triangles, 3), closed (triangles,); one at least"
            )

    @classmethod
    def of_mesh(cls, vertices: Array, triangles: Numbers) -> PropSurface:
        """Return the surface of a mesh, vertices (vertices, 3) and triangles (triangles, 3), or that of its vertices if
        no triangle has an area.
        """
        vertices = np.asarray(vertices, np.float64)
        size = max(float(np.ptp(vertices, axis=0).max(initial=0.0)), LEAST)
        corners = vertices[np.asarray(triangles, np.intp).reshape(-1, 3)]
        areas = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        wide = lengths(areas) > (LEAST * size) ** 2
        if not wide.any():
            alone = np.unique(vertices, axis=0)
            return cls(np.repeat(alone[:, None], 3, axis=1), np.zeros_like(alone), np.zeros(len(alone), bool))
        corners, areas = corners[wide], areas[wide]
        closed, inwards = _parts(corners, areas, size)
        return cls(corners, normalised(np.where(inwards, -1.0, 1.0)[:, None] * areas), closed)

    @cached_property
    def _samples(self) -> tuple[KDTree, Numbers]:
        """Points all over the triangles, and the triangle of each."""
        sides = np.max([lengths(self.corners[:, k] - self.corners[:, k - 1]) for k in range(3)], axis=0)
        areas = cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        spacing = max(float(np.sqrt(lengths(areas).sum() / MOST_POINTS)), LEAST)
        counts = np.clip(np.ceil(sides / spacing), 1, MOST_PARTS).astype(int)
        points, of_triangle = [], []
        for count in np.unique(counts).tolist():
            chosen, shares = np.flatnonzero(counts == count), _shares(count)
            points.append(np.einsum("sk,tkc->tsc", shares, self.corners[chosen]).reshape(-1, 3))
            of_triangle.append(np.repeat(chosen, len(shares)))
        return KDTree(np.concatenate(points)), np.concatenate(of_triangle)

    def nearest(self, x: Array, farthest: float) -> tuple[Array, Array]:
        """Return the places on the surface nearest to points x, (points, 3), by the triangles of the `CANDIDATES`
        nearest samples, and the directions out of it there; nan where no place is nearer than `farthest`.
        """
        tree, of_triangle = self._samples
        count = min(CANDIDATES, len(of_triangle))
        distances, numbers = tree.query(x, k=count, distance_upper_bound=1.5 * farthest)
        near = np.isfinite(np.reshape(distances, (-1, count))[:, 0])
        found = np.asarray(numbers, np.intp).reshape(-1, count)[near]
        found = of_triangle[np.where(found < len(of_triangle), found, found[:, :1])]
        points, same = x[near], 1e-6 * farthest
        best, height = np.full(len(points), np.inf), np.zeros(len(points))
        foot, normal, closed = points.copy(), np.zeros_like(points), np.zeros(len(points), bool)
        for each in found.T:
            place = _nearest_on_triangles(self.corners[each], self.normals[each], points)
            distance, over = lengths(points - place), ((points - place) * self.normals[each]).sum(axis=1)
            alike = np.abs(distance - best) <= same  # along an edge, the triangle that faces the point
            better = np.where(alike, np.abs(over) > np.abs(height), distance < best)
            best[better], height[better], closed[better] = distance[better], over[better], self.closed[each][better]
            foot[better], normal[better] = place[better], self.normals[each][better]
        inward = np.where(closed & (height < 0.0), -1.0, 1.0)[:, None]
        feet, ways = np.full_like(x, np.nan), np.full_like(x, np.nan)
        feet[near] = foot
        ways[near] = np.where(best[:, None] > same, inward * normalised(points - foot), normal)
        return feet, ways


def _nearest_on_triangles(corners: Array, normals: Array, x: Array) -> Array:
    """(points, 3), the place on each triangle, (points, 3, 3), that is nearest to each point x, (points, 3)."""
    a = corners[:, 0]
    above = x - ((x - a) * normals).sum(axis=1)[:, None] * normals
    inside = np.asarray(normals.any(axis=1), bool)
    best, place = np.full(len(x), np.inf), above
    for k in range(3):
        start, side = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        turned = cross(side, above - start)
        inside &= (turned * cross(side, corners[:, (k + 2) % 3] - start)).sum(axis=1) >= 0.0
        along = ((x - start) * side).sum(axis=1) / np.maximum((side**2).sum(axis=1), LEAST**2)
        on_side = start + np.clip(along, 0.0, 1.0)[:, None] * side
        distance = lengths(x - on_side)
        place = np.where((distance < best)[:, None], on_side, place)
        best = np.minimum(best, distance)
    return np.asarray(np.where(inside[:, None], above, place))


def _shares(count: int) -> Array:
    """Barycentric coordinates of the middles of the triangles that divide one into count^2."""
    up = [(3 * a + 1, 3 * b + 1) for a in range(count) for b in range(count - a)]
    down = [(3 * a + 2, 3 * b + 2) for a in range(count - 1) for b in range(count - 1 - a)]
    both = np.array(up + down, float) / (3 * count)
    return np.column_stack([both, 1.0 - both.sum(axis=1)])


def _parts(corners: Array, areas: Array, size: float) -> tuple[Flags, Flags]:
    """(triangles,) each, whether the connected part that a triangle belongs to is closed, every edge being that of two
    triangles that face the same way, and whether its triangles face inwards.
    """
    keys = np.round(corners.reshape(-1, 3) / (1e-6 * size)).astype(np.int64)
    joined = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1, 3)
    edges = np.concatenate([joined[:, [0, 1]], joined[:, [1, 2]], joined[:, [2, 0]]])
    count = int(joined.max()) + 1
    part = connected_components(coo_array((np.ones(len(edges)), edges.T), shape=(count, count)), directed=False)[1]
    both = np.concatenate([edges, edges[:, ::-1]])  # each twice, once from either triangle
    distinct, uses = np.unique(both, axis=0, return_counts=True)
    forth = np.unique(edges, axis=0, return_counts=True)
    is_open = np.zeros(count, bool)
    is_open[part[distinct[uses != 2, 0]]] = True
    is_open[part[forth[0][forth[1] != 1, 0]]] = True
    of_triangle = part[joined[:, 0]]
    volumes = np.bincount(of_triangle, ((corners[:, 0] - corners[0, 0]) * areas).sum(axis=1), count)
    return ~is_open[of_triangle], volumes[of_triangle] < 0.0


def nearest_on_bones(positions: Array, parents: Numbers, x: Array) -> tuple[Array, Array]:
    """Return the places on bones nearest to points x, (frames, points, 3), and the directions from there to them; the
    joints are at `positions`, (frames, joints, 3), the first without a parent.
    """
    feet, out = np.empty_like(x), np.empty_like(x)
    for block in blocks_of(len(x)):
        a, points = positions[block][:, parents[1:]], x[block]
        bones = positions[block][:, 1:] - a
        square = np.maximum((bones**2).sum(axis=-1), LEAST**2)
        best = np.full(points.shape[:2], np.inf)
        for bone in range(bones.shape[1]):
            along = ((points - a[:, None, bone]) * bones[:, None, bone]).sum(axis=-1) / square[:, None, bone]
            foot = a[:, None, bone] + np.clip(along, 0.0, 1.0)[..., None] * bones[:, None, bone]
            away = lengths(points - foot)
            nearer = away < best
            best = np.where(nearer, away, best)
            feet[block] = np.where(nearer[..., None], foot, feet[block])
        out[block] = normalised(points - feet[block])
    return feet, out


def nearest_places(surface: PropSurface | None, motion: Motion, x: Array, farthest: float) -> tuple[Array, Array]:
    """Return the places on a prop that moves like `motion` nearest to points x, (frames, points, 3), and the directions
    out of it there: on its surface, where nan is farther than `farthest`, or without one on its bones.
    """
    if surface is None:
        return nearest_on_bones(motion.positions, motion.skeleton.parents, x)
    turn = Rotation.from_quat(motion.world_rotations[:, 0]).as_matrix()
    local = ((x - motion.positions[:, :1]) @ turn).reshape(-1, 3)
    feet, out = (each.reshape(x.shape) @ turn.swapaxes(1, 2) for each in surface.nearest(local, farthest))
    return feet + motion.positions[:, :1], out
