"""Joints of a result that jump from one frame to the next, and do not in the rotation copy: snaps and pops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.compiled import compiled, inlined, read_only
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
    return _jumps(copy, result, body, shots, False)


def find_pops(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), how far the deviation of each joint from the rotation copy jumps to the next frame, of
    moving limbs as well [% of leg length in `INSTANT`]; 0 where it does not jump.

    A jump is `SUDDEN` times the median of the two steps before and the two after it. Otherwise as `find_snaps`.
    """
    return _jumps(copy, result, body, shots, True)


def _jumps(copy: Motion, result: Motion, body: Body, shots: Shots, pops: bool) -> Array:
    """(frames - 1, joints), the jumps of `find_pops` or `find_snaps`."""
    before, after = (read_only(np.ascontiguousarray(motion.positions)) for motion in (copy, result))
    scale = 100 * INSTANT / (0.5 * body.unit * result.frame_time)  # of steps in file units
    jumps = np.zeros((max(len(result) - 1, 0), len(result.skeleton)))
    joints = np.flatnonzero(body.regions.of_joint >= 0)
    _write_jumps(before, after, joints, np.diff(shots) == 0, scale, pops, jumps)
    return jumps


@compiled()
def _write_jumps(copy, result, joints, going_on, scale, pops, jumps):  # type: ignore[no-untyped-def]
    """Write the steps that are jumps, in % of leg length in `INSTANT`."""
    last = len(jumps) - 1
    for frame in range(len(jumps)):
        for joint in joints:
            step = _step(copy, result, frame, joint, pops) * scale
            if step > FAR and going_on[frame]:
                if pops:
                    total, least, most = 0.0, np.inf, 0.0
                    for lag in (-2, -1, 1, 2):  # beyond the ends as in a mirror
                        near = max(last - abs(last - abs(frame + lag)), 0)
                        other = _step(copy, result, near, joint, pops) * scale
                        total, least, most = total + other, min(least, other), max(most, other)
                    sudden = step > SUDDEN * 0.5 * (total - least - most)
                else:
                    sudden = _step(copy, copy, frame, joint, pops) * scale < CALM
                if sudden:
                    jumps[frame, joint] = step


@inlined()
def _step(copy: Array, result: Array, frame: int, joint: int, against: bool) -> float:
    """How far a joint goes to the next frame, or its deviation from the copy."""
    square = 0.0
    for i in range(3):
        start, end = result[frame, joint, i], result[frame + 1, joint, i]
        if against:
            start, end = start - copy[frame, joint, i], end - copy[frame + 1, joint, i]
        step = end - start
        square += step * step
    return float(np.sqrt(square))
