"""The shots of a clip: runs of frames between cuts. At a cut the whole body jumps, as after a first frame in T-pose."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.kinematics import steps_along

Array = NDArray[np.float64]
Value = TypeVar("Value", bound=np.generic)
Shots = NDArray[np.intp]  # (frames,), the number of the shot that each frame belongs to

STEP = 8.0  # at a cut the joints move this many times as far as from frame to frame before and after it ...
FAR = 0.02  # ... and at least this far on average [of the length that is given]


def find_shots(positions: Array, joints: NDArray[np.intp], length: float) -> Shots:
    """Return the number of the shot that each frame belongs to, (frames,), counted from 0.

    `joints` are those of a body, among `positions`, (frames, all joints, 3), and `length` is a length of it, such as
    that of its legs, in the same unit.
    """
    steps = steps_along(positions, joints).mean(axis=1)
    before, after = np.insert(steps, 0, 0.0)[:-1], np.append(steps, 0.0)[1:]
    cuts = steps > np.maximum(STEP * np.maximum(before, after), FAR * length)
    return np.insert(np.cumsum(cuts), 0, 0).astype(np.intp)


def by_shot(function: Callable[..., NDArray[Value]], shots: Shots, *values: NDArray[np.generic]) -> NDArray[Value]:
    """Return what a function makes of values with the frames in front, made for each shot on its own, and joined."""
    if not len(shots) or shots[0] == shots[-1]:
        return function(*values)
    edges = [0, *(np.flatnonzero(np.diff(shots)) + 1).tolist(), len(shots)]
    return np.concatenate([function(*(each[first:end] for each in values)) for first, end in pairwise(edges)])
