"""How near pairs of points come to each other. Compiled."""

from __future__ import annotations

import numpy as np

from distretarget.numerics.compiled import Out, compiled
from distretarget.numerics.vectors import B1, F1, F2, F3, I1, S2, Array, Flags, Numbers


def come_near(a: Array, b: Array, u: Numbers, v: Numbers, reach: Array) -> Flags:
    """(pairs,), whether points u of `a` and v of `b`, (frames, points, 3), ever come closer than `reach`, (pairs,)."""
    near = np.zeros(len(u), np.bool_)
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    _mark_near(a, b, np.ascontiguousarray(u), np.ascontiguousarray(v), reach, near)
    return near


@compiled(fastmath=True)
def _mark_near(a: F3, b: F3, u: I1, v: I1, reach: F1, near: Out[B1]) -> None:
    for pair in range(len(u)):
        i, j, square = u[pair], v[pair], reach[pair] ** 2
        for frame in range(len(a)):
            x = a[frame, i, 0] - b[frame, j, 0]
            y = a[frame, i, 1] - b[frame, j, 1]
            z = a[frame, i, 2] - b[frame, j, 2]
            if x * x + y * y + z * z < square:
                near[pair] = True
                break


def normalised_distances(a: Array, b: Array, u: Numbers, v: Numbers, tau: Array) -> Array:
    """D: (frames, pairs), distances between points u of `a` and v of `b`, (frames, points, 3), over path lengths."""
    D = np.empty((len(a), len(u)))
    _write_distances(np.ascontiguousarray(a), np.ascontiguousarray(b), u, v, tau, D)
    return D


@compiled()
def _write_distances(a: F3, b: F3, u: I1, v: I1, tau: F1, D: Out[F2]) -> None:
    for frame in range(len(a)):
        for pair in range(len(u)):
            i, j = u[pair], v[pair]
            x = a[frame, i, 0] - b[frame, j, 0]
            y = a[frame, i, 1] - b[frame, j, 1]
            z = a[frame, i, 2] - b[frame, j, 2]
            D[frame, pair] = np.sqrt(x * x + y * y + z * z) / tau[pair]


@compiled()
def write_nearest(positions: F3, u: I1, v: I1, limits: F1, ends: I1, nearest: Out[S2]) -> None:
    """Write the nearest pair of joints of each pair of regions, whose squared distance is smallest relative to its
    limit, (pairs of joints,); -1 where none is below it. `ends` are the first pairs of each, and their number.
    """
    for frame in range(len(nearest)):
        x = positions[frame]
        for k in range(nearest.shape[1]):
            least, nearest[frame, k] = 1.0, -1
            for n in range(ends[k], ends[k + 1]):
                i, j = u[n], v[n]
                square = (x[i, 0] - x[j, 0]) ** 2 + (x[i, 1] - x[j, 1]) ** 2 + (x[i, 2] - x[j, 2]) ** 2
                if square < least * limits[n]:
                    least, nearest[frame, k] = square / limits[n], n
