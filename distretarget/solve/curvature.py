"""The Gauss-Newton curvature of springs with respect to a pose, its Cholesky factor, and the scaled unknowns. Compiled.

With U^T U = H, the curvature, the energy is round in the unknowns z = U v, so that the spectral gradient method needs
few iterations there.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.solve.articulation import Articulation, Scratch, lever_arms
from distretarget.solve.springs import NEGLIGIBLE, Springs

Array = NDArray[np.float64]

LEAST_CURVATURE = 0.01  # of any direction, in the scaling alone: so no step turns a part right round


@njit(cache=True, error_model="numpy", fastmath=True)
def spring_curvature(body: Articulation, scratch: Scratch, springs: Springs, H: Array) -> None:
    """Write the upper triangle of the curvature of springs and stiffness, for the pose in `scratch`, to `H`.

    A small turn w of a part moves the difference of two positions by w x q, where q is the difference of the part's
    lever arms on them. A spring of matrix A so contributes [q]^T A [q'] for each pair of parts.
    """
    lever_arms(body, scratch)
    parts = len(scratch.rotations)
    H[:] = 0.0
    for i in range(3 * parts + 3):
        H[i, i] = max(body.stiffness[i // 3], LEAST_CURVATURE)
    on = np.empty(parts, np.intp)
    Q = np.empty((parts, 3))
    for s in range(len(springs.a)):
        if springs.w[s] < NEGLIGIBLE:
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
        _add_spring(springs.w[s], springs.k[s], springs.e[s], Q, on, count, b < 0, H)


@njit(cache=True, error_model="numpy", fastmath=True)
def _add_spring(w, k, e, Q, on, count, grounded, H):  # type: ignore[no-untyped-def]
    """Add the blocks of one spring for the parts `on`; one that is tied to the world also acts on the root's place."""
    root = len(H) - 3
    for m in range(count):
        row = 3 * on[m]
        q = Q[m]
        mx, my, mz = q[1] * e[2] - q[2] * e[1], q[2] * e[0] - q[0] * e[2], q[0] * e[1] - q[1] * e[0]
        for n in range(m, count):
            column = 3 * on[n]
            p = Q[n]
            dot = q[0] * p[0] + q[1] * p[1] + q[2] * p[2]
            nx, ny, nz = p[1] * e[2] - p[2] * e[1], p[2] * e[0] - p[0] * e[2], p[0] * e[1] - p[1] * e[0]
            along = (mx, my, mz), (nx, ny, nz)
            for i in range(3):
                H[row + i, column + i] += w * k * dot
                for j in range(3):
                    H[row + i, column + j] += w * ((1.0 - k) * along[0][i] * along[1][j] - k * p[i] * q[j])
        if grounded:
            H[row, root + 1] -= w * q[2]
            H[row, root + 2] += w * q[1]
            H[row + 1, root] += w * q[2]
            H[row + 1, root + 2] -= w * q[0]
            H[row + 2, root] -= w * q[1]
            H[row + 2, root + 1] += w * q[0]
    if grounded:
        for i in range(3):
            H[root + i, root + i] += w


@njit(cache=True, error_model="numpy", fastmath=True)
def factorise(H: Array) -> None:
    """Replace the upper triangle of H by that of its Cholesky factor U, where U^T U = H."""
    n = len(H)
    for i in range(n):
        for k in range(i):
            if H[k, i] != 0.0:
                for j in range(i, n):
                    H[i, j] -= H[k, i] * H[k, j]
        scale = 1.0 / np.sqrt(H[i, i])
        for j in range(i, n):
            H[i, j] *= scale


@njit(cache=True, error_model="numpy", fastmath=True)
def scale(U: Array, v: Array, z: Array) -> None:
    """Write z = U v."""
    flat_v, flat_z = v.reshape(v.size), z.reshape(z.size)
    for i in range(len(U)):
        total = 0.0
        for j in range(i, len(U)):
            total += U[i, j] * flat_v[j]
        flat_z[i] = total


@njit(cache=True, error_model="numpy", fastmath=True)
def unscale(U: Array, z: Array, v: Array) -> None:
    """Write the v with U v = z."""
    flat_v, flat_z = v.reshape(v.size), z.reshape(z.size)
    for i in range(len(U) - 1, -1, -1):
        total = flat_z[i]
        for j in range(i + 1, len(U)):
            total -= U[i, j] * flat_v[j]
        flat_v[i] = total / U[i, i]


@njit(cache=True, error_model="numpy", fastmath=True)
def scale_gradient(U: Array, gradient: Array) -> None:
    """Replace the gradient with respect to v by that with respect to z: the g with U^T g = gradient."""
    flat = gradient.reshape(gradient.size)
    for i in range(len(U)):
        flat[i] /= U[i, i]
        for j in range(i + 1, len(U)):
            flat[j] -= U[i, j] * flat[i]
