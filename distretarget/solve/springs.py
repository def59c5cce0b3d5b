"""Springs between joints, and between joints and places in the world. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.solve.articulation import Scratch

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-9  # weights below this are left out


class Springs(NamedTuple):
    """Springs that draw two joints to a given difference, or one joint to a place in the world.

    Spring s draws r = x[a[s]] - x[b[s]] - rest[s], or r = x[a[s]] - rest[s] where b[s] is -1, towards zero. Its energy
    is 1/2 w r^T (k I + (1 - k) e e^T) r: along the unit vector e it acts fully, across e by the factor k.

    Attributes:
        a, b: (springs,), joints; b is -1 where the spring is tied to the world.
        rest, e: (springs, 3).
        w, k: (springs,); k is 1 where b is -1.
    """

    a: NDArray[np.intp]
    b: NDArray[np.intp]
    rest: Array
    e: Array
    w: Array
    k: Array


def joined(one: Springs, other: Springs) -> Springs:
    """The springs of both, whose arrays `rest`, `e`, `w` and `k` have the frames in front."""
    lists = [np.concatenate([a, b], axis=min(np.ndim(a) - 1, 1)) for a, b in zip(one, other, strict=True)]
    return Springs(*lists)


@njit(cache=True, error_model="numpy", fastmath=True)
def spring_energy(scratch: Scratch, springs: Springs) -> float:
    """The energy of springs at the positions `scratch.x`; their gradient is added to `scratch.gradient`."""
    energy = 0.0
    r, force = np.empty(3), np.empty(3)
    for s in range(len(springs.a)):
        if springs.w[s] < NEGLIGIBLE:
            continue
        a, b, k, e = springs.a[s], springs.b[s], springs.k[s], springs.e[s]
        for i in range(3):
            r[i] = scratch.x[a, i] - springs.rest[s, i] - (scratch.x[b, i] if b >= 0 else 0.0)
        along = (1.0 - k) * (e[0] * r[0] + e[1] * r[1] + e[2] * r[2])
        for i in range(3):
            force[i] = springs.w[s] * (k * r[i] + along * e[i])
            energy += 0.5 * force[i] * r[i]
            scratch.gradient[a, i] += force[i]
            if b >= 0:
                scratch.gradient[b, i] -= force[i]
    return energy
