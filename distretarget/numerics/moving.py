"""Moving maxima, averages and medians over frames, the first axis. Compiled."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F1, F2, Array, read_only


def largest(values: Array, reach: int) -> Array:
    """The moving maximum of values, (frames, ...), over `reach` frames before and after."""
    columns = _columns(values)
    result, (before, after) = np.empty_like(columns), np.empty((2, *columns.shape))
    _write_largest(columns, reach, before, after, result)
    return result.reshape(values.shape)


def averaged(values: Array, reach: int) -> Array:
    """Values, (frames, ...), averaged over `reach` frames before and after by a raised cosine; the ends repeat."""
    columns = _columns(values)
    result = np.empty_like(columns)
    _write_averaged(columns, raised_cosine(reach), result)
    return result.reshape(values.shape)


def _columns(values: Array) -> Array:
    return np.ascontiguousarray(values, np.float64).reshape(len(values), math.prod(values.shape[1:]))


@lru_cache(maxsize=64)
def raised_cosine(reach: int) -> Array:
    """(reach + 1,), the weights of a frame and of frames at increasing distance, in multiples of 2^-52, so that the
    average of ones is exactly 1 in any order of the sum.
    """
    window = np.hanning(2 * reach + 3)[1:-1]
    weights = np.round(2.0**52 * window / window.sum())
    weights[reach] += 2.0**52 - weights.sum()
    return read_only(weights[reach:] / 2.0**52)


@compiled()
def _write_largest(values: F2, reach: int, before: Out[F2], after: Out[F2], result: Out[F2]) -> None:
    write_largest(values, reach, before, after, result)


@compiled()
def _write_averaged(values: F2, weights: F1, result: Out[F2]) -> None:
    write_averaged(values, weights, result)


@inlined()
def write_largest(values: Array, reach: int, before: Array, after: Array, result: Array) -> None:
    """Write moving maxima in three passes for any reach (M. van Herk, "A fast algorithm for local minimum and maximum
    filters on rectangular and octagonal kernels", Pattern Recognition Letters 13, 1992). In blocks as long as the
    window, `before` has maxima since the start of the block, `after` up to its end. `result` may be `values`.
    """
    frames, columns, block = values.shape[0], values.shape[1], 2 * reach + 1
    for frame in range(frames):
        _write_larger(values[frame], before[max(frame - 1, 0)], frame % block == 0, before[frame], columns)
    for frame in range(frames - 1, -1, -1):
        ends = frame == frames - 1 or (frame + 1) % block == 0
        _write_larger(values[frame], after[min(frame + 1, frames - 1)], ends, after[frame], columns)
    for frame in range(frames):
        first, last = max(frame - reach, 0), min(frame + reach, frames - 1)
        at_an_end = first // block == last // block  # where the window is shorter than a block
        one = before[last] if at_an_end and first % block == 0 else after[first]
        _write_larger(one, before[last], at_an_end, result[frame], columns)


@inlined()
def _write_larger(one: Array, other: Array, only_one: bool, result: Array, columns: int) -> None:
    """Write the larger values of two rows, or the row `one`."""
    if only_one:
        for n in range(columns):
            result[n] = one[n]
    else:
        for n in range(columns):
            result[n] = one[n] if one[n] > other[n] else other[n]


@inlined()
def write_averaged(values: Array, weights: Array, result: Array) -> None:
    """Write moving averages with symmetric weights, given from the centre outwards; the ends repeat."""
    frames, columns = values.shape
    for frame in range(frames):
        for n in range(columns):
            result[frame, n] = values[frame, n] * weights[0]
        for away in range(len(weights) - 1, 0, -1):
            before, after, weight = max(frame - away, 0), min(frame + away, frames - 1), weights[away]
            for n in range(columns):
                result[frame, n] += (values[before, n] + values[after, n]) * weight


@inlined()
def write_median(values: Array, result: Array) -> None:
    """Write the moving median over three frames; the first and the last frame stay."""
    frames, columns = values.shape
    for frame in range(frames):
        before, after = max(frame - 1, 0), min(frame + 1, frames - 1)
        if before == frame or after == frame:
            before = after = frame
        for n in range(columns):
            a, b, c = values[before, n], values[frame, n], values[after, n]
            less, more = min(a, c), max(a, c)
            result[frame, n] = max(less, min(b, more))
