"""The side on which a limb leaves a body: that on which it enters it, or that on which it comes out of it."""

from __future__ import annotations

import numpy as np

from distretarget.numerics.time_series import Shots, by_shot
from distretarget.numerics.vectors import Array, Flags
from distretarget.skin.balls import Balls
from distretarget.skin.displacement import displacements
from distretarget.skin.tangents import Displaced

SAME = 0.005  # displacements that differ by less are on the same side [body units]


def least_displacements(
    balls: Balls,
    displaced: Displaced,
    posed: Array,
    limbs: Array,
    free: Array,
    soft: Array,
    shots: Shots,
    switch_cost: float,
) -> Array:
    """Return displacements of the middles and ends of limbs that bring the parts of a body apart, (frames, limbs, 2,
    3).

    Solved forwards in time, a limb stays on the side on which it enters a body; backwards, on the side on which it
    comes out. Where the two solutions differ, each frame takes the smaller one; a switch between them costs as much as
    `switch_cost` frames of their difference. So the result does not depend on the direction of time.

    Args:
        balls: of the body, with its capsules.
        displaced: how capsules move with the displaced joints.
        posed: (frames, capsules, 2, 3), the ends of the capsules.
        limbs: (frames, limbs, 3, 3), the top, the middle and the end of each limb.
        free: (frames, limbs, 2), how far middle and end can move, 0 to 1.
        soft: (frames, pairs), how far segments may overlap.
        shots: (frames,); sides do not persist across cuts.
        switch_cost: of a switch between the two solutions [frames].
    """

    def of_shot(*values: Array) -> Array:
        forwards, backwards = displacements(balls, displaced, *values)
        taken = cheaper(forwards, backwards, switch_cost)
        return np.where(taken[:, None, None, None], backwards, forwards)

    return by_shot(of_shot, shots, posed, limbs, free, soft)


def cheaper(forwards: Array, backwards: Array, switch_cost: float) -> Flags:
    """Return a mask of the frames that take the displacements found backwards, (frames,): those of the cheapest
    sequence, by dynamic programming. The cost of a frame is the square of its displacements, that of a switch
    `switch_cost` times the square of the difference of the two solutions.
    """
    differ: Flags = np.asarray((np.abs(forwards - backwards) > SAME).any(axis=(1, 2, 3)))
    saved = np.where(differ, (forwards**2 - backwards**2).sum(axis=(1, 2, 3)), 0.0)
    switches = np.where(differ, switch_cost * ((forwards - backwards) ** 2).sum(axis=(1, 2, 3)), 0.0)
    gain = np.zeros(len(differ) + 1)  # cost saved up to the frame before by ending backwards rather than forwards
    for frame in np.flatnonzero(differ):
        gain[frame + 1] = np.clip(gain[frame], -switches[frame], switches[frame]) + saved[frame]
    taken = np.zeros(len(differ) + 1, bool)
    for frame in np.flatnonzero(differ)[::-1]:
        switch_after = switches[frame + 1] if frame + 1 < len(differ) else 0.0
        taken[frame] = gain[frame + 1] > (-switch_after if taken[frame + 1] else switch_after)
    return np.asarray(taken[:-1])
