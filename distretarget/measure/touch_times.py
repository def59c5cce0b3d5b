"""How much earlier or later than in the source touches begin and end."""

from __future__ import annotations

import numpy as np

from distretarget.numerics.time_series import spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers

AROUND = 0.25  # a touch of the result is looked for so long before and after one of the source [s]


def around(times: Array, touching: Flags) -> Flags:
    """Return the frames, at `times`, (frames,) [s], in which a touch may begin early or end late, (frames, ...)."""
    near = touching.copy()
    for column in np.ndindex(touching.shape[1:]):
        for first, end in spans_of(touching[(slice(None), *column)]):
            begin, last = np.searchsorted(times, (times[first] - AROUND, times[end - 1] + AROUND))
            near[(slice(begin, last + 1), *column)] = True
    return near


def off_times(times: Array, source: Flags, result: Flags) -> tuple[Array, Numbers]:
    """Return how far the begins and ends of the touches of one limb and place are off, in the frames where those of the
    source are, (frames,) [ms], and how many are there, (frames,).

    What a result touches is looked for from the first and the last frame in which both touch. A touch that the result
    never has does not count, nor does what happens before the first frame or after the last.
    """
    off, counts = np.zeros(len(times)), np.zeros(len(times), np.intp)
    runs = np.array(list(spans_of(result))).reshape(-1, 2)
    for first, end in spans_of(source):
        both = runs[(runs[:, 0] < end) & (runs[:, 1] > first)]
        if not len(both):
            continue
        if first > 0:
            off[first] += 1000.0 * abs(times[both[0, 0]] - times[first])
            counts[first] += 1
        if end < len(times):
            off[end - 1] += 1000.0 * abs(times[both[-1, 1] - 1] - times[end - 1])
            counts[end - 1] += 1
    return off, counts
