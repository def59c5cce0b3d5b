"""The Gauss-Newton curvature of springs with respect to a pose.

The curvature H is the metric of the spectral gradient method: a preconditioner in which the energy is nearly round, so
that few iterations suffice. H = M G M^T, with G, the stiffness between subtrees (`springs.write_stiffness_below`), and
M, which turns the force on the subtree of a bone into a torque on the part that carries the bone. Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.articulation import Articulation, Scratch, to_rotation_vector
from distretarget.ik.springs import Below, Springs, couples, write_nodes, write_stiffness_below
from distretarget.numerics.compiled import inlined
from distretarget.numerics.loops import clear, indices

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@inlined(fastmath=True)
def factorise(H: Array, size: int) -> None:
    """Replace the upper triangle of the first `size` rows and columns of H, a multiple of 3, by that of its Cholesky
    factor U, U^T U = H; the diagonal gets the reciprocals of that of U.
    """
    for first in range(0, size, 3):
        for above in range(0, first, 3):
            if not _is_zero(H, above, first):
                for i in range(first, first + 3):
                    _eliminate(H, i, above, size)
        for i in range(first, first + 3):
            for k in range(first, i):
                factor = H[k, i]
                for j in indices(i, size):
                    H[i, j] -= factor * H[k, j]
            factor = 1.0 / np.sqrt(H[i, i])
            for j in indices(i, size):
                H[i, j] *= factor
            H[i, i] = factor


@inlined()
def _is_zero(H: Array, row: int, column: int) -> bool:
    """Whether the block of H at a row and a column is zero."""
    for i in range(row, row + 3):
        for j in range(column, column + 3):
            if H[i, j] != 0.0:
                return False
    return True


@inlined(fastmath=True)
def _eliminate(H: Array, i: int, above: int, size: int) -> None:
    """Subtract the contribution of the three finished rows from `above` on from row i."""
    a, b, c = H[above, i], H[above + 1, i], H[above + 2, i]
    for j in indices(i, size):
        H[i, j] -= a * H[above, j] + b * H[above + 1, j] + c * H[above + 2, j]


@inlined(fastmath=True)
def solve_factored(U: Array, active: Numbers, gradient: Array, d: Array, flat: Array) -> None:
    """Write d = H^-1 gradient of the active parts, and zero of the others; U is what `factorise` made of H.

    `flat`, (all rows of U,), is scratch.
    """
    size = 3 * len(active)
    for i in range(size):
        flat[i] = gradient[active[i // 3], i % 3]
    for i in range(0, size, 3):
        x = flat[i] * U[i, i]
        y = (flat[i + 1] - U[i, i + 1] * x) * U[i + 1, i + 1]
        z = (flat[i + 2] - U[i, i + 2] * x - U[i + 1, i + 2] * y) * U[i + 2, i + 2]
        flat[i], flat[i + 1], flat[i + 2] = x, y, z
        for j in indices(i + 3, size):
            flat[j] -= x * U[i, j] + y * U[i + 1, j] + z * U[i + 2, j]
    clear(d)
    for i in range(size - 3, -1, -3):
        x, y, z = 0.0, 0.0, 0.0
        for j in indices(i + 3, size):
            x += U[i, j] * flat[j]
            y += U[i + 1, j] * flat[j]
            z += U[i + 2, j] * flat[j]
        z = (flat[i + 2] - z) * U[i + 2, i + 2]
        y = (flat[i + 1] - y - U[i + 1, i + 2] * z) * U[i + 1, i + 1]
        x = (flat[i] - x - U[i, i + 1] * y - U[i, i + 2] * z) * U[i, i]
        flat[i], flat[i + 1], flat[i + 2] = x, y, z
        part = active[i // 3]
        d[part, 0], d[part, 1], d[part, 2] = x, y, z


LEAST_CURVATURE = 0.01  # of any direction, in the metric alone: so no step turns a part right round


class Curvature(NamedTuple):
    """Work arrays for the curvature, each long enough for all parts of a body.

    Attributes:
        H: (3 parts + 3, 3 parts + 3), the curvature of the active parts.
        active: (parts + 1,), their numbers.
        place: (parts + 1,), where each part is in `active`; -1 if it is not active.
        rows: (joints,), the same for the part that carries each bone of `below.way`.
        M: (joints, 3, 3), the moment matrix of each bone of `below.way`.
        bones: (joints,), the way that H is for, then -1.
        below: what is below bones.
        flat: (3 parts + 3,), scratch for what is solved.
    """

    H: Array
    active: Numbers
    place: Numbers
    rows: Numbers
    M: Array
    bones: Numbers
    below: Below
    flat: Array

    @classmethod
    def of(cls, body: Articulation) -> Curvature:
        """Arrays for a body."""
        joints, parts, size = len(body.parents), len(body.stiffness), 3 * len(body.stiffness)
        active, place, rows, bones = (np.full(n, -1, np.intp) for n in (parts, parts, joints, joints))
        H, M, below = np.zeros((size, size)), np.zeros((joints, 3, 3)), Below.of(body)
        return cls(H, active, place, rows, M, bones, below, np.zeros(size))


@inlined()
def are_first(bones: Numbers, way: Numbers, count: int) -> bool:
    """Whether `bones` consists of the first `count` bones of `way`, followed by -1."""
    for i in range(count):
        if bones[i] != way[i]:
            return False
    return count == len(bones) or bones[count] < 0


@inlined(fastmath=True)
def write_curvature(
    bones: int, v: Array, body: Articulation, scratch: Scratch, springs: Springs, count: int, curvature: Curvature
) -> int:
    """Write the active parts at the pose `v` and the upper triangle of their curvature, (3 active, 3 active), and
    return their number. The first `count` springs depend on the first `bones` bones of `below.way`; `scratch` has the
    posed bones.

    A part is active if a spring acts on it; the last active part stands for the root's position. All others keep the
    rotation copy's rotation and are no unknowns. Parts farthest from the root come first, which keeps the Cholesky
    factor sparse.
    """
    H, below = curvature.H, curvature.below
    way = below.way[:bones]
    for i in range(len(curvature.bones)):
        curvature.bones[i] = way[i] if i < bones else -1
    nodes = write_nodes(way, body.parents, below)
    write_stiffness_below(springs, count, way, nodes, body.parents, below)
    _write_moment_matrices(way, v, body, scratch, curvature.M)
    parts = _write_active(way, body, scratch.bones, curvature)
    for r in range(3 * parts):
        clear(H[r, 3 * (r // 3) : 3 * parts])
        H[r, r] = max(body.stiffness[curvature.active[r // 3]], LEAST_CURVATURE)
    for m in range(nodes):
        for n in range(m, nodes):
            if couples(below.G[m, n]):
                _add_nodes(m, n, below.first, below.G[m, n], curvature.M, curvature.rows, H)
    return parts


@inlined()
def _write_active(way: Numbers, body: Articulation, bones: Array, curvature: Curvature) -> int:
    """Write the active parts: those that carry a bone of `way`, in descending order, and the root's position if `way`
    has the root. Write their places and the rows of bones too, and return their number.
    """
    active, place, rows = curvature.active, curvature.place, curvature.rows
    for part in range(len(place)):
        place[part] = -1
    for joint in way:
        if joint == 0 or _has_length(bones[joint]):
            place[_part_of(joint, body)] = 0
    count, parts = 0, len(place) - 1
    for part in range(parts, -1, -1):
        if part < parts and place[part] == 0:
            active[count], place[part] = part, count
            count += 1
    if place[parts] == 0:
        active[count], place[parts] = parts, count
        count += 1
    for i, joint in enumerate(way):
        rows[i] = place[_part_of(joint, body)]
    return count


@inlined()
def _part_of(joint: int, body: Articulation) -> int:
    """The part that carries the bone to a joint; for the root joint, the part that stands for the root's position."""
    return body.parts[body.parents[joint]] if joint > 0 else len(body.stiffness) - 1


