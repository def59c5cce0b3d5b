"""The root's path on the target, and its scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.matching.matching import Matching
from distretarget.motion import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RootScale:
    """How places in the source's world become places in the target's.

    Performers of different sizes who share a world share the scale along the floor, so that they meet; each keeps its
    own scale upwards, so that each stands on the floor.

    Attributes:
        level, height: target units per source unit along the floor, and upwards.
    """

    level: float
    height: float

    @classmethod
    def even(cls, scale: float) -> RootScale:
        """The same scale in all directions."""
        return cls(scale, scale)

    def places(self, places: Array, up: Array) -> Array:
        """Return the places of the target's world for places of the source's, (..., 3); `up` is the unit vector up."""
        if self.level == self.height:
            return np.asarray(self.level * places)
        return np.asarray(self.level * places + (self.height - self.level) * (places @ up)[..., None] * up)


def find_root_scale(matching: Matching) -> float:
    """Return how many target units the root travels for each source unit.

    It is the ratio of leg lengths, which keeps stride and height in proportion to the body; for bodies without legs the
    ratio of their longest paths.
    """
    if matching.legs:
        from_length, to_length = matching.leg_lengths
    else:
        shared = np.flatnonzero(matching.drivers >= 0)
        drivers = matching.drivers[shared]
        from_length = matching.source.skeleton.path_lengths[np.ix_(drivers, drivers)].max()
        to_length = matching.target.skeleton.path_lengths[np.ix_(shared, shared)].max()
    return float(to_length / from_length) if from_length > 0 else 1.0


def root_path(baseline: Motion, matching: Matching, scale: RootScale) -> Array:
    """Return the root's path, (frames, 3) [target file units], that puts the middle between the hip joints where the
    source has it, scaled.

    The hip joints decide, not the root, because legs hang from them. `baseline` is the rotation copy; without legs its
    root path is returned.
    """
    if matching.legs is None:
        return np.ascontiguousarray(baseline.root_positions)
    source_hips, hips = (
        motion.positions[:, [leg.hip for leg in legs]].mean(axis=1)
        for motion, legs in zip((matching.source_motion, baseline), matching.legs, strict=True)
    )
    return np.ascontiguousarray(scale.places(source_hips, matching.source.up_vector) - hips + baseline.root_positions)
