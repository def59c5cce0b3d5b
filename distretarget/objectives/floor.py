"""The floor: how low each joint may be where something rests on it. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.articulation import Scratch
from distretarget.ik.springs import NEGLIGIBLE, Springs
from distretarget.numerics.compiled import inlined

Array = NDArray[np.float64]


class Floor(NamedTuple):
    """Heights that joints keep above: springs that only push upwards.

    A joint x below its height h has the energy 1/2 k (h - x . up)^2; above it has none. Arrays have the frames in
    front, but for those of a single frame.

    Attributes:
        joints: (joints,), joints of the target.
        heights: (joints,), h.
        stiffness: (joints,), k.
        up: (3,), the unit vector up.
    """

    joints: NDArray[np.intp]
    heights: Array
    stiffness: Array
    up: Array

    def of_frames(self, frames: slice) -> Floor:
        """The same in some of the frames."""
        return self._replace(heights=self.heights[frames], stiffness=self.stiffness[frames])


def no_floor(frames: int) -> Floor:
    """Nothing says where the floor is."""
    return Floor(np.zeros(0, np.intp), np.zeros((frames, 0)), np.zeros((frames, 0)), np.zeros(3))


@inlined(fastmath=True)
def depth_below(scratch, floor, n):  # type: ignore[no-untyped-def]
    """How far the n-th joint is below its height at the positions `scratch.x`; less than 0 above it."""
    x = scratch.x[floor.joints[n]]
    return floor.heights[n] - (x[0] * floor.up[0] + x[1] * floor.up[1] + x[2] * floor.up[2])


@inlined(fastmath=True)
def floor_energy(scratch: Scratch, floor: Floor) -> float:
    """The energy of the floor at the positions `scratch.x`; its gradient is added to `scratch.gradient`."""
    energy = 0.0
    for n in range(len(floor.joints)):
        if floor.stiffness[n] < NEGLIGIBLE:
            continue
        depth = depth_below(scratch, floor, n)
        if depth > 0.0:
            energy += 0.5 * floor.stiffness[n] * depth * depth
            for i in range(3):
                scratch.gradient[floor.joints[n], i] -= floor.stiffness[n] * depth * floor.up[i]
    return energy


@inlined(fastmath=True)
def add_floor(scratch: Scratch, floor: Floor, springs: Springs, count: int) -> int:
    """Write a spring for each joint that is below its height at the positions `scratch.x` behind the first springs, so
    many; return how many they are together. They have the same curvature as those springs and the floor.
    """
    for n in range(len(floor.joints)):
        if floor.stiffness[n] >= NEGLIGIBLE and depth_below(scratch, floor, n) > 0.0:
            springs.a[count], springs.b[count] = floor.joints[n], -1
            for i in range(3):
                for j in range(3):
                    springs.A[count, i, j] = floor.stiffness[n] * floor.up[i] * floor.up[j]
            count += 1
    return count
