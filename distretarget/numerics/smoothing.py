"""Values over time: the largest near each frame, averages, medians, and runs of frames. Compiled where it pays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled

Array = NDArray[np.float64]


def widened(values: Array, frames: float) -> Array:
    """The largest of the values (frames, n) within `frames` before and after each frame, averaged over as many frames.

    The result is smooth, and nowhere less than the values. Less than half a frame changes nothing.
    """
    reach = round(frames)
    return values if reach < 1 else _by_column(lambda columns: _averages(_largest(columns, reach), reach), values)


def largest(values: Array, reach: int) -> Array:
    """The largest of the values (frames, n) within `reach` frames before and after each frame."""
    return _by_column(lambda columns: _largest(columns, reach), values)


def averaged(values: Array, reach: int) -> Array:
    """The values (frames, ...), averaged over `reach` frames before and after each frame (a raised cosine); before the
    first and after the last frame they stay.
    """
    columns = values.reshape(len(values), -1)
    return _by_column(lambda columns: _averages(columns, reach), columns).reshape(values.shape)


def _by_column(function: Callable[[Array], Array], values: Array) -> Array:
    """What a function makes of values (frames, n), which it takes and returns as (n, frames)."""
    return np.ascontiguousarray(function(np.ascontiguousarray(values.T)).T)


def _extended(columns: Array, reach: int) -> Array:
    """Columns (n, frames) with the first and the last value repeated, (n, frames + 2 reach)."""
    frames = np.clip(np.arange(-reach, columns.shape[1] + reach), 0, columns.shape[1] - 1)
    return np.take(columns, frames, axis=1)


def _largest(columns: Array, reach: int) -> Array:
    windows, size, span = _extended(columns, reach), 2 * reach + 1, 1
    while 2 * span <= size:  # each element is the largest of `span`, from its place on
        windows = np.maximum(windows[:, :-span], windows[:, span:])
        span *= 2
    return np.maximum(windows[:, : columns.shape[1]], windows[:, size - span :])


def _averages(columns: Array, reach: int) -> Array:
    window = np.hanning(2 * reach + 3)[1:-1]
    result = np.zeros(columns.shape)
    _add_weighted(_extended(columns, reach), window / window.sum(), result)
    return result


@compiled()
def _add_weighted(columns: Array, window: Array, result: Array) -> None:
    for n in range(len(columns)):
        row = result[n]
        for k in range(len(window)):
            near, weight = columns[n, k:], window[k]
            for frame in range(len(row)):
                row[frame] += weight * near[frame]


def median_of_three(values: NDArray[Any]) -> NDArray[Any]:
    """The median of each of the values (frames, ...) and those of the frames before and after it: a single frame unlike
    both its neighbours becomes like one of them. The first and the last frame stay.
    """
    before, after = np.concatenate([values[:1], values[:-1]]), np.concatenate([values[1:], values[-1:]])
    least, most = np.minimum(before, after), np.maximum(before, after)
    return np.asarray(np.maximum(least, np.minimum(values, most)))


def runs_of(flags: NDArray[np.bool_]) -> NDArray[np.intp]:
    """(frames,), the number of the run of true frames, counted from 1, that each frame belongs to; 0 for others."""
    starts = flags & ~np.concatenate([[False], flags[:-1]])
    return np.asarray(np.where(flags, np.cumsum(starts), 0))


def over_runs(values: Array, weights: Array) -> Array:
    """The values (frames, n), each averaged over its run of frames with weights, (frames,), that are not 0.

    Between the runs the averages are interpolated; before the first and after the last run they stay. Without any run
    they are the average over all frames.
    """
    frames = np.flatnonzero(weights)
    if not len(frames):
        return np.asarray(np.broadcast_to(values.mean(axis=0), values.shape))
    runs = runs_of(weights > 0)
    totals = np.zeros((runs.max() + 1, values.shape[1] + 1))
    np.add.at(totals, runs, weights[:, None] * np.pad(values, ((0, 0), (0, 1)), constant_values=1.0))
    means = totals[runs[frames], :-1] / totals[runs[frames], -1:]
    return np.stack([np.interp(np.arange(len(values)), frames, column) for column in means.T], axis=1)
