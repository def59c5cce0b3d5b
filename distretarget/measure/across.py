"""How well two performers, or a performer and a thing, keep touching each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.blocks import blocks_of
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

NEAR = 0.07  # points of two sides touch where they are nearer than this in the source [leg lengths]


@dataclass(frozen=True)
class Across:
    """The gaps between points of two sides that touch in the source, in units of the source's world.

    Attributes:
        leg: the length of a leg in the source, the mean of both sides [source file units].
        frames: in how many frames anything touches.
        source, rotation_copy, result: mean gap over all pairs of points that touch and all frames in which they do
            [source file units]; nan where nothing touches.
    """

    leg: float
    frames: int
    source: float
    rotation_copy: float
    result: float


@dataclass(frozen=True, eq=False)
class Side:
    """The points of a performer or a thing, in the source, the rotation copy and the result.

    Attributes:
        source, rotation_copy, result: (frames, points, 3) each [file units].
        leg: length of a leg in the source, of the performer who touches a thing [source file units].
    """

    source: Array
    rotation_copy: Array
    result: Array
    leg: float


def body_side(matching: Matching, copy: Motion, result: Motion) -> Side:
    """Return the points of a performer: all driven joints of its body."""
    joints = matching.body_joints
    source = matching.source_motion.positions[:, matching.drivers[joints]]
    return Side(source, copy.positions[:, joints], result.positions[:, joints], matching.leg_lengths[0])


def measure_across(one: Side, other: Side, scale: float) -> Across:
    """Measure the gaps between two sides; `scale` is in target units per source unit."""
    leg = (one.leg + other.leg) / 2.0
    sides = [
        (one.source, other.source),
        *((a / scale, b / scale) for a, b in ((one.rotation_copy, other.rotation_copy), (one.result, other.result))),
    ]
    frames, count, totals = 0, 0, np.zeros(3)
    for frame, u, v in touching_points(one.source, other.source, leg):
        frames += len(np.unique(frame))
        count += len(frame)
        totals += [lengths(a[frame, u] - b[frame, v]).sum() for a, b in sides]
    means = totals / count if count else np.full(3, np.nan)
    return Across(leg, frames, *means.tolist())


def touching_points(one: Array, other: Array, leg: float) -> Iterator[tuple[Numbers, Numbers, Numbers]]:
    """The points of two sides, (frames, points, 3) each, that touch: block by block the frame of each pair, and the
    number of either point. `leg` is in the unit of the points.
    """
    for block in blocks_of(len(one)):
        frame, u, v = np.nonzero(lengths(one[block][:, :, None] - other[block][:, None]) < NEAR * leg)
        yield block.start + frame, u, v
