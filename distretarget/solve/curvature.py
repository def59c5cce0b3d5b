"""The Gauss-Newton curvature of springs with respect to a pose. Compiled.

The curvature H is the metric in which the spectral gradient method looks for its direction: the energy is nearly round
there, so that few iterations suffice.

A turn of a bone moves everything below it by the same vector, and the bone feels the sum of all forces below it. So
springs enter by sums over what is below: with G, (bones, bones) blocks of 3 x 3, the force on everything below one bone
when everything below another is displaced, H = M G M^T, where M turns a force into a moment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.solve.articulation import Articulation, Scratch, to_rotation_vector
from distretarget.solve.springs import NEGLIGIBLE, Springs, is_negligible

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Marks = NDArray[np.bool_]

LEAST_CURVATURE = 0.01  # of any direction, in the metric alone: so no step turns a part right round


@inlined(fastmath=True)
def active_curvature(v: Array, body: Articulation, scratch: Scratch, springs: Springs) -> tuple[Numbers, Array]:
    """The numbers of the active parts at the pose `v`, and their curvature, (3 active, 3 active), of which the lower
    triangle is not made; `scratch` has the posed bones.

    A part is active if a spring acts on it; the last one is the root's place. All others only have their stiffness, so
    that they keep the copy's rotation and are not unknowns. Parts come in the order in which few zeros are lost when
    the curvature is factorised: those furthest from the root first.
    """
    way, is_end = _way(springs, body)
    active = _active(way, body, scratch)
    first = _nodes(way, is_end, body)
    G = _stiffness_below(springs, way, first, body)
    M = _moment_matrices(way, v, body, scratch)
    rows = _rows(way, active, body)
    H = np.zeros((3 * len(active), 3 * len(active)))
    for m in range(len(G)):
        for n in range(m, len(G)):
            if _couples(G[m, n]):
                _add_nodes(G[m, n], range(first[m], first[m + 1]), range(first[n], first[n + 1]), M, rows, H)
    for r in range(len(H)):
        H[r, r] += max(body.stiffness[active[r // 3]], LEAST_CURVATURE)
    return active, H


@inlined()
def _way(springs: Springs, body: Articulation) -> tuple[Numbers, Marks]:
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
def _active(way: Numbers, body: Articulation, scratch: Scratch) -> Numbers:
    """The parts that carry a bone of `way`, from the last to the first, and the root's place if `way` has the root."""
    is_active = np.zeros(len(body.stiffness), np.bool_)
    count = 0
    for joint in way:
        part = _part_of(joint, body)
        if not is_active[part] and (joint == 0 or _has_length(scratch.bones[joint])):
            is_active[part] = True
            count += 1
    active, place = np.empty(count, np.intp), 0
    for part in range(len(is_active) - 2, -1, -1):
        if is_active[part]:
            active[place] = part
            place += 1
    if is_active[-1]:
        active[place] = len(is_active) - 1
    return active


@inlined()
def _part_of(joint: int, body: Articulation) -> int:
    """The part that carries the bone to a joint, which is the root's place for the root."""
    return body.parts[body.parents[joint]] if joint > 0 else len(body.stiffness) - 1


@inlined()
def _has_length(bone: Array) -> bool:
    return bool(bone[0] != 0.0 or bone[1] != 0.0 or bone[2] != 0.0)


@inlined()
def _rows(way: Numbers, active: Numbers, body: Articulation) -> Numbers:
    """The place in `active` of the part that carries each bone of `way`; -1 if it is not active."""
    place = np.full(len(body.stiffness), -1)
    for p, part in enumerate(active):
        place[part] = p
    rows = np.empty(len(way), np.intp)
    for i, joint in enumerate(way):
        rows[i] = place[_part_of(joint, body)]
    return rows


