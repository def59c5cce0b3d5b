"""Pops of joints in a result: steps that the rotation copy does not make."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import B1, F2, F3, I1, Array, Numbers

if TYPE_CHECKING:  # they need scipy, which the build does without
    from distretarget.body.body import Body
    from distretarget.motion import Motion
    from distretarget.numerics.time_series import Shots

INSTANT = 1 / 60  # the time over which turns and pops are measured [s]
FAR = 4.0  # a joint pops if it moves farther than this ...
CALM = 1.5  # ... while it moves less than this in the rotation copy [both % of leg length in INSTANT] ...
UNSTEADY = 2.0  # ... and so many times as far as on average ...
AROUND = 0.1  # ... in this time before and after it, since what goes on so long is no jump [s]; ...
SUDDEN = 4.0  # ... or if its deviation from the copy goes as far, and this many times its usual way
JUMP = 2.0  # a joint of the source that goes so many times its usual way jumps: the data are wrong there
NEAR = 2  # how many steps before and after it show its usual way


def find_pops(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), how far each joint of a result pops on the way to the next frame [% of leg length in
    `INSTANT`]; 0 where it does not pop.

    A joint pops if it suddenly moves farther than `FAR` while it hardly moves in the rotation copy, or if its deviation
    from the copy does, `SUDDEN` times the median of the two steps before and the two after it. Joints outside the body,
    such as a root on the floor, do not pop, and no joint pops at a cut of the source between `shots`, (frames,), or
    where the source itself jumps.
    """
    scale = 100 * INSTANT / (body.leg * result.frame_time)  # of steps in file units
    pops, going_on = np.zeros((max(len(result) - 1, 0), len(result.skeleton))), np.diff(shots) == 0
    joints = np.flatnonzero(body.regions.of_joint >= 0)
    around = max(round(AROUND / result.frame_time), 1)
    margin = max(around, NEAR)
    for block in blocks_of(len(pops)):
        first = max(block.start - margin, 0)
        steps = slice(first, block.stop + margin)
        frames, rows = slice(first, steps.stop + 1), slice(block.start - first, block.stop - first)
        before, after = (np.ascontiguousarray(motion.positions_in(frames)) for motion in (copy, result))
        found = np.zeros_like(pops[steps])
        _write_pops(before, after, joints, going_on[steps], around, scale, found)
        pops[block] = found[rows]
    return pops


@compiled()
def _write_pops(copy: F3, result: F3, joints: I1, going_on: B1, around: int, scale: float, pops: Out[F2]) -> None:
    """Write the steps that are pops, in % of leg length in `INSTANT`."""
    last = len(pops) - 1
    for frame in range(len(pops)):
        if not going_on[frame] or _jumps(copy, frame, joints, scale, last):
            continue
        for joint in joints:
            step = _step(result, copy, frame, joint, 0.0) * scale
            is_calm = step > FAR and _step(copy, copy, frame, joint, 0.0) * scale < CALM
            if is_calm and step > UNSTEADY * scale * _mean_step(result, going_on, frame, joint, around):
                pops[frame, joint] = step
                continue
            step = _step(result, copy, frame, joint, 1.0) * scale
            if step > FAR and step > SUDDEN * scale * _usual_step(result, copy, frame, joint, 1.0, last):
                pops[frame, joint] = step


@inlined()
def _jumps(copy: Array, frame: int, joints: Numbers, scale: float, last: int) -> bool:
    """Whether a joint of the copy goes far, and `JUMP` times its usual way: so the source does."""
    for joint in joints:
        step = _step(copy, copy, frame, joint, 0.0) * scale
        if step > FAR and step > JUMP * scale * _usual_step(copy, copy, frame, joint, 0.0, last):
            return True
    return False


@inlined()
def _mean_step(motion: Array, going_on: B1, frame: int, joint: int, around: int) -> float:
    """The mean of the steps up to so many before and after a frame, within its shot."""
    total, count = 0.0, 0
    for way in (-1, 1):
        step = frame + way
        while 0 <= step < len(going_on) and abs(step - frame) <= around and going_on[step]:
            total, count, step = total + _step(motion, motion, step, joint, 0.0), count + 1, step + way
    return total / max(count, 1)


@inlined()
def _usual_step(motion: Array, copy: Array, frame: int, joint: int, share: float, last: int) -> float:
    """The median of the two steps before a frame and the two after it; beyond the ends as in a mirror."""
    total, least, most = 0.0, np.inf, 0.0
    for lag in (-NEAR, -1, 1, NEAR):
        step = _step(motion, copy, max(last - abs(last - abs(frame + lag)), 0), joint, share)
        total, least, most = total + step, min(least, step), max(most, step)
    return 0.5 * (total - least - most)


@inlined()
def _step(motion: Array, copy: Array, frame: int, joint: int, share: float) -> float:
    """How far a joint goes to the next frame, less a share of its way in the copy."""
    square = 0.0
    for i in range(3):
        step = motion[frame + 1, joint, i] - motion[frame, joint, i]
        step -= share * (copy[frame + 1, joint, i] - copy[frame, joint, i])
        square += step * step
    return float(np.sqrt(square))
