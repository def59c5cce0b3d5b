"""Smooth discontinuities: solution flips and floor impacts.

A flip is a change of a part's deviation from the rotation copy that is faster than `FLIP_SPEED` and lasts. Frames
around it get a moving average (raised cosine). Spikes of one or two frames stay. Nothing is averaged across cuts.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.joint_paths import steps_along
from distretarget.numerics.time_series import Shots, averaged, slices_of, widened
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]

FLIP_SPEED = 60.0 * math.radians(4.0)  # [rad/s]
HELD_FLIP_SPEED = 60.0 * math.radians(10.0)  # of parts whose ends rest on something: smoothing moves them [rad/s]
BLEND = 0.15  # deviations are averaged over this time before and after a flip [s] ...
LANDING_BLEND = 0.1  # ... and over this where the floor stops a part


def smooth_flips(v: Array, held: Array, shots: Shots, frame_time: float) -> None:
    """Smooth the flips of all parts in poses (frames, parts + 1, 3), in place.

    `held`, (frames, parts), is 1 while a joint below a part rests on something, blended to 0; `frame_time` is in [s].
    """
    reach = round(BLEND / frame_time)
    for shot, of_shot in ((v[frames], held[frames]) for frames in slices_of(shots)):
        parts = np.flatnonzero(_flips(shot, FLIP_SPEED * frame_time)[:, :-1].any(axis=0))
        if len(parts):
            lasting = _without_spikes(shot[:, parts])
            free, fast = (
                widened(np.maximum(flips, np.roll(flips, 1, axis=0)), reach)
                for flips in (_flips(lasting, speed * frame_time) for speed in (FLIP_SPEED, HELD_FLIP_SPEED))
            )
            share = np.maximum(fast, free * (1.0 - of_shot[:, parts]))[..., None]
            shot[:, parts] += share * (averaged(lasting, reach) - shot[:, parts])


def smooth_landings(v: Array, parts: NDArray[np.intp], shots: Shots, frame_time: float) -> None:
    """Smooth the floor impacts of `parts`, which only the floor moves, in poses (frames, parts + 1, 3), in place."""
    for shot in map(v.__getitem__, slices_of(shots)):
        moved = parts[shot[:, parts].any(axis=(0, 2))]
        if len(moved):
            shot[:, moved] = averaged(shot[:, moved], round(LANDING_BLEND / frame_time))


def _flips(v: Array, limit: float) -> Array:
    """(frames, parts), 1 where v, (frames, parts, 3), changes by more than `limit` [rad] to the next frame, else 0."""
    flips = np.zeros(v.shape[:2])
    flips[:-1] = steps_along(v) > limit
    return flips


def _without_spikes(v: Array) -> Array:
    """The geometric median of v over five frames: the deviation with the least summed distance to the others. Unlike a
    median of components it does not depend on the axes.
    """
    frames, padded = len(v), np.pad(v, ((2, 2), (0, 0), (0, 0)), mode="edge")
    apart = [lengths(padded[lag:] - padded[: len(padded) - lag]) for lag in range(1, 5)]  # by the lag in frames
    away = np.zeros((5, *v.shape[:2]))
    for one, other in combinations(range(5), 2):
        between = apart[other - one - 1][one : one + frames]
        away[one] += between
        away[other] += between
    chosen = np.argmin(away, axis=0)
    return np.asarray(padded[np.arange(frames)[:, None] + chosen, np.arange(v.shape[1])])
