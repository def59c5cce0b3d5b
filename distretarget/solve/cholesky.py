"""The Cholesky factor of a matrix of 3 x 3 blocks, many of which may be zero, and what it solves. Compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    """Subtract from row i what the three finished rows from `above` on account for."""
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
