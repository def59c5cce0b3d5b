"""The Gauss-Newton curvature of springs with respect to a pose. Compiled.

The curvature H is the metric in which the spectral gradient method looks for its direction: the energy is nearly round
there, so that few iterations suffice. With G, the stiffness of springs between what is below bones (`springs_below`),
it is M G M^T, where M turns the force on all that is below a bone into a moment of its part.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.solve.articulation import Articulation, Scratch, to_rotation_vector
from distretarget.solve.springs import Springs
from distretarget.solve.springs_below import bones_on_the_way, couples, nodes_of, stiffness_below

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

LEAST_CURVATURE = 0.01  # of any direction, in the metric alone: so no step turns a part right round


@inlined(fastmath=True)
def active_curvature(v: Array, body: Articulation, scratch: Scratch, springs: Springs) -> tuple[Numbers, Array]:
    """The numbers of the active parts at the pose `v`, and their curvature, (3 active, 3 active), of which the lower
    triangle is not made; `scratch` has the posed bones.

    A part is active if a spring acts on it; the last one is the root's place. All others only have their stiffness, so
    that they keep the copy's rotation and are not unknowns. Parts come in the order in which few zeros are lost when
    the curvature is factorised: those furthest from the root first.
    """
    way, is_end = bones_on_the_way(springs, body)
    active = _active(way, body, scratch)
    first = nodes_of(way, is_end, body)
    G = stiffness_below(springs, way, first, body)
    M = _moment_matrices(way, v, body, scratch)
    rows = _rows(way, active, body)
    H = np.zeros((3 * len(active), 3 * len(active)))
    for m in range(len(G)):
        for n in range(m, len(G)):
            if couples(G[m, n]):
                _add_nodes(G[m, n], range(first[m], first[m + 1]), range(first[n], first[n + 1]), M, rows, H)
    for r in range(len(H)):
        H[r, r] += max(body.stiffness[active[r // 3]], LEAST_CURVATURE)
    return active, H


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