@inlined()
def _has_length(bone: Array) -> bool:
    return bool(bone[0] != 0.0 or bone[1] != 0.0 or bone[2] != 0.0)


@inlined(fastmath=True)
def _write_moment_matrices(way: Numbers, v: Array, body: Articulation, scratch: Scratch, M: Array) -> None:
    """Write M, (joints, 3, 3): the torque J^T (bone x force) that a force on the subtree of each bone exerts on the
    rotation vector of the bone's part, with the left Jacobian J of the exponential map, as in
    `articulation.pose_gradient`; the identity for the root's position.
    """
    for i, joint in enumerate(way):
        clear(M[i])
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


@inlined(fastmath=True)
def _add_nodes(m: int, n: int, first: Numbers, G: Array, M: Array, rows: Numbers, H: Array) -> None:
    """Add the curvature between the bones of two nodes, with the stiffness G, (3, 3), to the upper triangle of H."""
    for i in range(first[m], first[m + 1]):
        for j in range(max(first[n], i), first[n + 1]):
            if rows[i] >= 0 and rows[j] >= 0:
                _add_bones(M[i], G, M[j], rows[i], rows[j], i == j, H)


@inlined(fastmath=True)
def _add_bones(M, G, N, row, column, once, H):  # type: ignore[no-untyped-def]
    """Add M G N^T, (3, 3), to block (`row`, `column`) of the upper triangle of H, or its transpose to block (`column`,
    `row`); on the diagonal add both, unless both bones are the same.
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
