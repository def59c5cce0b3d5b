"""The distance between a ball and a tapered capsule. Compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined

Array = NDArray[np.float64]

LEAST = 1e-9  # a shorter axis is a point, and a smaller distance has no direction [any unit of length]
MOST_TAPER = 0.99  # of the radius per length of the axis; beyond, the larger ball holds the smaller


@inlined(fastmath=True)
def place_on_axis(p: Array, ends: Array, radii: Array) -> float:
    """Return where on the axis of a tapered capsule the ball is that is nearest to the point p, (3,), from 0 to 1.

    With z along the axis of length L and h across it, the distance sqrt(h^2 + (z - L t)^2) - (1 - t) r_0 - t r_1 is
    least where L t = z + c h / sqrt(1 - c^2), c = (r_1 - r_0) / L. `ends` are (2, 3), `radii` (2,).
    """
    ux, uy, uz = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1], ends[1, 2] - ends[0, 2]
    wx, wy, wz = p[0] - ends[0, 0], p[1] - ends[0, 1], p[2] - ends[0, 2]
    square = ux * ux + uy * uy + uz * uz
    if square < LEAST * LEAST:
        return 1.0 if radii[1] > radii[0] else 0.0
    length, along = np.sqrt(square), wx * ux + wy * uy + wz * uz
    taper = (radii[1] - radii[0]) / length
    taper = max(min(taper, MOST_TAPER), -MOST_TAPER)
    across = max(wx * wx + wy * wy + wz * wz - along * along / square, 0.0)
    t = along / square + taper * np.sqrt(across / (1.0 - taper * taper)) / length
    return float(max(min(t, 1.0), 0.0))
