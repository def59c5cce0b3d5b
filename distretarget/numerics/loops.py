"""Loops over arrays. Compiled; they compile in a tenth of the time of numba's slices and assignments to these."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined


@inlined()
def copy_to(target: NDArray[np.float64], source: NDArray[np.float64]) -> None:
    """target[:] = source, for contiguous arrays of one shape."""
    flat_source, flat_target = source.flat, target.flat
    for i in range(source.size):
        flat_target[i] = flat_source[i]


@inlined()
def clear(array: NDArray[Any]) -> None:
    """array[:] = 0, for a contiguous array."""
    flat = array.flat
    for i in range(array.size):
        flat[i] = 0


@inlined()
def indices(first: int, end: int) -> range:
    """The indices from `first` to `end`, which is not one of them; neither may be negative.

    They are unsigned: numba need not ask whether they count from the end of an array, so that loops over rows are made
    for vectors.
    """
    return range(np.uintp(first), np.uintp(end))
