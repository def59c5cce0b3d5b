"""Snaps: joints that move far in one frame of a result although they hardly move in the rotation copy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.kinematics import steps_along
from distretarget.numerics.time_series import find_shots

Array = NDArray[np.float64]

INSTANT = 1 / 60  # the time over which steps are measured [s]
SNAP = 4.0  # a joint snaps if it moves farther than this ...
CALM = 1.5  # ... while it moves less than this in the rotation copy [both % of leg length in INSTANT]


def find_snaps(copy: Motion, result: Motion, body: Body) -> Array:
    """(frames - 1, joints), how far each joint of a result moves to the next frame, where that is a snap, else 0 [% of
    leg length in `INSTANT`].

    `copy` is the rotation copy on the same body. What is not part of the body, such as a root on the floor, does not
    snap, and nothing does at a cut.
    """
    flesh = body.regions.of_joint >= 0
    steps, calm = _steps(result, body), _steps(copy, body) < CALM
    calm[np.diff(find_shots(copy.positions, np.flatnonzero(flesh), 0.5 * body.unit)) > 0] = False
    steps[~(flesh & calm & (steps > SNAP))] = 0.0
    return steps


def _steps(motion: Motion, body: Body) -> Array:
    """(frames - 1, joints), how far each joint moves to the next frame [% of leg length in `INSTANT`]."""
    steps = steps_along(motion.positions)
    steps *= 100 * INSTANT / (0.5 * body.unit * motion.frame_time)
    return steps
