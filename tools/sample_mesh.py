"""Surfaces of rounded bodies, and their skin weights.

A body is an approximate signed distance function of points, (..., 3), negative inside. Centimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Body = Callable[[Array], Array]

MOST_JOINTS = 4  # influences on a point
STEP = 1e-4  # of finite differences [cm]


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of a body."""

    points: Array  # (points, 3)
    normals: Array  # (points, 3), unit vectors outwards
    triangles: NDArray[np.intp]  # (triangles, 3), counter-clockwise from outside


# ---- bodies


def ellipsoid(centre: ArrayLike, radii: ArrayLike) -> Body:
    """An ellipsoid along the axes."""
    centre, radii = np.asarray(centre, float), np.asarray(radii, float)

    def value(points: Array) -> Array:
        scaled = (points - centre) / radii
        k, g = np.linalg.norm(scaled, axis=-1), np.linalg.norm(scaled / radii, axis=-1)
        return k * (k - 1.0) / np.maximum(g, 1e-9)

    return value


def limb(start: ArrayLike, end: ArrayLike, first: float, last: float) -> Body:
    """A rounded cone between two points, with a radius at each."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    return lambda points: _to_line(points, start, end, first, last)


def _to_line(points: Array, start: Array, end: Array, first: float = 0.0, last: float = 0.0) -> Array:
    """The distance to a line between two points, less a radius that goes from `first` to `last`."""
    along = end - start
    part = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - start - part[..., None] * along, axis=-1) - first - part * (last - first)


def behind(point: ArrayLike, normal: ArrayLike) -> Body:
    """The half space behind a plane."""
    point, normal = np.asarray(point, float), np.asarray(normal, float) / np.linalg.norm(normal)
    return lambda points: (points - point) @ normal


def joined(bodies: Sequence[Body], blend: float) -> Body:
    """The union of bodies, blended over a length of about `blend`."""

    def two(a: Array, b: Array) -> Array:
        h = np.maximum(blend - np.abs(a - b), 0.0) / blend
        return np.minimum(a, b) - 0.25 * h**2 * blend

    return lambda points: reduce(two, (body(points) for body in bodies))


def cut(body: Body, other: Body, blend: float) -> Body:
    """The intersection of two bodies, with a rounded edge."""

    def value(points: Array) -> Array:
        a, b = body(points), other(points)
        h = np.maximum(blend - np.abs(a - b), 0.0) / blend
        return np.maximum(a, b) + 0.25 * h**2 * blend

    return value


def both_sides(body: Body) -> Body:
    """A body of the left side, x > 0, and its mirror image."""
    return lambda points: body(np.concatenate([np.abs(points[..., :1]), points[..., 1:]], axis=-1))


# ---- surfaces


def surface(body: Body, low: ArrayLike, high: ArrayLike, cell: float) -> Surface:
    """The surface of a body within a box, by surface nets (Gibson 1998, https://doi.org/10.1007/BFb0056277)."""
    low = np.asarray(low, float)
    counts = np.ceil((np.asarray(high, float) - low) / cell).astype(int) + 1
    corners = low + cell * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    inside = body(corners) < 0
    around = np.lib.stride_tricks.sliding_window_view(inside, (2, 2, 2))
    crossed = around.any(axis=(3, 4, 5)) & ~around.all(axis=(3, 4, 5))
    number = np.full(crossed.shape, -1)
    number[crossed] = np.arange(crossed.sum())
    points = corners[:-1, :-1, :-1][crossed] + 0.5 * cell
    for _ in range(8):
        slope = _slope(body, points)
        move = -body(points)[:, None] * slope / np.maximum((slope**2).sum(axis=1, keepdims=True), 1e-9)
        points = points + np.clip(move, -cell, cell)
    quads = np.concatenate([_quads(inside, number, axis) for axis in range(3)])
    points = _evened(points, quads, body)
    slope = _slope(body, points)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Surface(points, slope / np.linalg.norm(slope, axis=1, keepdims=True), triangles)


def symmetric(whole: Surface) -> Surface:
    """The left half of a surface, x >= 0, with the points that are next to it moved to x = 0, and its mirror image."""
    used, left = np.unique(whole.triangles[(whole.points[whole.triangles, 0] > STEP).any(axis=1)], return_inverse=True)
    off = whole.points[used, 0] > STEP
    flat = np.where(off[:, None], 1.0, [0.0, 1.0, 1.0])
    points, normals, left = flat * whole.points[used], flat * whole.normals[used], left.reshape(-1, 3)
    right = np.where(off, len(used) + np.cumsum(off) - 1, np.arange(len(used)))[left[:, ::-1]]
    points, normals = (np.concatenate([each, each[off] * (-1, 1, 1)]) for each in (points, normals))
    return Surface(points, normals / np.linalg.norm(normals, axis=1, keepdims=True), np.concatenate([left, right]))


def _quads(inside: NDArray[np.bool_], number: NDArray[np.intp], axis: int) -> NDArray[np.intp]:
    """The quadrilaterals around those edges of the grid along an axis that the surface crosses, counter-clockwise."""
    inside, number = np.moveaxis(inside, axis, 0), np.moveaxis(number, axis, 0)
    if axis == 1:  # the other two axes are x and z, which are left-handed about y
        inside, number = inside.swapaxes(1, 2), number.swapaxes(1, 2)
    before, after = inside[:-1, 1:-1, 1:-1], inside[1:, 1:-1, 1:-1]
    four = np.stack([number[:, :-1, :-1], number[:, 1:, :-1], number[:, 1:, 1:], number[:, :-1, 1:]], axis=-1)
    return np.concatenate([four[before & ~after], four[~before & after][:, ::-1]])


def _evened(points: Array, quads: NDArray[np.intp], body: Body) -> Array:
    """Points moved towards the middle of their neighbours, and back onto the surface."""
    for _ in range(6):
        points = points + 0.6 * (_mean_of_neighbours(points, quads) - points)
        for _ in range(2):
            slope = _slope(body, points)
            points = points - body(points)[:, None] * slope / (slope**2).sum(axis=1, keepdims=True)
    return points


def _mean_of_neighbours(values: Array, quads: NDArray[np.intp]) -> Array:
    """(points, n), the mean of the values of the points that share an edge with each."""
    total, count = np.zeros_like(values), np.zeros(len(values))
    for step in (-1, 1):
        np.add.at(total, quads, values[np.roll(quads, step, axis=1)])
        np.add.at(count, quads, 1.0)
    return total / count[:, None]


def _slope(body: Body, points: Array) -> Array:
    """(points, 3), the gradient."""
    steps = STEP * np.eye(3)
    return np.stack([(body(points + step) - body(points - step)) / (2 * STEP) for step in steps], axis=-1)


def normals_of(points: Array, triangles: NDArray[np.intp]) -> Array:
    """The outward unit normals of points, (points, 3): the mean of the adjacent triangles' normals by area."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    normals = np.zeros_like(points)
    np.add.at(normals, triangles, np.cross(b - a, c - a)[:, None])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


# ---- weights


def weights(points: Array, starts: Array, ends: Array, blend: float, sides: Array) -> tuple[NDArray[np.intp], Array]:
    """The joints that move each point and their weights, (points, 4): the nearest bone, and others within `blend`.
    `sides`, (joints,), is 1 for joints of points with x > 0, -1 for x < 0, and 0 for the middle.
    """
    distances = np.stack([_to_line(points, start, end) for start, end in zip(starts, ends, strict=True)], axis=1)
    distances = distances + 3.0 * np.maximum(0.35 * blend - sides * points[:, :1], 0.0) * (sides != 0)
    share = np.maximum(1.0 - (distances - distances.min(axis=1, keepdims=True)) / blend, 0.0)
    share = share**2 * (3 - 2 * share)
    joints = np.argsort(-share, axis=1, kind="stable")[:, :MOST_JOINTS]
    share = np.take_along_axis(share, joints, axis=1)
    return joints, share / share.sum(axis=1, keepdims=True)
