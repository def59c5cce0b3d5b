"""Values over time for the sample clips; position, speed and acceleration are continuous."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

FPS = 60

Track = NDArray[np.float64]


def clock(seconds: float) -> Track:
    """The times of the frames [s]."""
    return np.arange(round(seconds * FPS) + 1) / FPS


def cosine(t: Track, period: float, top: float = 0.0) -> Track:
    """A wave between -1 and 1 with a maximum at the time `top` [s]; `period` in s."""
    return np.cos(2 * np.pi * (t - top) / period)


def eased(t: Track, keys: Sequence[float], values: Sequence[float]) -> Track:
    """A track that rests at the time of each key and moves between the values with least jerk."""
    track = np.full(len(t), float(values[0]))
    for start, end, before, after in zip(keys, keys[1:], values, values[1:], strict=False):
        s = np.clip((t - start) / (end - start), 0.0, 1.0)
        track += (after - before) * s**3 * (10 - 15 * s + 6 * s**2)
    return track


def held(t: Track, rise: float, top: float, leave: float, end: float) -> Track:
    """0 until `rise`, 1 from `top` to `leave`, 0 again from `end` on."""
    return eased(t, [rise, top, leave, end], [0, 1, 1, 0])


def bump(t: Track, start: float, end: float) -> Track:
    """0 until the start, 1 half-way, 0 again from the end on."""
    s = np.clip((t - start) / (end - start), 0.0, 1.0)
    return np.sin(np.pi * s) ** 4


def columns(*tracks: ArrayLike) -> Track:
    """(frames, tracks), from tracks and constants."""
    return np.stack(np.broadcast_arrays(*tracks), axis=-1).astype(float)
