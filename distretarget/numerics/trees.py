"""Trees of joints, given by the parent of each, (joints,), -1 for the root, with parents before children.

Lengths are of the bone from its parent to each joint, (joints,). Sums along a path begin at the joint that it is asked
from, so that both ways of computing them give the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Joints = NDArray[np.intp]


def children_of(parents: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Return the children of each joint, in ascending order."""
    children: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(joint)
    return tuple(map(tuple, children))


def depth_first_order(children: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """Return the joints depth first, children in their order."""
    order, waiting = [], [0]
    while waiting:
        order.append(joint := waiting.pop())
        waiting += reversed(children[joint])
    return tuple(order)


def paths_from(joint: int, parents: Sequence[int], lengths: Sequence[float]) -> Array:
    """Return the lengths of the paths from a joint to all joints, (joints,)."""
    paths = [-1.0] * len(parents)
    paths[joint] = 0.0
    while (parent := parents[joint]) >= 0:
        paths[parent] = paths[joint] + lengths[joint]
        joint = parent
    for below, above in enumerate(parents):
        if paths[below] < 0.0:
            paths[below] = paths[above] + lengths[below]
    return np.array(paths)


def paths_among(joints: Joints, parents: Joints, lengths: Array) -> Array:
    """Return the lengths of the paths between some joints, (some, some): a row is that of `paths_from` its joint."""
    paths = np.full((len(parents), len(joints)), -1.0)  # from the n-th of them, in column n, to those on their lines
    n, at = np.arange(len(joints)), np.asarray(joints)
    paths[at, n] = 0.0
    on_lines = np.zeros(len(parents), np.bool_)
    while len(at):
        on_lines[at] = True
        n, at = n[at > 0], at[at > 0]
        paths[parents[at], n] = paths[at, n] + lengths[at]
        at = parents[at]
    for joint in np.flatnonzero(on_lines)[1:]:
        paths[joint] = np.where(paths[joint] < 0.0, paths[parents[joint]] + lengths[joint], paths[joint])
    return np.ascontiguousarray(paths[joints].T)


def reaches(parents: Sequence[int], lengths: Sequence[float]) -> tuple[Array, Joints]:
    """Return the length of the path from each joint to the joint below it, or itself, that is farthest along the bones,
    and that joint, (joints,) each: of those equally far the one with the fewest joints between, then the first.
    """
    reach, away, farthest = [0.0] * len(parents), [0] * len(parents), list(range(len(parents)))
    for joint in range(len(parents) - 1, 0, -1):
        parent = parents[joint]
        whole, steps = lengths[joint] + reach[joint], away[joint] + 1
        if whole > reach[parent] or (whole == reach[parent] and 0 < away[parent] >= steps):
            reach[parent], away[parent], farthest[parent] = whole, steps, farthest[joint]
    return np.array(reach), np.array(farthest, np.intp)
