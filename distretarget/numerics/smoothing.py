"""Smooth courses over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, maximum_filter1d

Array = NDArray[np.float64]


def widened(values: Array, frames: float) -> Array:
    """Values over time, (frames, n), taken at their largest within `frames` and then averaged over as many on both
    sides: nowhere less than they were, and smooth.
    """
    reach = round(frames)
    if reach < 1:
        return values
    return averaged(maximum_filter1d(values, 2 * reach + 1, axis=0, mode="nearest"), reach)


def averaged(values: Array, reach: int) -> Array:
    """Values over time, (frames, ...), averaged over `reach` frames on both sides (a raised cosine)."""
    window = np.hanning(2 * reach + 3)[1:-1]
    return np.asarray(convolve1d(values, window / window.sum(), axis=0, mode="nearest"))
