"""What joints that touch fell short of their places in a sweep, made up for in the next.

A body of finite stiffness stops short of the places that its springs draw it to. The next sweep draws it further by as
much, as the method of multipliers does (M. J. D. Powell, A method for nonlinear constraints in minimization problems,
1969). Each region of the body counts as a whole: a hand that holds a larger one cannot have all its joints in their
places, and drawing further would only tear at it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.vectors import lengths
from distretarget.solve.springs import Springs

Array = NDArray[np.float64]

MOST = 0.01  # joints are drawn no further beyond their places: what is out of reach stays so [body units]
NOTHING = 1e-12  # a smaller stiffness is none


def with_shortfall(springs: Springs, before: Springs, x: Array, regions: NDArray[np.intp]) -> Springs:
    """Return the springs of the next sweep, drawing further by what the regions fell short in the last.

    `before` are the springs of the last sweep, on the same joints, and `x`, (frames, joints, 3), the positions that
    they led to [body units]; `regions` are of all joints.
    """
    short = before.rest - x[:, before.a]
    weights = np.trace(before.A, axis1=-2, axis2=-1)[..., None]
    rest = np.array(springs.rest)
    for region in np.unique(regions[before.a]):
        of_region = regions[before.a] == region
        total = weights[:, of_region].sum(axis=1)
        mean = (weights[:, of_region] * short[:, of_region]).sum(axis=1) / np.maximum(total, NOTHING)
        mean *= np.minimum(MOST / np.maximum(lengths(mean), NOTHING), 1.0)[:, None]
        rest[:, of_region] += mean[:, None]
    return springs._replace(rest=rest)
