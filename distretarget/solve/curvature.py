"""The Gauss-Newton curvature of springs with respect to a pose, its Cholesky factor, and the scaled unknowns. Compiled.

With U^T U = H, the curvature, the energy is round in the unknowns z = U v, so that the spectral gradient method needs
few iterations there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.solve.articulation import Articulation, Scratch, lever_arms, to_rotation_vector
from distretarget.solve.springs import NEGLIGIBLE, Springs, stiffness_of

Array = NDArray[np.float64]
Parts = NDArray[np.intp]

LEAST_CURVATURE = 0.01  # of any direction, in the scaling alone: so no step turns a part right round


@inlined(fastmath=True)
def active_curvature(v: Array, body: Articulation, scratch: Scratch, springs: Springs, H: Array, active: Parts) -> int:
    """Write the upper triangle of the curvature of the active parts at the pose `v` to the front of `H`, and the
    numbers of these parts to `active`; return how many they are. `scratch` has the positions of the pose.

    A part is active if a spring acts on it; the last one is the root's place. All others only have their stiffness, so
    that they keep the copy's rotation and are no unknowns.
    """
    _spring_curvature(body, scratch, springs, H)
    count = 0
    for part in range(len(v)):
        i = 3 * part
        if H[i, i] + H[i + 1, i + 1] + H[i + 2, i + 2] > 0.0:
            active[count] = part
            count += 1
    for p in range(count):
        for q in range(p, count):
            _move_block(v, H, active[p], active[q], 3 * p, 3 * q)
        for i in range(3 * p, 3 * p + 3):
            H[i, i] += max(body.stiffness[active[p]], LEAST_CURVATURE)
    return count


@inlined(fastmath=True)
def _move_block(v, H, p, q, row, column):  # type: ignore[no-untyped-def]
    """Move the block of the parts p and q to a row and column of `H`, and turn it into one for rotation vectors.

    A small turn of a part is w = J dv, J being the left Jacobian of the exponential map, so that the block becomes
    J^T H J. The root's place is no rotation.
    """
    last = len(v) - 1
    line = np.empty(3)
    for j in range(3):
        for i in range(3):
            line[i] = H[3 * p + i, 3 * q + j]
        if p < last:
            to_rotation_vector(v[p], line)
        for i in range(3):
            H[row + i, column + j] = line[i]
    for i in range(3):
        for j in range(3):
            line[j] = H[row + i, column + j]
        if q < last:
            to_rotation_vector(v[q], line)
        for j in range(3):
            H[row + i, column + j] = line[j]


@inlined(fastmath=True)
def _spring_curvature(body: Articulation, scratch: Scratch, springs: Springs, H: Array) -> None:
    """Write the upper triangle of the curvature of springs with respect to small turns of all parts.

    A small turn w of a part moves the difference of two positions by w x q, where q is the difference of the part's
    lever arms on them. A spring of matrix A so contributes [q]^T A [q'] for each pair of parts.
    """
    lever_arms(body, scratch)
    parts = len(scratch.rotations)
    H[:] = 0.0
    on = np.empty(parts, np.intp)
    Q = np.empty((parts, 3))
    for s in range(len(springs.a)):
        if stiffness_of(springs.A[s]) < NEGLIGIBLE:
            continue
        a, b = springs.a[s], springs.b[s]
        count = 0
        for part in range(parts):
            size = 0.0
            for i in range(3):
                Q[count, i] = scratch.arms[a, part, i] - (scratch.arms[b, part, i] if b >= 0 else 0.0)
                size += Q[count, i] ** 2
            if size > 0.0:
                on[count] = part
                count += 1
        _add_spring(springs.A[s], Q, on, count, b < 0, H)


@inlined(fastmath=True)
def _add_spring(A, Q, on, count, grounded, H):  # type: ignore[no-untyped-def]
    """Add the blocks of one spring for the parts `on`; one that is tied to the world also acts on the root's place."""
    root = len(H) - 3
    B = np.empty((3, 3))
    for n in range(count):
        column, p = 3 * on[n], Q[n]
        for i in range(3):
            B[i, 0] = A[i, 1] * p[2] - A[i, 2] * p[1]
            B[i, 1] = A[i, 2] * p[0] - A[i, 0] * p[2]
            B[i, 2] = A[i, 0] * p[1] - A[i, 1] * p[0]
        for m in range(n + 1):
            row, q = 3 * on[m], Q[m]
            for j in range(3):
                H[row, column + j] += q[2] * B[1, j] - q[1] * B[2, j]
                H[row + 1, column + j] += q[0] * B[2, j] - q[2] * B[0, j]
                H[row + 2, column + j] += q[1] * B[0, j] - q[0] * B[1, j]
        if grounded:
            for i in range(3):
                for j in range(3):
                    H[column + i, root + j] -= B[j, i]
    if grounded:
        for i in range(3):
            for j in range(3):
                H[root + i, root + j] += A[i, j]


@inlined(fastmath=True)
def factorise(H: Array, n: int) -> None:
    """Replace the upper triangle of the first n rows and columns of H by that of its Cholesky factor U, U^T U = H."""
    for i in range(n):
        for k in range(i):
            if H[k, i] != 0.0:
                for j in range(i, n):
                    H[i, j] -= H[k, i] * H[k, j]
        scale = 1.0 / np.sqrt(H[i, i])
        for j in range(i, n):
            H[i, j] *= scale


@inlined(fastmath=True)
def scale(U: Array, active: Parts, v: Array, z: Array) -> None:
    """Write z = U v of the active parts, (active, 3)."""
    for i in range(z.size):
        total = 0.0
        for j in range(i, z.size):
            total += U[i, j] * v[active[j // 3], j % 3]
        z[i // 3, i % 3] = total


@inlined(fastmath=True)
def unscale(U: Array, active: Parts, z: Array, v: Array) -> None:
    """Write the v with U v = z of the active parts, and zero of the others."""
    v[:] = 0.0
    flat = z.copy().reshape(z.size)
    for i in range(z.size - 1, -1, -1):
        total = flat[i]
        for j in range(i + 1, z.size):
            total -= U[i, j] * flat[j]
        flat[i] = total / U[i, i]
        v[active[i // 3], i % 3] = flat[i]


@inlined(fastmath=True)
def scale_gradient(U: Array, active: Parts, gradient: Array, scaled: Array) -> None:
    """Write the gradient with respect to z, (active, 3): the g with U^T g = gradient of the active parts."""
    flat = scaled.reshape(scaled.size)
    for i in range(len(flat)):
        flat[i] = gradient[active[i // 3], i % 3]
    for i in range(len(flat)):
        flat[i] /= U[i, i]
        for j in range(i + 1, len(flat)):
            flat[j] -= U[i, j] * flat[i]
