"""Springs between joints, and between joints and places in the world. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
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


def room_for(count: int) -> Springs:
    """Arrays for so many springs in one frame."""
    return Springs(np.zeros(count, np.intp), np.zeros(count, np.intp), np.zeros((count, 3)), np.zeros((count, 3, 3)))


def joined(*springs: Springs) -> Springs:
    """All of these springs, whose arrays `rest` and `A` have the frames in front."""
    lists = [np.concatenate(arrays, axis=min(np.ndim(arrays[0]) - 1, 1)) for arrays in zip(*springs, strict=True)]
    return Springs(*lists)


@inlined(fastmath=True)
def is_negligible(A: Array, s: int) -> bool:
    """Whether spring s of those with the stiffness A, (springs, 3, 3), is too soft to count."""
    return bool(A[s, 0, 0] + A[s, 1, 1] + A[s, 2, 2] < NEGLIGIBLE)


@inlined(fastmath=True)
def spring_energy(scratch: Scratch, springs: Springs, count: int) -> float:
    """The energy of the first springs, so many, at the positions `scratch.x`; their gradient is added to
    `scratch.gradient`.
    """
    energy = 0.0
    x, gradient, A, rest = scratch.x, scratch.gradient, springs.A, springs.rest
    for s in range(count):
        if is_negligible(A, s):
            continue
        a, b = springs.a[s], springs.b[s]
        rx, ry, rz = x[a, 0] - rest[s, 0], x[a, 1] - rest[s, 1], x[a, 2] - rest[s, 2]
        if b >= 0:
            rx, ry, rz = rx - x[b, 0], ry - x[b, 1], rz - x[b, 2]
        fx = A[s, 0, 0] * rx + A[s, 0, 1] * ry + A[s, 0, 2] * rz
        fy = A[s, 1, 0] * rx + A[s, 1, 1] * ry + A[s, 1, 2] * rz
        fz = A[s, 2, 0] * rx + A[s, 2, 1] * ry + A[s, 2, 2] * rz
        energy += 0.5 * (fx * rx + fy * ry + fz * rz)
        gradient[a, 0] += fx
        gradient[a, 1] += fy
        gradient[a, 2] += fz
        if b >= 0:
            gradient[b, 0] -= fx
            gradient[b, 1] -= fy
            gradient[b, 2] -= fz
    return energy
