"""The unit of a file, guessed from the size of the body in it."""

from __future__ import annotations

import math

ADULT = 170.0  # the body unit of an adult, twice the leg's length [cm]
UNITS = (100.0, 1.0, 0.1, 2.54 / 0.45)  # m, cm, mm, and that of the CMU data base [cm]


def centimetres(unit: float) -> float:
    """Return how many centimetres a file's unit is: that of `UNITS` in which the body is most like an adult's size.

    `unit` is the body unit [file units].
    """
    return min(UNITS, key=lambda each: abs(math.log(max(unit, 1e-9) * each / ADULT)))
