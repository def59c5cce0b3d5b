"""Trees of joints, given by the parent of each, (joints,), -1 for the root, with parents before children.

Lengths are of the bone from its parent to each joint, (joints,). Sums along a path begin at the joint that it is asked
from, so that both ways of computing them give the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Joints = NDArray[np.intp]
Number = TypeVar("Number", bound=np.generic)


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


def all_paths(parents: Joints, order: Sequence[int], lengths: Array) -> Array:
    """Return the lengths of all paths, (joints, joints): a row is `paths_from` a joint. `order` is depth first."""
    places, above, ends = _depth_first(parents, order)
    own, to = lengths[places], np.zeros((len(places),) * 2)  # to[a, b] leads from place b to place a
    for place in range(len(places) - 1, 0, -1):
        below = slice(place, ends[place])
        to[above[place], below] = to[place, below] + own[place]
    for place in range(1, len(places)):
        for others in (slice(place), slice(ends[place], None)):
            to[place, others] = to[above[place], others] + own[place]
    return _by_joint(to.T, places)


def all_meets(parents: Joints, order: Sequence[int]) -> Joints:
    """Return the lowest common ancestors of all pairs of joints, (joints, joints). `order` is depth first."""
    places, above, _ = _depth_first(parents, order)
    meets = np.zeros((len(places),) * 2, np.intp)
    for place, upper in enumerate(above):
        if place:
            meets[place, :upper] = meets[upper, :upper]  # what is between a joint and its child is below the joint
            meets[place, upper:place] = upper
        meets[place, place] = place
    return _by_joint(places[np.maximum(meets, meets.T)], places)


def _by_joint(values: NDArray[Number], places: Joints) -> NDArray[Number]:
    """Values of pairs of places, (joints, joints), as those of pairs of the joints at these places."""
    by_joint = np.empty(values.shape, values.dtype)
    by_joint[np.ix_(places, places)] = values
    return by_joint


def _depth_first(parents: Joints, order: Sequence[int]) -> tuple[Joints, list[int], list[int]]:
    """The joint at each place of a depth-first order, the place of its parent, and that after its last descendant."""
    places = np.array(order, np.intp)
    place_of = np.empty(len(places) + 1, np.intp)
    place_of[places], place_of[-1] = np.arange(len(places)), -1
    above, ends = place_of[parents[places]].tolist(), list(range(1, len(places) + 1))
    for place in range(len(places) - 1, 0, -1):
        ends[above[place]] = max(ends[above[place]], ends[place])
    return places, above, ends


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
