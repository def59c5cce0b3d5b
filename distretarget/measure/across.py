"""How well two performers keep touching each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.matching.matching import Matching
from distretarget.motion import Motion

Array = NDArray[np.float64]

NEAR = 0.07  # joints of two performers touch where they are nearer than this in the source [leg lengths]
BLOCK = 256  # frames measured at once


@dataclass(frozen=True)
class Across:
    """The gaps between joints of two performers that touch in the source, in units of the source's world.

    Attributes:
        frames: in how many frames anything touches.
        source, rotation_copy, result: mean gap over all pairs of joints that touch and all frames in which they do
            [source file units]; nan where nothing touches.
    """

    frames: int
    source: float
    rotation_copy: float
    result: float


def measure_across(
    matchings: tuple[Matching, Matching],
    copies: tuple[Motion, Motion],
    results: tuple[Motion, Motion],
    scale: float,
) -> Across:
    """Measure the gaps between two performers; `scale` is in target units per source unit along the floor."""
    joints = [np.flatnonzero((each.drivers >= 0) & (each.regions.of_joint >= 0)) for each in matchings]
    sources = [each.source_motion.positions[:, each.drivers[j]] for each, j in zip(matchings, joints, strict=True)]
    near = NEAR * np.mean([each.leg_lengths[0] for each in matchings])
    sides = [sources]
    for pair in (copies, results):
        sides.append([each.positions[:, j] / scale for each, j in zip(pair, joints, strict=True)])
    frames, count, totals = 0, 0, np.zeros(3)
    for first in range(0, len(sources[0]), BLOCK):
        block = slice(first, first + BLOCK)
        gaps = [np.linalg.norm(a[block][:, :, None] - b[block][:, None], axis=-1) for a, b in sides]
        touch = gaps[0] < near
        frames += int(touch.any(axis=(1, 2)).sum())
        count += int(touch.sum())
        totals += [gap[touch].sum() for gap in gaps]
    means = totals / count if count else np.full(3, np.nan)
    return Across(frames, *means.tolist())
