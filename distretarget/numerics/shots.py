"""The shots of a clip: runs of frames between cuts. At a cut the whole body jumps, as after a first frame in T-pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Shots = Sequence[slice]

STEP = 8.0  # at a cut the joints move this many times as far as from frame to frame before and after it ...
FAR = 0.02  # ... and at least this far on average [of the length that is given]


def find_shots(positions: Array, length: float) -> list[slice]:
    """Return the shots of a clip, one after the other, by the positions (frames, joints, 3) of a body.

    `length` is a length of the body, such as that of its legs, in the unit of the positions.
    """
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=-1).mean(axis=1)
    before, after = np.insert(steps, 0, 0.0)[:-1], np.append(steps, 0.0)[1:]
    cuts = np.flatnonzero(steps > np.maximum(STEP * np.maximum(before, after), FAR * length)) + 1
    return [slice(first, end) for first, end in pairwise([0, *cuts.tolist(), len(positions)])]


def by_shot(function: Callable[..., Array], shots: Shots, *values: NDArray[np.generic]) -> Array:
    """Return what a function makes of values with the frames in front, made for each shot on its own, and joined."""
    return np.concatenate([function(*(each[shot] for each in values)) for shot in shots])
