"""How stiffly springs hold all that is below a bone. Compiled.

A turn of a bone moves everything below it by the same vector, and the bone feels the sum of all forces below it. So
springs enter by sums over what is below bones: each takes one pass over the tree, however many springs there are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.solve.articulation import Articulation
from distretarget.solve.springs import NEGLIGIBLE, Springs, is_negligible

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Marks = NDArray[np.bool_]


@inlined()
def bones_on_the_way(springs: Springs, body: Articulation) -> tuple[Numbers, Marks]:
    """The bones whose turning moves a spring, named by their lower joints, from the last to the first, and at the end
    the root, 0, where a spring is tied to the world; and which joints are ends of springs, (joints,).

    The bones that move a spring between two joints are those on the path between them.
    """
    ends, is_end = np.zeros(len(body.parents), np.intp), np.zeros(len(body.parents), np.bool_)
    for s in range(len(springs.a)):
        if is_negligible(springs.A, s):
            continue
        a, b = springs.a[s], springs.b[s]
        ends[a] += 1
        is_end[a] = True
        if b >= 0:
            ends[b] += 1
            is_end[b] = True
            ends[body.meets[a, b]] -= 2
    count = 0
    for joint in range(len(ends) - 1, -1, -1):  # then `ends` has the springs with one end at or below the joint
        if joint > 0:
            ends[body.parents[joint]] += ends[joint]
        count += ends[joint] > 0
    way, i = np.empty(count, np.intp), 0
    for joint in range(len(ends) - 1, -1, -1):
        if ends[joint] > 0:
            way[i] = joint
            i += 1
    return way, is_end


@inlined()
def nodes_of(way: Numbers, is_end: Marks, body: Articulation) -> Numbers:
    """Where each node begins in `way`, and where the last one ends, (nodes + 1,).

    A node is a run of bones, each the parent of the one before, with no end of a spring and no branch between them.
    """
    children = np.zeros(len(body.parents), np.intp)
    for joint in way:
        if joint > 0:
            children[body.parents[joint]] += 1
    first, count = np.empty(len(way) + 1, np.intp), 0
    for i, joint in enumerate(way):
        if i == 0 or body.parents[way[i - 1]] != joint or children[joint] > 1 or is_end[joint]:
            first[count] = i
            count += 1
    first[count] = len(way)
    return first[: count + 1]


@inlined(fastmath=True)
def stiffness_below(springs: Springs, way: Numbers, first: Numbers, body: Articulation) -> Array:
    """G, (nodes, nodes, 3, 3), made where the first node is not after the second: the force on everything below the
    first when everything below the second is displaced.

    A bone that is not on the way leaves all springs of what is below it as they are, which adds nothing to others.
    """
    node = np.full(len(body.parents), -1)
    for n in range(len(first) - 1):
        for i in range(first[n], first[n + 1]):
            node[way[i]] = n
    G = _stiffness_of_ends(springs, node, len(first) - 1)
    for n in range(len(G)):
        top = way[first[n + 1] - 1]
        above = node[body.parents[top]] if top > 0 else -1
        if above >= 0:
            _add_to_above(G, n, above)
    return G


@inlined(fastmath=True)
def _stiffness_of_ends(springs: Springs, node: Numbers, count: int) -> Array:
    """The force on the ends of springs when such ends are displaced, (count, count, 3, 3), by the nodes they are at."""
    G, A = np.zeros((count, count, 3, 3)), springs.A
    for s in range(len(springs.a)):
        if is_negligible(A, s):
            continue
        a, b = node[springs.a[s]], node[springs.b[s]] if springs.b[s] >= 0 else -1
        if a >= 0:
            _add(A[s], 1.0, G[a, a])
        if b >= 0:
            _add(A[s], 1.0, G[b, b])
        if a >= 0 and b >= 0:
            _add(A[s], -1.0, G[min(a, b), max(a, b)])
    return G


@inlined(fastmath=True)
def _add_to_above(G: Array, n: int, above: int) -> None:
    """Add the row and the column of node n to those of the node above it: what is below the one is below the other."""
    for other in range(n):
        _add(G[other, n], 1.0, G[other, above])
    for other in range(n + 1, above):
        _add(G[n, other].T, 1.0, G[other, above])
    _add(G[n, above], 1.0, G[above, above])
    _add(G[n, above].T, 1.0, G[above, above])
    _add(G[n, n], 1.0, G[above, above])
    _add(G[n, n], 1.0, G[n, above])
    _add_all(G[n, above + 1 :].ravel(), G[above, above + 1 :].ravel())


@inlined(fastmath=True)
def couples(block: Array) -> bool:
    """Whether a block of G is more than rounding: a sum of stiffness matrices, or minus such a sum."""
    return bool(abs(block[0, 0] + block[1, 1] + block[2, 2]) >= NEGLIGIBLE)


@inlined(fastmath=True)
def _add(block: Array, sign: float, to: Array) -> None:
    for i in range(3):
        for j in range(3):
            to[i, j] += sign * block[i, j]


@inlined(fastmath=True)
def _add_all(values: Array, to: Array) -> None:
    for i in range(len(to)):
        to[i] += values[i]
