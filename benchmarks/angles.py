"""The angle between vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def angles(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...), the angles between vectors (..., 3) [degrees]."""
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, np.sum(a * b, axis=-1))))
