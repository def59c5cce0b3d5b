"""Speeds of joints, and when they keep their places. Compiled."""

from __future__ import annotations

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import B2, F2, F3, I1, Array


@compiled()
def write_speeds(positions: F3, joints: I1, edges: I1, reach: int, frame_time: float, speeds: Out[F2]) -> None:
    """Write the length of the mean step over `reach` frames before and after each frame, per time; shots, from each of
    `edges` to the next, by themselves.
    """
    for shot in range(len(edges) - 1):
        first, end = edges[shot], edges[shot + 1]
        for frame in range(first, end):
            before, after = max(frame - reach, first), min(frame + reach, end - 1)
            for k in range(len(joints)):
                square = 0.0
                for i in range(3):
                    square += (positions[after, joints[k], i] - positions[before, joints[k], i]) ** 2
                speeds[frame, k] = np.sqrt(square) / max(after - before, 1) / frame_time


@compiled()
def find_holding(
    slow: B2,
    positions: F3,
    joints: I1,
    bases: I1,
    times: float,
    farther: float,
    least: float,
    shots: I1,
    holding: Out[B2],
) -> None:
    """Set `holding`, (frames, len(joints)), in runs of at least `least` slow frames of one shot in which a joint keeps
    its place while the base of its limb moves: so many `times` as far, and `farther` more.
    """
    for k in range(len(joints)):
        first = 0
        for frame in range(1, len(slow) + 1):
            if frame == len(slow) or slow[frame, k] != slow[first, k] or shots[frame] != shots[first]:
                if slow[first, k] and frame - first >= least:
                    moves = _reach(positions, bases[k], first, frame)
                    if moves > times * _reach(positions, joints[k], first, frame) + farther:
                        for held in range(first, frame):
                            holding[held, k] = True
                first = frame


@inlined()
def _reach(positions: Array, joint: int, first: int, end: int) -> float:
    """The largest distance of a joint from its mean place in the frames from `first` to before `end`."""
    farthest, a, b, c = 0.0, 0.0, 0.0, 0.0
    for frame in range(first, end):
        a += positions[frame, joint, 0] / (end - first)
        b += positions[frame, joint, 1] / (end - first)
        c += positions[frame, joint, 2] / (end - first)
    for frame in range(first, end):
        x, y, z = positions[frame, joint, 0], positions[frame, joint, 1], positions[frame, joint, 2]
        square = (x - a) * (x - a) + (y - b) * (y - b) + (z - c) * (z - c)
        if square > farthest:
            farthest = square
    return float(np.sqrt(farthest))
