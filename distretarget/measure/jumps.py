"""Joints of a result that jump from one frame to the next, and do not in the rotation copy: snaps and pops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.kinematics import steps_along
from distretarget.numerics.time_series import Shots

Array = NDArray[np.float64]

INSTANT = 1 / 60  # the time over which turns, snaps and pops are measured [s]
FAR = 4.0  # a joint jumps if it moves farther than this ...
CALM = 1.5  # ... while it moves less than this in the rotation copy: a snap [both % of leg length in INSTANT]; ...
SUDDEN = 4.0  # ... or if its deviation from the copy goes as far, and this many times its usual way: a pop


def find_snaps(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), how far each joint of a result jumps to the next frame while it hardly moves in the
    rotation copy [% of leg length in `INSTANT`]; 0 where it does not jump.

    Joints outside the body, such as a root on the floor, do not snap, and no joint snaps at a cut of the source between
    `shots`, (frames,).
    """
    steps = _steps(result.positions, result, body)
    return _counted(steps, (steps > FAR) & (_steps(copy.positions, result, body) < CALM), body, shots)


def find_pops(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), how far the deviation of each joint from the rotation copy jumps to the next frame, of
    moving limbs as well [% of leg length in `INSTANT`]; 0 where it does not jump.

    A jump is `SUDDEN` times the median of the two steps before and the two after it. Otherwise as `find_snaps`.
    """
    steps = _steps(result.positions - copy.positions, result, body)
    sudden = steps > FAR
    frames, joints = np.nonzero(sudden)
    if len(frames):
        padded = np.pad(steps, ((2, 2), (0, 0)), "reflect")
        around = np.sort([padded[frames + k, joints] for k in (0, 1, 3, 4)], axis=0)[1:3].mean(axis=0)
        sudden[frames, joints] = steps[frames, joints] > SUDDEN * around
    return _counted(steps, sudden, body, shots)


def _counted(steps: Array, jumps: NDArray[np.bool_], body: Body, shots: Shots) -> Array:
    """The steps, (frames - 1, joints), that are jumps of joints of the body, and not at a cut; 0 for all others."""
    jumps &= (body.regions.of_joint >= 0) & (np.diff(shots) == 0)[:, None]
    steps[~jumps] = 0.0
    return steps


def _steps(paths: Array, motion: Motion, body: Body) -> Array:
    """(frames - 1, joints), how far each of some paths, (frames, joints, 3), goes to the next frame of a motion
    [% of leg length in `INSTANT`].
    """
    steps = steps_along(paths)
    steps *= 100 * INSTANT / (0.5 * body.unit * motion.frame_time)
    return steps
