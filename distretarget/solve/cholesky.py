"""The Cholesky factor of a matrix of 3 x 3 blocks, many of which may be zero, and what it solves. Compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.numerics.loops import clear

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@inlined(fastmath=True)
def factorise(H: Array, size: int) -> None:
    """Replace the upper triangle of the first `size` rows and columns of H, a multiple of 3, by that of its Cholesky
    factor U, U^T U = H; the diagonal gets the reciprocals of that of U.

    Loops run over slices from their start: numba's loops that begin at another index are not made for vectors.
    """
    for first in range(0, size, 3):
        for above in range(0, first, 3):
            if _sum(H[above : above + 3, first : first + 3]) > 0.0:
                for i in range(first, first + 3):
                    _eliminate(H[i, i:size], H[above, i:size], H[above + 1, i:size], H[above + 2, i:size])
        for i in range(first, first + 3):
            for k in range(first, i):
                _subtract(H[i, i:size], H[k, i:size])
            _scale(H[i, i:size])


@inlined(fastmath=True)
def _sum(block: Array) -> float:
    """The sum of the absolute values of a block, (3, 3)."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += abs(block[i, j])
    return total


@inlined(fastmath=True)
def _eliminate(row: Array, a: Array, b: Array, c: Array) -> None:
    """Subtract from a row what three finished rows above it account for; all begin at the diagonal of the row."""
    _eliminate_from(row, a[0], b[0], c[0], a, b, c)


@inlined(fastmath=True)
def _subtract(row: Array, a: Array) -> None:
    """The same for one row above."""
    x = a[0]
    for j in range(len(row)):
        row[j] -= x * a[j]


@inlined(fastmath=True)
def _scale(row: Array) -> None:
    """Divide a row by the square root of its first element, which becomes the reciprocal of that root."""
    factor = 1.0 / np.sqrt(row[0])
    for j in range(len(row)):
        row[j] *= factor
    row[0] = factor


@inlined(fastmath=True)
def solve_factored(U: Array, active: Numbers, gradient: Array, d: Array, flat: Array) -> None:
    """Write d = H^-1 gradient of the active parts, and zero of the others; U is what `factorise` made of H.

    `flat`, (all rows of U,), is scratch.
    """
    size = 3 * len(active)
    for i in range(size):
        flat[i] = gradient[active[i // 3], i % 3]
    for i in range(0, size, 3):
        a, b, c = U[i, i:size], U[i + 1, i:size], U[i + 2, i:size]
        x = flat[i] * a[0]
        y = (flat[i + 1] - a[1] * x) * b[1]
        z = (flat[i + 2] - a[2] * x - b[2] * y) * c[2]
        flat[i], flat[i + 1], flat[i + 2] = x, y, z
        _eliminate_from(flat[i + 3 : size], x, y, z, a[3:], b[3:], c[3:])
    clear(d)
    for i in range(size - 3, -1, -3):
        a, b, c = U[i, i:size], U[i + 1, i:size], U[i + 2, i:size]
        x, y, z = _products(flat[i + 3 : size], a[3:], b[3:], c[3:])
        z = (flat[i + 2] - z) * c[2]
        y = (flat[i + 1] - y - b[2] * z) * b[1]
        x = (flat[i] - x - a[1] * y - a[2] * z) * a[0]
        flat[i], flat[i + 1], flat[i + 2] = x, y, z
        part = active[i // 3]
        d[part, 0], d[part, 1], d[part, 2] = x, y, z


@inlined(fastmath=True)
def _eliminate_from(rest, x, y, z, a, b, c):  # type: ignore[no-untyped-def]
    """Subtract x a + y b + z c."""
    for j in range(len(rest)):
        rest[j] -= x * a[j] + y * b[j] + z * c[j]


@inlined(fastmath=True)
def _products(rest, a, b, c):  # type: ignore[no-untyped-def]
    """The inner products with a, b and c."""
    x, y, z = 0.0, 0.0, 0.0
    for j in range(len(rest)):
        x += a[j] * rest[j]
        y += b[j] * rest[j]
        z += c[j] * rest[j]
    return x, y, z
