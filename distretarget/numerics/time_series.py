"""Time series over the frames of a clip: smoothing, medians, runs of frames, and shots between cuts."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from distretarget.numerics.joint_paths import steps_along
from distretarget.numerics.moving import averaged, largest
from distretarget.numerics.vectors import Array, Flags, Numbers

UNKNOWN = 1e-3  # weight of interpolated values in a smoothed series
SECOND_DIFFERENCE = (1.0, -2.0, 1.0)
MOST_FRAMES = 300.0  # limit of the width of smoothing, since rounding errors grow with its 4th power
STEP = 8.0  # at a cut joints move at least this many times as far as in the frames before and after it ...
FAR = 0.02  # ... and at least this far on average [of the given length]
FASTEST = 15.0  # nobody is faster, on average over all joints [lengths / s]
BRAKES = 100.0  # nobody slows down faster, on average over all joints [lengths / s^2]
SLOWS = 0.75  # a body slows down while each step is at most this share of the one before

Value = TypeVar("Value", bound=np.generic)
Shots = Numbers  # (frames,), the index of each frame's shot


def widened(values: Array, frames: float) -> Array:
    """The moving maximum of values, (frames, n), over `frames` before and after, then the moving average over as many:
    smooth, and nowhere less than the values. `frames` below 0.5 change nothing.
    """
    reach = round(frames)
    return values if reach < 1 else averaged(largest(values, reach), reach)


def opening(values: Array, frames: float) -> Array:
    """The morphological opening of values, (frames, ...): peaks that last for at most so many frames are removed."""
    reach = round(0.5 * frames)
    return largest(-largest(-values, reach), reach)


def smoothstep(values: Array) -> Array:
    """Return 0 for values up to 0, 1 for values from 1 on, and 3 t^2 - 2 t^3 in between."""
    t = np.clip(values, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def median_of_three(values: NDArray[Any]) -> NDArray[Any]:
    """The moving median of values, (frames, ...), over three frames; the first and the last frame stay."""
    median, before, after = values.copy(order="K"), values[:-2], values[2:]
    most, between = np.maximum(before, after), median[1:-1]
    np.minimum(between, most, out=between)
    np.maximum(np.minimum(before, after, out=most), between, out=between)
    return median


def usual_steps(steps: Array) -> Array:
    """The median of the two steps before and the two after each of `steps`, (frames, n), mirrored at the ends."""
    padded = np.pad(steps, ((2, 2), (0, 0)), "reflect")
    beside = padded[:-4], padded[1:-3], padded[3:-1], padded[4:]
    return np.asarray(0.5 * (sum(beside) - np.minimum.reduce(beside) - np.maximum.reduce(beside)))


def runs_of(flags: Flags) -> Numbers:
    """(frames,), the number, from 1, of the run of true frames to which each frame belongs; 0 for false frames."""
    starts = flags & ~np.concatenate([[False], flags[:-1]])
    return np.asarray(np.where(flags, np.cumsum(starts), 0))


def spans_of(flags: Flags) -> Numbers:
    """(runs, 2), the first frame of each run of true frames, and the frame after its last."""
    return np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]))).reshape(-1, 2)


def run_means(values: Array, weights: Array) -> Array:
    """The weighted mean of values, (frames, n), over each run of frames with weights, (frames,), above 0. It is
    interpolated between runs, and constant before the first and after the last; without runs the mean of all frames.
    """
    frames = np.flatnonzero(weights)
    if not len(frames):
        return np.asarray(np.broadcast_to(values.mean(axis=0), values.shape))
    runs = runs_of(weights > 0)
    totals = np.zeros((runs.max() + 1, values.shape[1] + 1))
    np.add.at(totals, runs, weights[:, None] * np.column_stack([values, np.ones(len(values))]))
    means = totals[runs[frames], :-1] / totals[runs[frames], -1:]
    return np.stack([np.interp(np.arange(len(values)), frames, column) for column in means.T], axis=1)


def smoothed(values: Array, weights: Array, frames: float) -> Array:
    """The series x, (frames, n), with the least sum of weight |x - value|^2 and `frames`^4 |second difference of x|^2:
    with weights, (frames,), of 1 it is smooth over about `frames`. Frames of weight 0 take interpolated values of the
    others with a small weight; if all weights are 0, the result is the values.

    Source: E. T. Whittaker, "On a New Method of Graduation", Proc. Edinburgh Mathematical Society 41 (1923) 63-75.
    """
    known, count = np.flatnonzero(weights), len(values)
    if not len(known):
        return values
    values = np.stack([np.interp(np.arange(count), known, column[known]) for column in values.T], axis=1)
    weights, stiffness = np.maximum(weights, UNKNOWN), min(frames, MOST_FRAMES) ** 4
    bands = np.zeros((len(SECOND_DIFFERENCE), count))  # the diagonal of the equations' matrix, and those below it
    bands[0] = weights
    for i, a in enumerate(SECOND_DIFFERENCE):
        for j, b in enumerate(SECOND_DIFFERENCE[: i + 1]):
            bands[i - j, j : max(count - 2, 0) + j] += stiffness * a * b
    return np.asarray(solveh_banded(bands[:count], weights[:, None] * values, lower=True))


def smoothed_steps(values: Array, weights: Array, stiffness: Array) -> Array:
    """The series x, (frames, n), with the least sum of weight |x - value|^2 and stiffness |first difference of x|^2.
    The `stiffness`, (frames,), is between each frame and the next; the last has no effect.
    """
    bands = np.zeros((2, len(values)))  # the diagonal of the equations' matrix, and the one below it
    bands[0] = weights
    bands[0, :-1] += stiffness[:-1]
    bands[0, 1:] += stiffness[:-1]
    bands[1, :-1] = -stiffness[:-1]
    return np.asarray(solveh_banded(bands[: len(values)], weights[:, None] * values, lower=True))


def find_shots(positions: Array, joints: Numbers, length: float, frame_time: float) -> Shots:
    """Return the index of each frame's shot, (frames,), from 0; a shot ends where the body jumps. `positions`,
    (frames, all joints, 3), and a `length` of the body, such as its legs', have the same unit; `joints` are those of
    the body, and `frame_time` is in [s].

    Frames at either end of the clip, such as a T-pose before the motion, are shots of their own while the body moves
    faster, or slows down faster, than anybody can, and until it has slowed down.
    """
    steps = steps_along(positions, joints).mean(axis=1)
    around = np.concatenate([[0.0], steps, [0.0]])
    cuts = steps > np.maximum(STEP * np.maximum(around[:-2], around[2:]), FAR * length)
    if len(steps) > 1:
        slower = np.array([steps[0] - steps[1], steps[-1] - steps[-2]])
        cuts[[0, -1]] |= slower > max(BRAKES * length * frame_time**2, FAR * length)
    fastest = FASTEST * length * frame_time
    cuts[: _rushed(steps, fastest)] = cuts[len(cuts) - _rushed(steps[::-1], fastest) :] = True
    return np.concatenate([[0], np.cumsum(cuts)]).astype(np.intp)


def _rushed(steps: Array, fastest: float) -> int:
    """The number of `steps`, (steps,), at the start that exceed `fastest`, or then belong to the slowing down."""
    possible = np.flatnonzero(steps <= fastest)
    count = int(possible[0]) if len(possible) else 0
    while 0 < count < len(steps) - 1 and steps[count + 1] < SLOWS * steps[count]:
        count += 1
    return count


def slices_of(shots: Shots) -> list[slice]:
    """Return the frames of each shot."""
    edges = [0, *(np.flatnonzero(np.diff(shots)) + 1).tolist(), len(shots)]
    return [slice(first, end) for first, end in pairwise(edges)]


def by_shot(function: Callable[..., NDArray[Value]], shots: Shots, *values: NDArray[np.generic]) -> NDArray[Value]:
    """Call a function on the frames of each shot, the first axis of `values`, and concatenate the results."""
    if not len(shots) or shots[0] == shots[-1]:
        return function(*values)
    return np.concatenate([function(*(each[shot] for each in values)) for shot in slices_of(shots)])
