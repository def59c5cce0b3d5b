"""Where the target stands: the scale of its root's path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body import find_legs, leg_length
from distretarget.skeleton import Skeleton


def root_scale(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> float:
    """How many target units the root travels for each source unit: the ratio of leg lengths, which keeps stride and
    height in proportion; for bodies without legs the ratio of their largest path lengths.

    The target's legs are found from its tree and their drivers measured on the source.
    """
    shared = np.flatnonzero(drivers >= 0)
    legs = find_legs(target)
    if legs and all(drivers[leg.hip] >= 0 and drivers[leg.ankle] >= 0 for leg in legs):
        ours = sum(leg_length(target, leg) for leg in legs)
        theirs = sum(source.path_lengths[drivers[leg.hip], drivers[leg.ankle]] for leg in legs)
    else:
        ours = target.path_lengths[np.ix_(shared, shared)].max()
        theirs = source.path_lengths[np.ix_(drivers[shared], drivers[shared])].max()
    return float(ours / theirs) if theirs > 0 else 1.0
