"""Hands that pass by: what swings past the trunk, a leg or the head touches nothing, however near it comes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.time_series import spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths

SPEED_SPAN = 0.1  # speeds are those between so long before and after a frame, in which a hand that claps comes back [s]
PASSES_BY = 50.0  # what is faster than this, on average while it touches, passes by [% of the height/s]


def speeds(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers) -> Array:
    """Return how fast joints move as seen from the joints that they are `on`, (n,), in some frames, each (n,)
    [file units/s].
    """
    reach = max(round(SPEED_SPAN / motion.frame_time), 1)
    ends = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(motion) - 1)
    before, after = (_seen_from(motion, at, joints, on) for at in ends)
    return np.asarray(lengths(after - before) / (np.maximum(ends[1] - ends[0], 1) * motion.frame_time))


def passing(speed: Array, rows: Numbers, of: Numbers, height: float) -> Flags:
    """Return whether touches pass by, (n,), by their `speed`, (n,) [file units/s]; each is of a row of frames and of
    something, (n,) each, such as a limb and a place, and lasts while that has touches in consecutive rows.
    """
    passes = np.zeros(len(speed), bool)
    for one in np.unique(of):
        own = np.flatnonzero(of == one)
        touched = np.zeros(rows[own].max() + 1, bool)
        touched[rows[own]] = True
        for first, end in spans_of(touched):
            span = own[(rows[own] >= first) & (rows[own] < end)]
            passes[span] = speed[span].mean() > PASSES_BY / 100.0 * height
    return passes


def _seen_from(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers) -> Array:
    """(n, 3), where joints are in the axes of others."""
    result = np.zeros((len(frames), 3))
    for joint in np.unique(on).tolist():
        own = np.flatnonzero(on == joint)
        at = frames[own]
        off = motion.positions[at, joints[own]] - motion.positions[at, joint]
        result[own] = Rotation.from_quat(motion.world_rotations_of(joint)[at]).apply(off, inverse=True)
    return result
