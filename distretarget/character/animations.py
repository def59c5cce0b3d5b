"""Keyframe animations: the choice of one in a file, its frame rate, and the times of its frames.

The process that reads FBX imports this, so it imports nothing that takes long.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from distretarget.errors import FileError, closest, cut, quoted
from distretarget.numerics.vectors import Array

USUAL_RATES = (24, 25, 30, 48, 50, 60, 90, 100, 120, 200, 240)  # usual frame rates [frames/s]
LEAST_RATE, MOST_RATE = 9.9, 1000.0  # keys at other rates are not one per frame [frames/s]
IRREGULAR_RATE = 60.0  # the rate for keys that fit none [frames/s]
ON_GRID = 0.02  # a key this near to a frame is on it [frames]
SAME_KEY = 1e-5  # keys this near to each other are at the same time [s]; times are float32


def choose_animation(path: str | Path, names: Sequence[str], clip: str | None) -> int | None:
    """Return the index of the animation named `clip`, "#2" being the second, or of the only one; None without any. A
    FileError if there is no such animation, or if `clip` is None and there are several.
    """
    times = Counter(names)
    shown = [name if name and times[name] == 1 else f"#{number}" for number, name in enumerate(names, start=1)]
    if clip is None:
        if len(names) > 1:
            listed = quoted(shown, 12)
            raise FileError(path, f"has {len(names)} animations: {listed}; choose one with --clip NAME")
        return 0 if names else None
    if clip in shown:
        return shown.index(clip)
    if clip.startswith("#") and clip[1:].isdecimal() and 0 < int(clip[1:]) <= len(names):
        return int(clip[1:]) - 1
    raise FileError(path, f"has no animation {cut(clip)!r}; {closest(clip, shown) if names else 'it has none'}")


def frame_count(keys: Array, rate: float) -> float:
    """Return the number of frames from the first to the last key; a float, as it may be huge."""
    return float(np.floor((keys[-1] - keys[0]) * rate + ON_GRID) + 1.0)


def frame_times(keys: Array, rate: float) -> Array:
    """Return the times of the frames from the first key to the last, each moved to a key that is near [s]."""
    times = keys[0] + np.arange(int(frame_count(keys, rate))) / rate
    after = np.searchsorted(keys, times).clip(0, len(keys) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(times - keys[before] < keys[after] - times, keys[before], keys[after])
    return np.asarray(np.where(np.abs(nearest - times) < ON_GRID / rate, nearest, times))


def own_rate(keys: Array, stated: float | None = None) -> float:
    """Return the slowest rate, at least `LEAST_RATE`, whose frames have all keys, else the `stated` or a usual one."""
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
    return next((float(rate) for rate in (*likely, *USUAL_RATES) if is_on_grid(keys, rate)), stated or IRREGULAR_RATE)


def _refined(keys: Array, rate: float) -> float:
    """The rate that fits all keys best."""
    frames = np.rint((keys - keys[0]) * rate)
    for _ in range(3):  # frame numbers by a rough rate are wrong late in the clip; each fit extends the right ones
        near = np.abs((keys - keys[0]) * rate - frames) < 0.25
        last = len(near) - 1 if near.all() else int(near.argmin()) - 1
        if frames[last] > 0:
            rate = float(frames[last] / (keys[last] - keys[0]))
        frames = np.rint((keys - keys[0]) * rate)
    return rate


def is_on_grid(keys: Array, rate: float) -> bool:
    """Return whether all keys, ascending [s], are on frames of a rate, counted from the first key."""
    frames = (keys - keys[0]) * rate
    return bool((np.abs(frames - np.rint(frames)) < ON_GRID).all())
