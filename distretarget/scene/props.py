"""Props that performers touch, hold or sit on. In each frame, a similarity takes a prop and the world around it to the
world of the target. The surface of a prop is that of its OBJ file, its faces or, without any, its vertices; any other
prop has the lines of its bones. Faces that enclose a volume have an inside and an outside, others are thin sheets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import NoneType
from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from distretarget.checks import check_kind, check_number
from distretarget.errors import MotionError, SettingsError
from distretarget.motion import Motion, check_reach
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import Array, Flags, Numbers, cross, extent, lengths, normalised
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, ROTATION_CHANNELS, SMALLEST

MOST_POINTS = 4000  # sample points on a surface, about
MOST_PARTS = 60  # into which a side of a triangle is divided
CANDIDATES = 6  # nearest samples, whose triangles are searched for the nearest point
LEAST = 1e-9  # a shorter vector has no direction [any unit of length]
PropScale = Literal["world"] | int | float


@dataclass(frozen=True, eq=False)
class PropSurface:
    """The surface of a rigid prop: triangles, or single points; a SettingsError if the arrays do not fit."""

    # (triangles, 3, 3), relative to the prop's first joint while that is not turned; a point has three equal corners
    corners: Array  # [file units]
    normals: Array  # (triangles, 3), unit vectors out of the prop; 0 for a point
    closed: Flags  # (triangles,), whether each belongs to triangles that enclose a volume

    def __post_init__(self) -> None:
        for name in ("corners", "normals", "closed"):
            check_kind(name, getattr(self, name), np.ndarray)
        count, shapes = len(self.corners), (self.corners.shape, self.normals.shape, self.closed.shape)
        if not count or shapes != ((count, 3, 3), (count, 3), (count,)):
            raise SettingsError(
                "a surface has corners (triangles, 3, 3), normals (triangles, 3), closed (triangles,); one at least"
            )

    @classmethod
    def of_mesh(cls, vertices: Array, triangles: Numbers) -> PropSurface:
        """Return the surface of triangles, (triangles, 3), or of vertices, (vertices, 3), if none has an area."""
        vertices = np.asarray(vertices, np.float64)
        size = max(float(np.ptp(vertices, axis=0).max(initial=0.0)), LEAST)
        corners = vertices[np.asarray(triangles, np.intp).reshape(-1, 3)]
        areas = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        wide = lengths(areas) > (LEAST * size) ** 2
        if not wide.any():
            points = np.unique(vertices, axis=0)
            return cls(np.repeat(points[:, None], 3, axis=1), np.zeros_like(points), np.zeros(len(points), bool))
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
            chosen, shares = np.flatnonzero(counts == count), _barycentric_grid(count)
            points.append(np.einsum("sk,tkc->tsc", shares, self.corners[chosen]).reshape(-1, 3))
            of_triangle.append(np.repeat(chosen, len(shares)))
        return KDTree(np.concatenate(points)), np.concatenate(of_triangle)

    def nearest(self, x: Array, farthest: float) -> tuple[Array, Array]:
        """Return the nearest points of the surface to x, (points, 3), and the directions out; nan beyond `farthest`."""
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
            is_tie = np.abs(distance - best) <= same  # along an edge, the triangle that faces the point
            better = np.where(is_tie, np.abs(over) > np.abs(height), distance < best)
            best[better], height[better], closed[better] = distance[better], over[better], self.closed[each][better]
            foot[better], normal[better] = place[better], self.normals[each][better]
        inward = np.where(closed & (height < 0.0), -1.0, 1.0)[:, None]
        feet, out = np.full_like(x, np.nan), np.full_like(x, np.nan)
        feet[near] = foot
        out[near] = np.where(best[:, None] > same, inward * normalised(points - foot), normal)
        return feet, out


def _nearest_on_triangles(corners: Array, normals: Array, x: Array) -> Array:
    """(points, 3), the point of each triangle, (points, 3, 3), that is nearest to its point x, (points, 3)."""
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


def _barycentric_grid(count: int) -> Array:
    """(count^2, 3), barycentric coordinates of the centres of the count^2 triangles into which one is divided."""
    up = [(3 * a + 1, 3 * b + 1) for a in range(count) for b in range(count - a)]
    down = [(3 * a + 2, 3 * b + 2) for a in range(count - 1) for b in range(count - 1 - a)]
    both = np.array(up + down, float) / (3 * count)
    return np.column_stack([both, 1.0 - both.sum(axis=1)])


def _parts(corners: Array, areas: Array, size: float) -> tuple[Flags, Flags]:
    """(triangles,) each: whether the connected part of a triangle is closed, and whether its triangles face inwards."""
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
    """Return the points on bones nearest to points x, (frames, points, 3), and the directions from there to x."""
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
    """Return the points of a prop in `motion` nearest to x, (frames, points, 3), and the directions out of it there."""
    if surface is None:
        return nearest_on_bones(motion.positions, motion.skeleton.parents, x)
    turn = Rotation.from_quat(motion.world_rotations[:, 0]).as_matrix()
    local = ((x - motion.positions[:, :1]) @ turn).reshape(-1, 3)
    feet, out = (each.reshape(x.shape) @ turn.swapaxes(1, 2) for each in surface.nearest(local, farthest))
    return feet + motion.positions[:, :1], out


@dataclass(frozen=True)
class Grip:
    """A joint that holds a prop while it is near the prop.

    Attributes:
        performer: the number of the performer, from 0.
        joint: the key of the joint in the performer's source.
    """

    performer: int
    joint: str

    def __post_init__(self) -> None:
        check_kind("performer", self.performer, int)
        check_kind("joint", self.joint, str)


@dataclass(frozen=True, eq=False, kw_only=True)
class Prop:
    """A prop in the world of the performers, who may touch its joints and surface.

    Attributes:
        name: its name.
        motion: its motion in the source; one frame for a prop that stands still.
        scale: target units per source unit: "world", the scale of the world along the floor; the number of a performer
            (an int), the scale of that performer's heights; or a factor (a float), 1.0 for a prop that keeps its size.
        held_by: the joints that hold it. The prop follows them while they are near it.
        surface: its surface, which skins of performers stay outside of; None for the bones of its skeleton.

    Raises:
        SettingsError: the scale is none of these, or another argument has the wrong type.
        MotionError: positions are too large to compute with.
    """

    name: str
    motion: Motion
    scale: PropScale = "world"
    held_by: tuple[Grip, ...] = ()
    surface: PropSurface | None = None

    def __post_init__(self) -> None:
        check_kind("name", self.name, str)
        check_kind(f"the motion of {self.name!r}", self.motion, Motion)
        check_kind(f"held_by of {self.name!r}", self.held_by, tuple, list)
        for grip in self.held_by:
            check_kind(f"a joint that holds {self.name!r}", grip, Grip)
        check_kind(f"the surface of {self.name!r}", self.surface, PropSurface, NoneType)
        if isinstance(self.scale, float):
            check_number(f"the scale of {self.name!r}", self.scale, SMALLEST, LARGEST)
        elif isinstance(self.scale, bool) or not (isinstance(self.scale, int) or str(self.scale) == "world"):
            raise SettingsError(
                f"the scale of {self.name!r} is {self.scale!r}; expected 'world', the number of a performer or a factor"
            )
        check_reach(self.motion, repr(self.name))
        if isinstance(self.scale, float):
            self.check_size(self.scale, 0.0)

    def check_size(self, scale: float, farthest: float) -> None:
        """Raise a MotionError if the prop, scaled, or its `farthest` coordinate is too large to compute with."""
        size = extent(self.motion.positions - self.motion.root_positions[:, None])
        if not max(farthest, scale * size) <= LARGEST:
            raise MotionError(
                f"{self.name!r} reaches beyond {LARGEST:g} with a scale of {scale:g}; choose a smaller scale"
            )


def prop_of(motion: Motion, joint: str) -> Motion:
    """Return the motion of a joint and all below it, such as a sword in a hand; a SkeletonError without the joint."""
    check_kind("motion", motion, Motion)
    skeleton = motion.skeleton
    root = skeleton.index(joint)
    joints = np.sort([*skeleton.subtree(root)])
    channels = [skeleton.channels[each] for each in joints]
    channels[0] = (*POSITION_CHANNELS, *(channels[0][-3:] if len(channels[0]) >= 3 else ROTATION_CHANNELS))
    parents = np.searchsorted(joints, skeleton.parents[joints])
    parents[0] = -1
    below = replace(
        skeleton,
        names=tuple(skeleton.names[each] for each in joints),
        parents=parents,
        offsets=skeleton.offsets[joints],
        channels=tuple(channels),
        end_sites=np.append(False, skeleton.end_sites[joints[1:]]),
        humanoid=(),
    )
    translations, rotations = np.array(motion.translations[:, joints]), np.array(motion.rotations[:, joints])
    translations[:, 0], rotations[:, 0] = motion.positions[:, root], motion.world_rotations_of(root)
    return Motion.of_translations(below, translations, rotations, motion.frame_time_text)


@dataclass(frozen=True, eq=False)
class PropResult:
    """A prop among the retargeted performers.

    Attributes:
        name: its name.
        motion: its motion in the target's world, scaled.
        source: its motion in the source, in the target's axes.
        scale: the size in `motion` over that in `source`.
        copy: its motion with the rotation copies of the performers.
    """

    name: str
    motion: Motion
    source: Motion
    scale: float
    copy: Motion


@dataclass(frozen=True, eq=False)
class Placement:
    """The similarity that takes a prop, and the source's world around it, to the target's world in each frame."""

    centre: Array  # (frames, 3), the centre of the prop in the source [source file units]
    place: Array  # (frames, 3), the centre in the target's world [target file units]
    turn: Array  # (frames, 3, 3), the rotation about the centre
    scale: float  # target units per source unit

    def __call__(self, points: Array) -> Array:
        """Take points of the source's world, (frames, points, 3), to the target's."""
        around = self.scale * (points - self.centre[:, None])
        return np.asarray(self.place[:, None] + around @ self.turn.swapaxes(1, 2))

    def moved(self, motion: Motion) -> Motion:
        """The motion of the prop in the target's world."""
        translations, rotations = self.scale * motion.translations, np.array(motion.rotations)
        translations[:, 0] = self(motion.positions[:, :1])[:, 0]
        rotations[:, 0] = (Rotation.from_matrix(self.turn) * Rotation.from_quat(rotations[:, 0])).as_quat()
        skeleton = motion.skeleton.with_offsets(self.scale * motion.skeleton.offsets)
        return Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)


@dataclass(frozen=True, eq=False)
class PlacedProp:
    """A prop in the world of the performers."""

    name: str
    motion: Motion  # in the source, in the target's axes
    free: Placement  # its placement while nobody holds it
    grips: Mapping[int, tuple[int, ...]]  # the target joints that hold it, by number of the performer
    surface: PropSurface | None = None  # None for its bones
