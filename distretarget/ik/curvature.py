"""The Gauss-Newton curvature of springs with respect to a pose.

The curvature H is the metric of the spectral gradient method, a preconditioner with which few iterations suffice.
H = M G M^T, with the stiffness G between subtrees (`springs.write_stiffness_below`), and M, which maps the force on the
subtree of a bone to a torque on the part that carries the bone. Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.ik.articulation import Articulation, Scratch, to_rotation_vector
from distretarget.ik.springs import Below, FrameSprings, couples, write_nodes, write_stiffness_below
from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import F1, F2, F3, I1, Array, Numbers


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
                for j in range(i, size):
                    H[i, j] -= factor * H[k, j]
            factor = 1.0 / np.sqrt(H[i, i])
            for j in range(i, size):
                H[i, j] *= factor
            H[i, i] = factor


@inlined(fastmath=True)
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
    for j in range(i, size):
        H[i, j] -= a * H[above, j] + b * H[above + 1, j] + c * H[above + 2, j]


@inlined(fastmath=True)
def solve_factored(U: Array, active: Numbers, gradient: Array, d: Array, flat: Array) -> None:
    """Write d = H^-1 gradient for active parts, 0 for others; U is the factor of H by `factorise`, `flat` scratch."""
    size = 3 * len(active)
    for n in range(len(active)):
        for k in range(3):
            flat[3 * n + k] = gradient[active[n], k]
    for i in range(0, size, 3):
        x = flat[i] * U[i, i]
        y = (flat[i + 1] - U[i, i + 1] * x) * U[i + 1, i + 1]
        z = (flat[i + 2] - U[i, i + 2] * x - U[i + 1, i + 2] * y) * U[i + 2, i + 2]
        flat[i], flat[i + 1], flat[i + 2] = x, y, z
        for j in range(i + 3, size):
            flat[j] -= x * U[i, j] + y * U[i + 1, j] + z * U[i + 2, j]
    for part in range(len(d)):
        d[part, 0], d[part, 1], d[part, 2] = 0.0, 0.0, 0.0
    for n in range(len(active) - 1, -1, -1):
        i = 3 * n
        x, y, z = 0.0, 0.0, 0.0
        for j in range(i + 3, size):
            x += U[i, j] * flat[j]
            y += U[i + 1, j] * flat[j]
            z += U[i + 2, j] * flat[j]
        z = (flat[i + 2] - z) * U[i + 2, i + 2]
        y = (flat[i + 1] - y - U[i + 1, i + 2] * z) * U[i + 1, i + 1]
        x = (flat[i] - x - U[i, i + 1] * y - U[i, i + 2] * z) * U[i, i]
        flat[i], flat[i + 1], flat[i + 2] = x, y, z
        part = active[n]
        d[part, 0], d[part, 1], d[part, 2] = x, y, z


LEAST_CURVATURE = 0.01  # of any direction, in the metric only, so that no step turns a part by a full turn


class Curvature(NamedTuple):
    """Work arrays for the curvature, each long enough for all parts of a body."""

    H: F2  # (3 parts + 3, 3 parts + 3), the curvature of the active parts
    active: I1  # (parts + 1,), the indices of the active parts
    place: I1  # (parts + 1,), the position of each part in `active`; -1 if it is not active
    rows: I1  # (joints,), the position in `active` of the part that carries each bone of `below.moving_bones`
    M: F3  # (joints, 3, 3), the moment matrix of each bone of `below.moving_bones`, transposed
    bones: I1  # (joints,), the moving bones for which H was computed, then -1
    below: Below  # sums over subtrees
    flat: F1  # (3 parts + 3,), scratch for the linear system

    @classmethod
    def of(cls, body: Articulation) -> Curvature:
        """Arrays for a body."""
        joints, parts, size = len(body.parents), len(body.stiffness), 3 * len(body.stiffness)
        active, place, rows, bones = (np.full(n, -1, np.intp) for n in (parts, parts, joints, joints))
        H, M, below = np.zeros((size, size)), np.zeros((joints, 3, 3)), Below.of(body)
        return cls(H, active, place, rows, M, bones, below, np.zeros(size))


@inlined(fastmath=True)
def are_first(bones: Numbers, moving: Numbers, count: int) -> bool:
    """Whether `bones` consists of the first `count` bones of `moving`, followed by -1."""
    for i in range(count):
        if bones[i] != moving[i]:
            return False
    return count == len(bones) or bones[count] < 0


@inlined()
def write_curvature(
    bones: int, v: Array, body: Articulation, scratch: Scratch, springs: FrameSprings, count: int, curvature: Curvature
) -> int:
    """Write the active parts at the pose `v` and the upper triangle of their curvature, (3 active, 3 active), and
    return their number. The first `count` springs depend on the first `bones` bones of `below.moving_bones`; `scratch`
    has the posed bones.

    A part is active if a spring acts on it; the last active part stands for the root's position. All others keep the
    rotation copy's rotation and are no unknowns. Parts farthest from the root come first, which keeps the Cholesky
    factor sparse.
    """
    H, below, moving = curvature.H, curvature.below, curvature.below.moving_bones
    for i in range(len(curvature.bones)):
        curvature.bones[i] = moving[i] if i < bones else -1
    nodes = write_nodes(bones, body.parents, below)
    write_stiffness_below(springs, count, nodes, body.parents, below)
    _write_moment_matrices(bones, moving, v, body, scratch, curvature.M)
    parts = _write_active(bones, moving, body, scratch.bones, curvature)
    for part in range(parts):
        stiffness = body.stiffness[curvature.active[part]]
        for r in range(3 * part, 3 * part + 3):
            for column in range(3 * part, 3 * parts):
                H[r, column] = 0.0
            H[r, r] = stiffness if stiffness > LEAST_CURVATURE else LEAST_CURVATURE
    for m in range(nodes):
        for n in range(m, nodes):
            if couples(below.G[m, n]):
                _add_nodes(m, n, below.first, below.G[m, n], curvature.M, curvature.rows, H)
    return parts


@inlined(fastmath=True)
def _write_active(count: int, moving: Numbers, body: Articulation, bones: Array, curvature: Curvature) -> int:
    """Write the active parts: those that carry one of the first `count` bones of `moving`, in descending order, and the
    root's position if the root is among them. Write `place` and `rows` too, and return the number of active parts.
    """
    active, place, rows = curvature.active, curvature.place, curvature.rows
    for part in range(len(place)):
        place[part] = -1
    for i in range(count):
        joint = moving[i]
        rows[i] = body.parts[body.parents[joint]] if joint > 0 else len(place) - 1
        if joint == 0 or bones[joint, 0] != 0.0 or bones[joint, 1] != 0.0 or bones[joint, 2] != 0.0:
            place[rows[i]] = 0
    parts, last = 0, len(place) - 1
    for i in range(len(place)):
        part = last - 1 - i if i < last else last
        if place[part] == 0:
            active[parts], place[part] = part, parts
            parts += 1
    for i in range(count):
        rows[i] = place[rows[i]]
    return parts


@inlined(fastmath=True)
def _write_moment_matrices(n: int, moving: Numbers, v: Array, body: Articulation, scratch: Scratch, M: Array) -> None:
    """Write M, (joints, 3, 3), for the first n bones of `moving`. Row k is the torque J^T (bone x force) that the
    k-th unit force on the subtree of a bone exerts on the rotation vector of the bone's part, with the left Jacobian J
    of the exponential map, as in `articulation.pose_gradient`; for the root's position M is the identity.
    """
    for i in range(n):
        joint, moments = moving[i], M[i]
        if joint == 0:
            for j in range(3):
                for k in range(3):
                    moments[j, k] = 1.0 if j == k else 0.0
            continue
        x, y, z = scratch.bones[joint, 0], scratch.bones[joint, 1], scratch.bones[joint, 2]
        moments[0, 0], moments[0, 1], moments[0, 2] = 0.0, z, -y  # bone x (1, 0, 0)
        moments[1, 0], moments[1, 1], moments[1, 2] = -z, 0.0, x
        moments[2, 0], moments[2, 1], moments[2, 2] = y, -x, 0.0
        part = body.parts[body.parents[joint]]
        for k in range(3):
            to_rotation_vector(v[part], scratch.series[part], moments[k])


@inlined(fastmath=True)
def _add_nodes(m: int, n: int, first: Numbers, G: Array, M: Array, rows: Numbers, H: Array) -> None:
    """Add the curvature between the bones of two nodes, with the stiffness G, (3, 3), to the upper triangle of H."""
    for i in range(first[m], first[m + 1]):
        for j in range(i if m == n else first[n], first[n + 1]):
            if rows[i] >= 0 and rows[j] >= 0:
                _add_bones(M[i], G, M[j], rows[i], rows[j], i == j, H)


@inlined(fastmath=True)
def _add_bones(M, G, N, row, column, once, H):  # type: ignore[no-untyped-def]
    """Add M^T G N, (3, 3), to block (`row`, `column`) of the upper triangle of H, or its transpose to block (`column`,
    `row`); on the diagonal add both, unless both bones are the same.
    """
    for i in range(3):
        x = M[0, i] * G[0, 0] + M[1, i] * G[1, 0] + M[2, i] * G[2, 0]
        y = M[0, i] * G[0, 1] + M[1, i] * G[1, 1] + M[2, i] * G[2, 1]
        z = M[0, i] * G[0, 2] + M[1, i] * G[1, 2] + M[2, i] * G[2, 2]
        for j in range(3):
            value = x * N[0, j] + y * N[1, j] + z * N[2, j]
            if row <= column:
                H[3 * row + i, 3 * column + j] += value
            if row >= column and not once:
                H[3 * column + j, 3 * row + i] += value
