"""Values over time, widened and averaged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, maximum_filter1d

Array = NDArray[np.float64]


def widened(values: Array, frames: float) -> Array:
    """The largest of the values (frames, n) within `frames` before and after each frame, averaged over as many frames.

    The result is smooth, and nowhere less than the values. Less than half a frame changes nothing.
    """
    reach = round(frames)
    if reach < 1:
        return values
    return averaged(maximum_filter1d(values, 2 * reach + 1, axis=0, mode="nearest"), reach)


def averaged(values: Array, reach: int) -> Array:
    """The values (frames, ...), averaged over `reach` frames before and after each frame (a raised cosine)."""
    window = np.hanning(2 * reach + 3)[1:-1]
    return np.asarray(convolve1d(values, window / window.sum(), axis=0, mode="nearest"))
