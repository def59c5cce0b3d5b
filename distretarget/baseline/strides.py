"""How long the strides of a motion may become before its legs cannot reach the floor, and the scale of a world in which
several performers stride.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from distretarget.body.resting import feet_at_rest
from distretarget.matching.matching import Matching
from distretarget.numerics.vectors import lengths, level

SINK = 0.1  # how much lower than in the source hips may be in a stride [leg lengths]
MOST_FRAMES = 95.0  # strides are within reach in this share of the resting feet's frames [%]


def longest_strides(matching: Matching) -> float:
    """Return how many times as long, against the legs, the strides may be along the floor; infinite without legs.

    A foot that rests at the distance d along the floor from its hip joint, which is h above it, can be s d away where
    (s d)^2 + (h - sink)^2 is the square of the leg's length.
    """
    if matching.legs is None:
        return float("inf")
    motion, up, leg_length = matching.source_motion, matching.source.up_vector, matching.leg_lengths[0]
    factors = []
    for leg in matching.legs[0]:
        rests = feet_at_rest(motion, leg, up, leg_length).any(axis=1)
        way = motion.positions[rests, leg.hip] - motion.positions[rests, leg.ankle]
        reach = np.sqrt(np.maximum(leg_length**2 - (way @ up - SINK * leg_length) ** 2, 0.0))
        factors.append(reach / np.maximum(lengths(level(way, up)), 1e-9 * leg_length))
    known = np.concatenate(factors)
    return float(np.percentile(known, 100.0 - MOST_FRAMES)) if len(known) else float("inf")


def followed_scale(heights: Sequence[float], longest: Sequence[float]) -> float:
    """Return the scale along the floor in which all performers of a world can follow: the mean of the scales of their
    `heights`, or as much less as the legs of all can reach; `longest` is of each, as `longest_strides` says.
    """
    if len(heights) == 1:
        return heights[0]
    followed = [height * most for height, most in zip(heights, longest, strict=True)]
    return min(float(np.mean(heights)), *followed)
