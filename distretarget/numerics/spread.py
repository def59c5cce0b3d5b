"""Few of many points, spread evenly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def spread_out(points: NDArray[np.float64], most: int) -> NDArray[np.intp]:
    """Return the numbers of at most `most` of the points, (points, dimensions), the first one and then always the one
    farthest from those before it.
    """
    chosen, away = [0], np.full(len(points), np.inf)
    while len(chosen) < min(most, len(points)):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(away.argmax()))
    return np.array(chosen, np.intp)
