"""Where the target stands: the scale of its root's path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body import leg_length, shared_legs
from distretarget.skeleton import Skeleton


def root_scale(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> float:
    """How many target units the root travels for each source unit: the ratio of leg lengths, which keeps stride and
    height in proportion; for bodies without legs the ratio of their largest path lengths.

    The target's legs are found from its tree and their drivers measured on the source.
    """
    legs = shared_legs(target, drivers)
    if legs:
        ours, theirs = (leg_length(body, pair) for body, pair in zip((target, source), legs, strict=True))
    else:
        shared = np.flatnonzero(drivers >= 0)
        ours = target.path_lengths[np.ix_(shared, shared)].max()
        theirs = source.path_lengths[np.ix_(drivers[shared], drivers[shared])].max()
    return float(ours / theirs) if theirs > 0 else 1.0
