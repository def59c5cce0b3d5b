"""Time series over the frames of a clip: widened values, medians, runs, shots between cuts."""

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

UNKNOWN = 1e-3  # weight of the nearest known values, in a smoothed series, where nothing is known
SECOND_DIFFERENCE = (1.0, -2.0, 1.0)
MOST_FRAMES = 300.0  # a smoothed series bends over no more than these, since rounding errors grow with the 4th power
STEP = 8.0  # at a cut joints move at least this many times as far as in the frames before and after it ...
FAR = 0.02  # ... and at least this far on average [of the given length]
FASTEST = 15.0  # no person is faster, on average over all joints [lengths / s]
BRAKES = 100.0  # no person slows down faster, on average over all joints [lengths / s^2]
SLOWS = 0.75  # a body that was faster slows down while each step is at most this share of the one before

Value = TypeVar("Value", bound=np.generic)
Shots = Numbers  # (frames,), the number of the shot that each frame belongs to


def widened(values: Array, frames: float) -> Array:
    """The moving maximum of values, (frames, n), over `frames` before and after, then averaged over as many: smooth,
    and nowhere less than the values. `frames` below 0.5 changes nothing.
    """
    reach = round(frames)
    return values if reach < 1 else averaged(largest(values, reach), reach)


def lasting(values: Array, frames: float) -> Array:
    """Return values, (frames, ...), lowered to what lasts for longer than so many frames; the same in reversed time."""
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
    """The median of the two steps before each of some steps, (frames, n), and the two after; beyond the ends as in a
    mirror.
    """
    padded = np.pad(steps, ((2, 2), (0, 0)), "reflect")
    beside = padded[:-4], padded[1:-3], padded[3:-1], padded[4:]
    return np.asarray(0.5 * (sum(beside) - np.minimum.reduce(beside) - np.maximum.reduce(beside)))


def runs_of(flags: Flags) -> Numbers:
    """(frames,), the number of the run of true frames that each frame belongs to, from 1; 0 for false frames."""
    starts = flags & ~np.concatenate([[False], flags[:-1]])
    return np.asarray(np.where(flags, np.cumsum(starts), 0))


def spans_of(flags: Flags) -> Numbers:
    """(runs, 2), the first frame of each run of true frames, and the frame after its last."""
    return np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]))).reshape(-1, 2)


def over_runs(values: Array, weights: Array) -> Array:
    """The weighted mean of values, (frames, n), over each run of frames with weights, (frames,), above 0; interpolated
    between runs, constant before the first and after the last, and that of all frames without runs.
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
    where the weights, (frames,), are 1 it bends over about `frames`. Frames of weight 0 take the nearest other values,
    interpolated, with a small weight; without any others, the result is the values.

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


def steadied(values: Array, weights: Array, stiffness: Array) -> Array:
    """The series x, (frames, n), with the least sum of weight |x - value|^2 and stiffness |difference of x|^2. The
    `stiffness`, (frames,), is that between each frame and the next; the last has no effect.
    """
    bands = np.zeros((2, len(values)))  # the diagonal of the equations' matrix, and the one below it
    bands[0] = weights
    bands[0, :-1] += stiffness[:-1]
    bands[0, 1:] += stiffness[:-1]
    bands[1, :-1] = -stiffness[:-1]
    return np.asarray(solveh_banded(bands[: len(values)], weights[:, None] * values, lower=True))


def find_shots(positions: Array, joints: Numbers, length: float, frame_time: float) -> Shots:
    """Return the number of each frame's shot, (frames,), from 0; a shot ends where the body jumps. `positions`,
    (frames, all joints, 3), and a `length` of the body, such as its legs', have the same unit; `joints` are those of
    the body, and `frame_time` is in [s]. Frames at the beginning or the end, such as a T-pose before the motion, from
    which the body leaves faster than anybody can move, or can slow down, are shots of their own, until the body has
    slowed down.
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
    """How many `steps`, (steps,), at the start are longer than `fastest`, and after them part of the slowing down."""
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
