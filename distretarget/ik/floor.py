"""The floor: a one-sided spring that keeps each joint above a height. Compiled.

1/2 sum over joints below their height h   k (h - x . up)^2
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.ik.articulation import Scratch
from distretarget.ik.springs import NEGLIGIBLE, FrameSprings
from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import F1, F2, I1


class FloorSprings(NamedTuple):
    """The heights that joints keep above in some frames; in a single frame the axis of the frames is left out."""

    joints: I1  # (joints,), joints of the target
    heights: F2  # (frames, joints), h [body units]
    stiffness: F2  # (frames, joints), k
    up: F1  # (3,), the unit vector up

    def of_frames(self, frames: slice) -> FloorSprings:
        """Return the floor of some of the frames."""
        return self._replace(heights=self.heights[frames], stiffness=self.stiffness[frames])


def no_floor(frames: int) -> FloorSprings:
    """Return a floor that supports no joint."""
    return FloorSprings(np.zeros(0, np.intp), np.zeros((frames, 0)), np.zeros((frames, 0)), np.zeros(3))


@inlined(fastmath=True)
def depth_below(scratch: Scratch, floor: FloorSprings, n: int) -> float:
    """How far the n-th joint is below its height at the positions `scratch.x`; negative above it."""
    x = scratch.x[floor.joints[n]]
    return float(floor.heights[n] - (x[0] * floor.up[0] + x[1] * floor.up[1] + x[2] * floor.up[2]))


@inlined(fastmath=True)
def floor_energy(scratch: Scratch, floor: FloorSprings) -> float:
    """Return the floor's energy at the positions `scratch.x`, and add its gradient to `scratch.gradient`."""
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
def add_floor(scratch: Scratch, floor: FloorSprings, springs: FrameSprings, count: int) -> int:
    """Append a spring with the floor's curvature per joint below its height to `count` springs; return the count."""
    for n in range(len(floor.joints)):
        if floor.stiffness[n] >= NEGLIGIBLE and depth_below(scratch, floor, n) > 0.0:
            springs.a[count], springs.b[count] = floor.joints[n], -1
            for i in range(3):
                for j in range(3):
                    springs.A[count, i, j] = floor.stiffness[n] * floor.up[i] * floor.up[j]
            count += 1
    return count
