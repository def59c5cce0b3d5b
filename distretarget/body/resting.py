"""The frames in which a foot rests on the floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import Leg
from distretarget.motion import Motion

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
) -> NDArray[np.bool_]:
    """Return whether ankle and toe of a leg rest, (frames, 2): each while it is slow and the foot is low.

    `up`, (3,), is the unit vector up; `length` is that of the leg [file units]; `speed` and `height` are the limits,
    in leg lengths per second and leg lengths. Only the frames next to a frame decide.
    """
    feet = motion.positions[:, [leg.ankle, leg.toe]]
    if len(feet) < 2:
        return np.ones((len(feet), 2), bool)
    speeds = np.linalg.norm(np.gradient(feet, motion.frame_time, axis=0), axis=-1)
    below = [leg.ankle, leg.toe, *motion.skeleton.children[leg.toe]]
    heights = motion.positions @ up
    low = heights[:, below].min(axis=1) - heights.min(axis=1) < height * length
    return np.asarray((speeds < speed * length) & low[:, None])
