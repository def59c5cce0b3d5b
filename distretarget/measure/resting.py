"""When feet of a motion rest: they are slow, and near their lowest heights, both found from positions alone; and the
floor that shows, without any fitting, so that nothing hides a shift of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from distretarget.body.limbs import Leg
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import speeds_along
from distretarget.numerics.vectors import Array, Flags, Numbers

SLOW = 0.35  # a joint that rests on the floor is slower than this [leg lengths / s] ...
LOW_FOOT = 0.06  # ... and if it is a foot's, within this [leg lengths] of its lowest heights,
LOWEST = 2.0  # which is this percentile of them [%]
# Nobody sees how feet rest that do so for less than this and than half of a clip, all rests together: a foot in a run
# carries the body for longer [s].
LEAST = 0.1
NEAR = 0.06  # a sole that rests this near to the floor may be on it: points below joints wander by half of it ...
THICK = 0.2  # ... and so may the skin about other joints that rest this near to it [both leg lengths]


def foot_joints(legs: Sequence[Leg]) -> Numbers:
    """Ankle and toe of each leg in turn, (foot joints,)."""
    return np.array([joint for leg in legs for joint in (leg.ankle, leg.toe)], np.intp)


def feet_rest(motion: Motion, legs: Sequence[Leg], length: float, up: Array) -> Flags:
    """(frames, foot joints), whether each foot joint rests; `length` is that of a leg, `up`, (3,), the vector up. A
    foot that is higher than the hip joint of its leg carries nothing, as in a clip of a single kick.
    """
    paths = motion.positions[:, foot_joints(legs)] / length
    heights, hips = paths @ up, motion.positions[:, [leg.hip for leg in legs for _ in range(2)]] @ up / length
    low = (heights - np.percentile(heights, LOWEST, axis=0) < LOW_FOOT) & (heights < hips)
    rests = np.asarray(low & (speeds_along(paths, motion.frame_time) < SLOW))
    count = np.count_nonzero(rests.any(axis=1))
    return rests & (count >= min(LEAST / motion.frame_time, 0.5 * len(rests)))


@dataclass(frozen=True, eq=False)
class Floor:
    """The floor on which a source stands."""

    height: float  # [leg lengths]; nan if nothing of it rests

    def off(self, heights: Array, of_source: Array, near: Array | float = NEAR) -> Array:
        """How far heights in a result are above where they belong, negative below, in any shape [leg lengths].

        They belong where they are in the source, on the floor if that is so near, or anywhere between.
        """
        other = np.where(np.abs(of_source - self.height) < near, self.height, of_source)
        return np.asarray(heights - np.clip(heights, np.minimum(of_source, other), np.maximum(of_source, other)))


def find_floor(soles: Array, rests: Flags) -> Floor:
    """Find the floor of a source from the heights of its soles, which rest or not, (frames, legs) each: the median of
    those that rest [leg lengths].
    """
    return Floor(float(np.median(soles[rests])) if rests.any() else np.nan)
