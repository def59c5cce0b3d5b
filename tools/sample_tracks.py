"""Tracks over time for the sample clips: everything is smooth up to the acceleration."""

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
    """A wave between -1 and 1 that is at its top at the time `top`."""
    return np.cos(2 * np.pi * (t - top) / period)


def eased(t: Track, keys: Sequence[float], values: Sequence[float]) -> Track:
    """A track that rests at each key and moves between them with least jerk."""
    track = np.full(len(t), float(values[0]))
    for start, end, before, after in zip(keys, keys[1:], values, values[1:], strict=False):
        s = np.clip((t - start) / (end - start), 0.0, 1.0)
        track += (after - before) * s**3 * (10 - 15 * s + 6 * s**2)
    return track


def held(t: Track, rise: float, top: float, leave: float, end: float) -> Track:
    """From 0 at `rise` to 1 between `top` and `leave` and back to 0 at `end`."""
    return eased(t, [rise, top, leave, end], [0, 1, 1, 0])


def bump(t: Track, start: float, end: float) -> Track:
    """From 0 at the start to 1 half-way and back to 0 at the end."""
    s = np.clip((t - start) / (end - start), 0.0, 1.0)
    return np.sin(np.pi * s) ** 4


def columns(*tracks: ArrayLike) -> Track:
    """(frames, number of tracks), from tracks and constants."""
    return np.stack(np.broadcast_arrays(*tracks), axis=-1).astype(float)
