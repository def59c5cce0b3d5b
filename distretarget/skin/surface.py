"""The surface of capsules as triangles, to be looked at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.vectors import cross, normalised

Array = NDArray[np.float64]

RINGS, AROUND = 5, 16  # of each round end, its pole included, and points of each ring


def surface_of(ends: Array, radii: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the points, (points, 3), and triangles, (triangles, 3), of the surface of a tapered capsule, given by the
    ends of its axis, (2, 3), and the radius at each, (2,).
    """
    bone = ends[1] - ends[0]
    along = normalised(bone) if bone.any() else np.array([0.0, 1.0, 0.0])
    side = normalised(cross(along, np.eye(3)[np.abs(along).argmin()]))
    turns = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)[:, None]
    circle = np.cos(turns) * side + np.sin(turns) * cross(along, side)
    tilts = np.linspace(0.0, 0.5 * np.pi, RINGS)
    rings = [(0, -tilt) for tilt in tilts[::-1]] + [(1, tilt) for tilt in tilts]
    points = [ends[end] + radii[end] * (np.sin(tilt) * along + np.cos(tilt) * circle) for end, tilt in rings]
    grid = np.arange(2 * RINGS * AROUND).reshape(2 * RINGS, AROUND)
    a, c = grid[:-1], grid[1:]
    b, d = np.roll(a, -1, axis=1), np.roll(c, -1, axis=1)
    triangles = [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (b, d, c))]
    return np.concatenate(points), np.concatenate(triangles)