@inlined()
def _nodes(way: Numbers, is_end: Marks, body: Articulation) -> Numbers:
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
def _stiffness_below(springs: Springs, way: Numbers, first: Numbers, body: Articulation) -> Array:
    """G, (nodes, nodes, 3, 3), made where the first node is not after the second: the force on everything below the
    first when everything below the second is displaced.

    A bone that is not on the way leaves all springs of what is below it as they are, which adds nothing to others.
    """
    count = len(first) - 1
    place = np.full(len(body.parents), -1)
    for n in range(count):
        for i in range(first[n], first[n + 1]):
            place[way[i]] = n
    G, A = np.zeros((count, count, 3, 3)), springs.A
    for s in range(len(springs.a)):
        if is_negligible(A, s):
            continue
        a, b = place[springs.a[s]], place[springs.b[s]] if springs.b[s] >= 0 else -1
        if a >= 0:
            _add(A[s], 1.0, G[a, a])
        if b >= 0:
            _add(A[s], 1.0, G[b, b])
        if a >= 0 and b >= 0:
            _add(A[s], -1.0, G[min(a, b), max(a, b)])
    for k in range(count):
        top = way[first[k + 1] - 1]
        p = place[body.parents[top]] if top > 0 else -1
        if p < 0:
            continue
        for j in range(k):
            _add(G[j, k], 1.0, G[j, p])
        for j in range(k + 1, p):
            _add(G[k, j].T, 1.0, G[j, p])
        _add(G[k, p], 1.0, G[p, p])
        _add(G[k, p].T, 1.0, G[p, p])
        _add(G[k, k], 1.0, G[p, p])
        _add(G[k, k], 1.0, G[k, p])
        _add_all(G[k, p + 1 :].ravel(), G[p, p + 1 :].ravel())
    return G


@inlined(fastmath=True)
def _couples(block: Array) -> bool:
    """Whether a block of G is more than rounding: a sum of stiffness matrices, or less such a sum."""
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


@inlined(fastmath=True)
def _moment_matrices(way: Numbers, v: Array, body: Articulation, scratch: Scratch) -> Array:
    """M, (bones, 3, 3): what a force below a bone does to the rotation vector of its part, J^T (bone x force) with the
    left Jacobian J of the exponential map, as in `articulation.pose_gradient`; the identity for the root's place.
    """
    M = np.zeros((len(way), 3, 3))
    for i, joint in enumerate(way):
        if joint == 0:
            for k in range(3):
                M[i, k, k] = 1.0
            continue
        x, y, z = scratch.bones[joint, 0], scratch.bones[joint, 1], scratch.bones[joint, 2]
        of_force = M[i].T
        of_force[0, 1], of_force[0, 2] = z, -y  # bone x (1, 0, 0)
        of_force[1, 0], of_force[1, 2] = -z, x
        of_force[2, 0], of_force[2, 1] = y, -x
        part = _part_of(joint, body)
        for k in range(3):
            to_rotation_vector(v[part], scratch.series[part], of_force[k])
    return M


@inlined(fastmath=True)
def _add_nodes(G, first, second, M, rows, H):  # type: ignore[no-untyped-def]
    """Add to the upper triangle of H what two nodes have in common, given their block of G and their bones."""
    for i in first:
        for j in second:
            if i <= j and rows[i] >= 0 and rows[j] >= 0:
                _add_bones(M[i], G, M[j], rows[i], rows[j], i == j, H)


@inlined(fastmath=True)
def _add_bones(M, G, N, row, column, once, H):  # type: ignore[no-untyped-def]
    """Add M G N^T, (3, 3), to the block at `row` and `column` of H, or its transpose to that at `column` and `row`, in
    the upper triangle; both to a block of the diagonal, but for a single bone.
    """
    for i in range(3):
        x = M[i, 0] * G[0, 0] + M[i, 1] * G[1, 0] + M[i, 2] * G[2, 0]
        y = M[i, 0] * G[0, 1] + M[i, 1] * G[1, 1] + M[i, 2] * G[2, 1]
        z = M[i, 0] * G[0, 2] + M[i, 1] * G[1, 2] + M[i, 2] * G[2, 2]
        for j in range(3):
            value = x * N[j, 0] + y * N[j, 1] + z * N[j, 2]
            if row <= column:
                H[3 * row + i, 3 * column + j] += value
            if row >= column and not once:
                H[3 * column + j, 3 * row + i] += value
