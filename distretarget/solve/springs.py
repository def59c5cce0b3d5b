"""Springs between joints, and between joints and places in the world. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined
from distretarget.solve.articulation import Scratch

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-9  # springs of less stiffness are left out


class Springs(NamedTuple):
    """Springs that draw two joints to a given difference, or one joint to a place in the world.

    Spring s draws r = x[a[s]] - x[b[s]] - rest[s], or r = x[a[s]] - rest[s] where b[s] is -1, towards zero. Its energy
    is 1/2 r^T A[s] r.

    Attributes:
        a, b: (springs,), joints; b is -1 where the spring is tied to the world.
        rest: (springs, 3).
        A: (springs, 3, 3), symmetric, the stiffness in each direction.
    """

    a: NDArray[np.intp]
    b: NDArray[np.intp]
    rest: Array
    A: Array

    def of_frames(self, frames: slice) -> Springs:
        """The springs in some of the frames, if `rest` and `A` have these in front."""
        return self._replace(rest=self.rest[frames], A=self.A[frames])


def no_springs(frames: int) -> Springs:
    """Nothing draws; `rest` and `A` have the frames in front."""
    none = np.zeros(0, np.intp)
    return Springs(none, none, np.zeros((frames, 0, 3)), np.zeros((frames, 0, 3, 3)))


def joined(one: Springs, other: Springs) -> Springs:
    """The springs of both, whose arrays `rest` and `A` have the frames in front."""
    lists = [np.concatenate([a, b], axis=min(np.ndim(a) - 1, 1)) for a, b in zip(one, other, strict=True)]
    return Springs(*lists)


def stiffer_along(e: Array, w: Array, k: Array) -> Array:
    """(..., 3, 3), w (k I + (1 - k) e e^T): the stiffness w along unit vectors e (..., 3), and k w across them."""
    A = np.empty((*w.shape, 3, 3))
    _write_stiffness(e.reshape(-1, 3), w.ravel(), k.ravel(), A.reshape(-1, 3, 3))
    return A


@compiled(fastmath=True)
def _write_stiffness(e: Array, w: Array, k: Array, A: Array) -> None:
    for s in range(len(w)):
        for i in range(3):
            for j in range(3):
                A[s, i, j] = w[s] * (1.0 - k[s]) * e[s, i] * e[s, j]
            A[s, i, i] += w[s] * k[s]


@inlined(fastmath=True)
def stiffness_of(A):  # type: ignore[no-untyped-def]
    """The sum of the stiffness in three directions across each other."""
    return A[0, 0] + A[1, 1] + A[2, 2]


@inlined(fastmath=True)
def spring_energy(scratch: Scratch, springs: Springs) -> float:
    """The energy of springs at the positions `scratch.x`; their gradient is added to `scratch.gradient`."""
    energy = 0.0
    r = np.empty(3)
    for s in range(len(springs.a)):
        A = springs.A[s]
        if stiffness_of(A) < NEGLIGIBLE:
            continue
        a, b = springs.a[s], springs.b[s]
        for i in range(3):
            r[i] = scratch.x[a, i] - springs.rest[s, i] - (scratch.x[b, i] if b >= 0 else 0.0)
        for i in range(3):
            force = A[i, 0] * r[0] + A[i, 1] * r[1] + A[i, 2] * r[2]
            energy += 0.5 * force * r[i]
            scratch.gradient[a, i] += force
            if b >= 0:
                scratch.gradient[b, i] -= force
    return energy
