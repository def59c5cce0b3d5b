"""How low each joint may be: the floor is where something rests on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.poses import PoseProblem
from distretarget.matching.matching import Matching
from distretarget.numerics.kinematics import heights_of, lowest_heights
from distretarget.numerics.time_series import largest
from distretarget.objectives.floor import Floor
from distretarget.objectives.settings import ContactSettings
from distretarget.objectives.supports import Supports

Array = NDArray[np.float64]

FLOOR_REACH = 0.3  # a joint that never comes nearer to the floor than this in the copy is left out [leg lengths]


def with_floor_heights(
    supports: Supports, matching: Matching, problem: PoseProblem, scale: RootScale, settings: ContactSettings
) -> Supports:
    """Return the supports with the heights that joints other than the feet's keep above.

    The floor is as high as the lowest joint of the source about then, scaled, while something rests. A joint belongs no
    nearer to it than the source's, scaled, or than `settings.rest_height`, whichever is less; a joint that nothing
    drives may be as low as the floor. The joints of a region, such as those of a hand, share the floor's stiffness.
    """
    if matching.legs is None:
        return supports
    up, length = matching.source.up_vector, matching.leg_lengths[1]
    source = matching.source_motion.positions
    floor = scale.height * _steady(lowest_heights(source, up), settings.support_blend / problem.frame_time)[:, None]
    reach = settings.rest_height * length
    weight = supports.weights.max(axis=1, initial=0.0)
    driven, followers = matching.joints_but_feet, matching.followers_but_feet
    high = scale.height * heights_of(source, matching.drivers[driven], up)
    joints = np.concatenate([driven, followers])
    lowest = np.repeat(floor, len(joints), axis=1)
    lowest[:, : len(driven)] += np.minimum(high - floor, reach)
    over = heights_of(problem.copy, joints, up) + ((problem.root - problem.copy[:, 0]) @ up)[:, None] - lowest
    near = ((over < FLOOR_REACH * length) & (weight[:, None] > 0.0)).any(axis=0)
    joints, lowest = joints[near], lowest[:, near]
    _, region, count = np.unique(matching.regions.of_joint[joints], return_inverse=True, return_counts=True)
    stiffness = settings.floor_stiffness * weight[:, None] / count[region]
    return replace(supports, floor=Floor(joints, np.ascontiguousarray(lowest / problem.unit), stiffness, up))


def _steady(heights: Array, frames: float) -> Array:
    """The least of the heights (frames,) within so many frames before and after each: the floor does not rise with feet
    that leave it.
    """
    return -largest(-heights[:, None], round(frames))[:, 0]
