"""The joints that two bodies share, and the distances between them.

D is the distance of two joints divided by the length of the bone path between them, |P| the number of joints on that
path.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.matching.matching import Matching
from distretarget.motion import Motion

Array = NDArray[np.float64]


def points_of(matching: Matching) -> NDArray[np.intp]:
    """The joints and End Sites of the target that stand for a place of their own on one of the bodies."""
    source, result, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    shared = np.flatnonzero(drivers >= 0)
    apart = (result.path_lengths > 0)[np.ix_(shared, shared)]
    apart |= (source.path_lengths > 0)[np.ix_(drivers[shared], drivers[shared])]
    first = np.array([np.flatnonzero(~row)[0] for row in apart])
    return np.asarray(shared[first == np.arange(len(shared))])


def normalised_distances(motion: Motion, u: NDArray[np.intp], v: NDArray[np.intp], frames: slice) -> Array:
    """D, (frames, pairs), of joints u and v, (pairs,) each; nan where the path between them has no length."""
    tau = motion.rigid_skeleton.path_lengths[u, v]
    x, y, z = np.ascontiguousarray(np.moveaxis(motion.positions[frames], -1, 0))  # eight times as fast as a norm
    squared = (x[:, u] - x[:, v]) ** 2 + (y[:, u] - y[:, v]) ** 2 + (z[:, u] - z[:, v]) ** 2
    return np.asarray(np.sqrt(squared) / np.where(tau > 0, tau, np.nan))
