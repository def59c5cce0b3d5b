"""On which sides limbs leave a body: those on which they enter it, or those on which they come out of it."""

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
    change: float,
) -> Array:
    """Return how far to displace joints in each frame so that the parts of a body come apart, (frames, limbs, 2, 3).

    In time forwards, a limb stays on the side on which it enters a body, and in time backwards on the side on which it
    comes out. Where these differ, each frame has those of the two that displace it less, and a change from one to the
    other costs as much as `change` frames of such a displacement. So a clip played backwards has the same.

    Args:
        balls: of the body, with its capsules.
        displaced: what moves with the displaced joints.
        posed: (frames, capsules, 2, 3), the ends of the capsules.
        limbs: (frames, limbs, 3, 3), the top, the middle and the end of each limb.
        free: (frames, limbs, 2), how far middle and end can move, 0 to 1.
        soft: (frames, pairs), how far segments may overlap.
        shots: (frames,); no side is kept across cuts.
        change: what a change costs [frames].
    """

    def of_shot(*values: Array) -> Array:
        forwards, backwards = displacements(balls, displaced, *values)
        taken = cheaper(forwards, backwards, change)
        return np.where(taken[:, None, None, None], backwards, forwards)

    return by_shot(of_shot, shots, posed, limbs, free, soft)


def cheaper(forwards: Array, backwards: Array, change: float) -> Flags:
    """Return where to take what was found backwards, (frames,): the way through both of least cost, by dynamic
    programming. The arguments are those of `least_displacements`.
    """
    differ: Flags = np.asarray((np.abs(forwards - backwards) > SAME).any(axis=(1, 2, 3)))
    dearer = np.where(differ, (forwards**2 - backwards**2).sum(axis=(1, 2, 3)), 0.0)
    changes = np.where(differ, change * ((forwards - backwards) ** 2).sum(axis=(1, 2, 3)), 0.0)
    gain = np.zeros(len(differ) + 1)  # what it saves to be in the frame before backwards rather than forwards
    for frame in np.flatnonzero(differ):
        gain[frame + 1] = np.clip(gain[frame], -changes[frame], changes[frame]) + dearer[frame]
    taken = np.zeros(len(differ) + 1, bool)
    for frame in np.flatnonzero(differ)[::-1]:
        change_after = changes[frame + 1] if frame + 1 < len(differ) else 0.0
        taken[frame] = gain[frame + 1] > (-change_after if taken[frame + 1] else change_after)
    return np.asarray(taken[:-1])
