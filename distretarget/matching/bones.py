"""Corresponding bones of two matched bodies, and whether their rest poses can be compared."""

from __future__ import annotations

from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.vectors import normalised
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

BUILD_ANGLE = np.radians(55)  # rest directions of bones that differ by less show another build, not another pose [rad]


def driven_below(target: Skeleton, drivers: NDArray[np.intp], x: Array, y: Array) -> list[list[int]]:
    """Return for each target joint the nearest joints below it that have a driver, if it has one itself.

    Left out are joints that coincide with it on either body, whose joints are at `x` and `y`, (joints, 3).
    """
    below: list[list[int]] = [[] for _ in drivers]
    for joint in range(1, len(below)):
        if drivers[joint] < 0:
            continue
        above = int(target.parents[joint])
        while above >= 0 and drivers[above] < 0:
            above = int(target.parents[above])
        if above >= 0 and (y[joint] != y[above]).any() and (x[drivers[joint]] != x[drivers[above]]).any():
            below[above].append(joint)
    return below


def bone_directions(drivers: NDArray[np.intp], x: Array, y: Array, below: list[list[int]]) -> list[tuple[Array, Array]]:
    """Return the directions from each target joint to joints `below` it, (joints below, 3), on the source and the
    target, whose joints are at `x` and `y`, (joints, 3).
    """
    starts = np.array([joint for joint, ends in enumerate(below) for _ in ends], np.intp)
    ends = np.array([*chain.from_iterable(below)], np.intp)
    a, b = normalised(x[drivers[ends]] - x[drivers[starts]]), normalised(y[ends] - y[starts])
    edges = np.cumsum([0, *map(len, below)]).tolist()
    return [(a[first:last], b[first:last]) for first, last in pairwise(edges)]


def rest_poses_alike(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> bool:
    """Return whether all bones of both rest poses point about the same way, so that they can be compared."""
    x, y = source.rest_positions, target.rest_positions
    directions = bone_directions(drivers, x, y, driven_below(target, drivers, x, y))
    return all(((a * b).sum(axis=1) >= np.cos(BUILD_ANGLE)).all() for a, b in directions)
