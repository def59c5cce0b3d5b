"""How far postures are from what was asked of them: bone lengths, distances, directions of bones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from paper_case import Case

Array = NDArray[np.float64]


def bones_of(points: Array, case: Case) -> Array:
    """(..., bones, 3), the bones of postures (..., joints, 3), from parent to joint."""
    return np.asarray(points[..., 1:, :] - points[..., case.target.parents[1:], :])


def bone_errors(points: Array, case: Case) -> Array:
    """(..., bones), how far the bones of postures (..., joints, 3) are off the target's lengths [relative]."""
    return np.asarray(np.abs(np.linalg.norm(bones_of(points, case), axis=-1) / case.target.lengths[1:] - 1))


def distance_error(points: Array, source: Array, case: Case) -> Array:
    """(...), the mean of |D_source - D_result| over all pairs, Eq. (1), of postures (..., joints, 3)."""
    u, v = np.triu_indices(len(case.target), 1)
    D_source, D_result = (
        np.linalg.norm(x[..., u, :] - x[..., v, :], axis=-1) / tau[u, v]
        for x, tau in ((source, case.problem.tau1), (points, case.problem.tau2))
    )
    return np.asarray(np.abs(D_source - D_result).mean(axis=-1))


def direction_errors(points: Array, source: Array, case: Case) -> Array:
    """(..., bones), angles between the bones of postures (..., joints, 3) and the source's [degrees]."""
    return angles(bones_of(points, case), bones_of(source, case))


def angles(a: Array, b: Array) -> Array:
    """(...), angles between vectors (..., 3) [degrees]."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))
