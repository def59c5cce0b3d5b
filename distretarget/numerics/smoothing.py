"""Values over time, widened and averaged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, label, maximum_filter1d

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


def over_runs(values: Array, weights: Array) -> Array:
    """The values (frames, n), each averaged over its run of frames with weights, (frames,), that are not 0.

    Between the runs the averages are interpolated; before the first and after the last run they stay. Without any run
    they are the average over all frames.
    """
    frames = np.flatnonzero(weights)
    if not len(frames):
        return np.asarray(np.broadcast_to(values.mean(axis=0), values.shape))
    runs = label(weights > 0)[0]
    totals = np.zeros((runs.max() + 1, values.shape[1] + 1))
    np.add.at(totals, runs, weights[:, None] * np.pad(values, ((0, 0), (0, 1)), constant_values=1.0))
    means = totals[runs[frames], :-1] / totals[runs[frames], -1:]
    return np.stack([np.interp(np.arange(len(values)), frames, column) for column in means.T], axis=1)
