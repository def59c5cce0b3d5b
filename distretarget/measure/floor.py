"""The floor of a source, and how far a result is from it: without any fitting, so that nothing hides a shift of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distretarget.numerics.vectors import Array, Flags

NEAR = 0.06  # a sole that rests this near to the floor may be on it: points below joints wander by half of it ...
THICK = 0.2  # ... and so may the skin about other joints that rest this near to it [both leg lengths]


@dataclass(frozen=True, eq=False)
class Floor:
    """The floor on which a source stands."""

    height: float  # [leg lengths]; nan if nothing of it rests

    def off(self, heights: Array, of_source: Array, near: Array | float = NEAR) -> Array:
        """How far heights in a result are above where they belong, negative below, in any shape [leg lengths].

        They belong where they are in the source, on the floor if that is so near, or anywhere between.
        """
        other = np.where(np.abs(of_source - self.height) < near, self.height, of_source)
        return np.asarray(heights - np.clip(heights, np.minimum(of_source, other), np.maximum(of_source, other)))


def find_floor(soles: Array, rests: Flags) -> Floor:
    """Find the floor of a source from the heights of its soles, which rest or not, (frames, legs) each: the median of
    those that rest [leg lengths].
    """
    return Floor(float(np.median(soles[rests])) if rests.any() else np.nan)
