"""The frames in which a foot rests on the floor."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import Leg
from distretarget.motion import Motion
from distretarget.numerics.kinematics import speeds_along
from distretarget.numerics.shots import Shots, by_shot

REST_SPEED = 0.35  # a resting foot is slower than this [leg lengths / s]
REST_HEIGHT = 0.1  # a resting foot is no higher than this above the lowest joint of the body [leg lengths]


def feet_at_rest(
    motion: Motion,
    leg: Leg,
    up: NDArray[np.float64],
    length: float,
    *,
    speed: float = REST_SPEED,
    height: float = REST_HEIGHT,
    shots: Shots | None = None,
) -> NDArray[np.bool_]:
    """Return whether ankle and toe of a leg rest, (frames, 2): each while it is slow and the foot is low.

    `up`, (3,), is the unit vector up; `length` is that of the leg [file units]; `speed` and `height` are the limits,
    in leg lengths per second and leg lengths. Only the frames next to a frame decide, if they are in the same shot;
    without `shots`, (frames,), the motion is one.
    """
    shots = np.zeros(len(motion), np.intp) if shots is None else shots
    speeds = by_shot(
        partial(speeds_along, frame_time=motion.frame_time), shots, motion.positions[:, [leg.ankle, leg.toe]]
    )
    below = [leg.ankle, leg.toe, *motion.skeleton.children[leg.toe]]
    heights = motion.positions @ up
    low = heights[:, below].min(axis=1) - heights.min(axis=1) < height * length
    return np.asarray((speeds < speed * length) & low[:, None])
