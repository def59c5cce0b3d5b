"""Where the skins of two parts of a body are nearest to each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, read_only
from distretarget.skin.balls import NEVER, Balls, gap_between, place_ball
from distretarget.skin.closest import LEAST, place_on_axis

Array = NDArray[np.float64]


def nearest_skin(balls: Balls, posed: Array, pairs: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the least gap of some `pairs` of segments in each frame, (frames,), and the direction there from the
    capsules to the balls, (frames, 3). Capsules end at `posed`, (frames, capsules, 2, 3); gaps are as in
    `balls.segment_gaps`.
    """
    gaps, away = np.full(len(posed), NEVER), np.zeros((len(posed), 3))
    _write_nearest(balls, read_only(posed), pairs, gaps, away, np.zeros(3))
    return gaps, away


@compiled()
def _write_nearest(balls, posed, pairs, gaps, away, p):  # type: ignore[no-untyped-def]
    for frame in range(len(posed)):
        for pair in pairs:
            a, b = balls.pairs[pair, 0], balls.pairs[pair, 1]
            for ball in range(balls.of_ball[a], balls.of_ball[a + 1]):
                place_ball(balls, ball, posed[frame], p)
                for capsule in range(balls.of_capsule[b], balls.of_capsule[b + 1]):
                    if balls.spare[ball, capsule] >= NEVER:
                        continue
                    ends, radii = posed[frame, capsule], balls.cap_radii[capsule]
                    gap = gap_between(p, balls.radii[ball], ends, radii) - balls.spare[ball, capsule]
                    if gap < gaps[frame]:
                        gaps[frame], t, square = gap, place_on_axis(p, ends, radii), 0.0
                        for i in range(3):
                            away[frame, i] = p[i] - (1.0 - t) * ends[0, i] - t * ends[1, i]
                            square += away[frame, i] ** 2
                        for i in range(3):
                            away[frame, i] /= max(np.sqrt(square), LEAST)
