"""Where the root belongs while the body rests on other joints than its feet."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.shots import Shots, by_shot
from distretarget.solve.poses import PoseProblem
from distretarget.solve.resting_joints import RestingJoints
from distretarget.solve.supports import RESTS, Supports

Array = NDArray[np.float64]

SEAT = 10.0  # weight of a region of the trunk that rests, which turns of the joints do not bring to its place
BLEND = 0.2  # the root takes about twice this time from one shift to the next [s]
UNKNOWN = 1e-3  # weight of the nearest known shift in frames in which nothing rests; a region that rests has 1
FEWEST = 5  # frames that a smoothing spline needs


def root_shift(problem: PoseProblem, feet: Supports, resting: RestingJoints, shots: Shots) -> Array:
    """Return how far the root belongs from its path, (frames, 3) [target file units].

    The path is that of the source's hips, times the ratio of leg lengths, which suits a body on its feet. On its hands
    a body moves as arms and trunk are long. So the root is displaced by what the regions of the body that rest are off
    their places in the copy, on average; feet at rest count as in place. A smoothing spline leads from one to the next.
    """
    off = resting.places - problem.copy_on_path(resting.joints)
    sums, count = np.zeros((len(problem), 3)), np.zeros(len(problem))
    for region in np.unique(resting.regions):
        on = resting.rests & (resting.regions == region)
        weight = SEAT if resting.in_trunk[resting.regions == region].all() else 1.0
        sums += weight * (on[..., None] * off).sum(axis=1) / np.maximum(on.sum(axis=1), 1)[:, None]
        count += weight * on.any(axis=1)
    for leg in range(0, feet.feet, 2):
        count += (feet.weights[:, leg : leg + 2] >= RESTS).any(axis=1)
    smooth = partial(_smooth, frame_time=problem.frame_time)
    return by_shot(smooth, shots, sums / np.maximum(count, 1.0)[:, None], count)


def _smooth(values: Array, weights: Array, frame_time: float) -> Array:
    """(frames, 3), a smooth curve through the values, (frames, 3), by their weights, (frames,)."""
    known = np.flatnonzero(weights)
    if not len(known) or not values[known].any():
        return np.zeros_like(values)
    frames = np.arange(len(values))
    filled = np.stack([np.interp(frames, known, column[known]) for column in values.T], axis=1)
    if len(frames) < FEWEST:
        return filled
    # Imported here: scipy.interpolate is slow to import, and most clips rest on nothing but feet.
    from scipy.interpolate import make_smoothing_spline

    stiffness = (BLEND / frame_time) ** 4  # of a spline that bends over `BLEND` where the weights are 1
    return np.asarray(make_smoothing_spline(frames, filled, np.maximum(weights, UNKNOWN), stiffness)(frames))
