"""Corresponding bones of two matched bodies, and whether their rest poses can be compared."""

from __future__ import annotations

from itertools import accumulate, chain, pairwise

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
    driven = (drivers >= 0).tolist()
    above: list[int] = []  # of each joint, the nearest with a driver
    for parent in target.parents.tolist():
        above.append(parent if parent < 0 or driven[parent] else above[parent])
    ends = np.array([joint for joint, start in enumerate(above) if start >= 0 and driven[joint]], np.intp)
    starts = np.array(above)[ends]
    apart = (y[ends] != y[starts]).any(axis=1) & (x[drivers[ends]] != x[drivers[starts]]).any(axis=1)
    below: list[list[int]] = [[] for _ in driven]
    for start, end in zip(starts[apart].tolist(), ends[apart].tolist(), strict=True):
        below[start].append(end)
    return below


def bone_directions(drivers: NDArray[np.intp], x: Array, y: Array, below: list[list[int]]) -> list[tuple[Array, Array]]:
    """Return the directions from each target joint to joints `below` it, (joints below, 3), on the source and the
    target, whose joints are at `x` and `y`, (joints, 3).
    """
    a, b = _all_directions(drivers, x, y, below)
    edges = [*accumulate(map(len, below), initial=0)]
    return [(a[first:last], b[first:last]) for first, last in pairwise(edges)]


def rest_poses_alike(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> bool:
    """Return whether all bones of both rest poses point about the same way, so that they can be compared."""
    x, y = source.rest_positions, target.rest_positions
    a, b = _all_directions(drivers, x, y, driven_below(target, drivers, x, y))
    return bool(((a * b).sum(axis=1) >= np.cos(BUILD_ANGLE)).all())


def _all_directions(drivers: NDArray[np.intp], x: Array, y: Array, below: list[list[int]]) -> tuple[Array, Array]:
    """The same directions of all joints one after the other, (bones, 3)."""
    starts = np.array([joint for joint, ends in enumerate(below) for _ in ends], np.intp)
    ends = np.array([*chain.from_iterable(below)], np.intp)
    return normalised(x[drivers[ends]] - x[drivers[starts]]), normalised(y[ends] - y[starts])
