"""The gap between a ball and a tapered capsule. Compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined

Array = NDArray[np.float64]

LEAST = 1e-9  # a shorter axis is a point, and a smaller distance has no direction [any unit of length]
MOST_TAPER = 0.99  # of the radius per length of the axis; beyond, the larger ball holds the smaller
HOLDS = 1e9  # stands for the last number of an axis that is a point with the larger radius at its end


@inlined(fastmath=True)
def write_axis(ends: Array, radii: Array, axis: Array) -> None:
    """Write what `gap_at` needs of a tapered capsule, (8,): one end of its axis, the way to the other, and with the
    length L and the taper c = (r_1 - r_0) / L also 1 / L^2 and c / sqrt(1 - c^2) / L. `ends` are (2, 3), `radii` (2,).
    """
    square = 0.0
    for i in range(3):
        axis[i] = ends[0, i]
        axis[3 + i] = ends[1, i] - ends[0, i]
        square += axis[3 + i] ** 2
    axis[6] = 1.0 / square if square > LEAST * LEAST else 0.0
    taper = max(min((radii[1] - radii[0]) * np.sqrt(axis[6]), MOST_TAPER), -MOST_TAPER)
    axis[7] = taper * np.sqrt(axis[6] / (1.0 - taper * taper))
    if axis[6] == 0.0 and radii[1] > radii[0]:
        axis[7] = HOLDS


@inlined(fastmath=True)
def gap_at(p, radius, axis, radii):  # type: ignore[no-untyped-def]
    """The gap between a ball about p, (3,), and a tapered capsule, negative where they overlap; where on its axis the
    ball of the capsule is that is nearest, from 0 to 1; and the direction from there to p.

    With z along the axis of length L and h across it, the distance sqrt(h^2 + (z - L t)^2) - (1 - t) r_0 - t r_1 is
    least where L t = z + c h / sqrt(1 - c^2).
    """
    wx, wy, wz = p[0] - axis[0], p[1] - axis[1], p[2] - axis[2]
    along = (wx * axis[3] + wy * axis[4] + wz * axis[5]) * axis[6]
    across = max(wx * wx + wy * wy + wz * wz - along * along / max(axis[6], LEAST), 0.0)
    t = max(min(along + axis[7] * np.sqrt(across), 1.0), 0.0)
    x, y, z = wx - t * axis[3], wy - t * axis[4], wz - t * axis[5]
    distance = np.sqrt(x * x + y * y + z * z)
    inverse = 1.0 / max(distance, LEAST)
    return distance - radii[0] - t * (radii[1] - radii[0]) - radius, t, inverse * x, inverse * y, inverse * z
