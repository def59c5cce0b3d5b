"""Smooth discontinuities: solution flips and floor impacts."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.kinematics import steps_along
from distretarget.numerics.time_series import averaged, widened
from distretarget.numerics.vectors import lengths
from distretarget.objectives.settings import ContactSettings

Array = NDArray[np.float64]


def smooth_jumps(v: Array, frame_time: float, settings: ContactSettings) -> None:
    """Let no part jump in poses (frames, parts + 1, 3), which are changed in place.

    A part jumps where its deviation changes faster than `settings.jump_speed`. Where it stays after the jump, its
    deviation becomes a mean over the frames around (a raised cosine). A spike of one or two frames is not a jump, and
    is left as it is. `frame_time` is in [s].
    """
    limit = settings.jump_speed * frame_time
    parts = np.flatnonzero(_jumps(v, limit)[:, :-1].any(axis=0))
    if not len(parts):
        return
    lasting = _without_spikes(v[:, parts])
    jumps = _jumps(lasting, limit)
    reach = round(settings.jump_blend / frame_time)
    share = widened(np.maximum(jumps, np.roll(jumps, 1, axis=0)), reach)[..., None]
    v[:, parts] += share * (averaged(lasting, reach) - v[:, parts])


def smooth_landings(v: Array, parts: NDArray[np.intp], frame_time: float, settings: ContactSettings) -> None:
    """Let nothing stop some parts suddenly, which only the floor moves: in poses (frames, parts + 1, 3), which are
    changed in place, their deviation becomes a mean over the frames around. `frame_time` is in [s].
    """
    moved = parts[v[:, parts].any(axis=(0, 2))]
    if len(moved):
        v[:, moved] = averaged(v[:, moved], round(settings.jump_blend / frame_time))


def _jumps(v: Array, limit: float) -> Array:
    """(frames, parts), 1 where the deviation v, (frames, parts, 3), of a part changes by more than `limit` [rad] to the
    next frame, else 0.
    """
    jumps = np.zeros(v.shape[:2])
    jumps[:-1] = steps_along(v) > limit
    return jumps


def _without_spikes(v: Array) -> Array:
    """Of each five frames around a frame the deviation that is nearest to all others: their median, which turns with
    the world.
    """
    frames, padded = len(v), np.pad(v, ((2, 2), (0, 0), (0, 0)), mode="edge")
    apart = [lengths(padded[lag:] - padded[: len(padded) - lag]) for lag in range(1, 5)]  # by how many frames between
    away = np.zeros((5, *v.shape[:2]))
    for one, other in combinations(range(5), 2):
        between = apart[other - one - 1][one : one + frames]
        away[one] += between
        away[other] += between
    chosen = np.argmin(away, axis=0)
    return np.asarray(padded[np.arange(frames)[:, None] + chosen, np.arange(v.shape[1])])
