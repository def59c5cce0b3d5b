"""Where the skins of two parts of a body are nearest to each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, read_only
from distretarget.skin.balls import NEVER, Balls
from distretarget.skin.meetings import find_meetings, gap_of, place, room_for

Array = NDArray[np.float64]


def nearest_skin(balls: Balls, posed: Array, pairs: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the least gap of some `pairs` of segments in each frame, (frames,), and the direction there from the
    capsules to the balls, (frames, 3). Capsules end at `posed`, (frames, capsules, 2, 3); gaps are as in
    `meetings.segment_gaps`.
    """
    gaps, away = np.full(len(posed), NEVER), np.zeros((len(posed), 3))
    _write_nearest(balls, read_only(posed), pairs, room_for(balls), gaps, away)
    return gaps, away


@compiled()
def _write_nearest(balls, posed, pairs, placed, gaps, away):  # type: ignore[no-untyped-def]
    for frame in range(len(posed)):
        place(balls, posed[frame], placed)
        for pair in pairs:
            for meeting in range(find_meetings(balls, pair, gaps[frame], placed)):
                gap, _, x, y, z = gap_of(balls, placed.meetings[meeting, 0], placed.meetings[meeting, 1], placed)
                if gap < gaps[frame]:
                    gaps[frame], away[frame, 0], away[frame, 1], away[frame, 2] = gap, x, y, z
