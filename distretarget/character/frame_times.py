"""The frames of an animation with keys: at which rate they are, and at which times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATES = (24, 25, 30, 48, 50, 60, 90, 100, 120, 200, 240)  # usual frame rates [frames/s]
LEAST_RATE, MOST_RATE = 9.9, 1000.0  # keys at other rates are no frames [frames/s]
IRREGULAR_RATE = 60.0  # of keys that are on no such grid [frames/s]
ON_GRID = 0.02  # a key is on a grid within this [frames]
SAME_KEY = 1e-5  # keys this near to each other are at the same time [s]; times are float32


def frame_count(keys: Array, rate: float) -> float:
    """Return how many frames keys at some times last; it may be too many for an integer."""
    return float(np.floor((keys[-1] - keys[0]) * rate + ON_GRID) + 1.0)


def frame_times(keys: Array, rate: float) -> Array:
    """Return the times of the frames from the first key to the last, each moved to a key that is near, so that rounding
    puts no frame before its key; all in [s].
    """
    times = keys[0] + np.arange(int(frame_count(keys, rate))) / rate
    after = np.searchsorted(keys, times).clip(0, len(keys) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(times - keys[before] < keys[after] - times, keys[before], keys[after])
    return np.asarray(np.where(np.abs(nearest - times) < ON_GRID / rate, nearest, times))


def own_rate(keys: Array, stated: float | None = None) -> float:
    """Return the frame rate of keys at some times, (keys,), ascending [s]: the slowest of at least `LEAST_RATE` on
    whose frames all of them are, else the rate that the file has `stated`, or a usual one [frames/s].
    """
    steps = np.diff(keys)
    steps = steps[steps > SAME_KEY]
    if not len(steps):
        return stated or 30.0
    own = 1.0 / steps[steps < 1.05 * steps.min()].mean()
    if LEAST_RATE <= own <= MOST_RATE:
        own = _refined(keys, own)
        for rate in (float(round(own)), own):
            if is_on_grid(keys, rate):
                return rate
    likely = [stated] if stated else []
    return next((float(rate) for rate in (*likely, *RATES) if is_on_grid(keys, rate)), stated or IRREGULAR_RATE)


def _refined(keys: Array, rate: float) -> float:
    """The rate that fits all keys best."""
    frames = np.rint((keys - keys[0]) * rate)
    for _ in range(3):  # a rough rate counts late frames wrong; each fit reaches farther
        near = np.abs((keys - keys[0]) * rate - frames) < 0.25
        last = len(near) - 1 if near.all() else int(near.argmin()) - 1
        if frames[last] > 0:
            rate = float(frames[last] / (keys[last] - keys[0]))
        frames = np.rint((keys - keys[0]) * rate)
    return rate


def is_on_grid(keys: Array, rate: float) -> bool:
    """Return whether all keys, ascending [s], are on frames of a rate that begin with the first."""
    frames = (keys - keys[0]) * rate
    return bool((np.abs(frames - np.rint(frames)) < ON_GRID).all())
