"""Which source joint drives which target joint."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import MatchingError
from distretarget.skeleton import Skeleton


def match(source: Skeleton, target: Skeleton, explicit: Mapping[str, str] | None = None) -> NDArray[np.intp]:
    """(target joints,), the number of the source joint that drives each target joint; -1 for an End Site that has
    no counterpart.

    A joint is driven by the one that `explicit`, {target key: source key}, names, else by the one with the same
    key; the End Sites of a joint by those of its driver, in order.

    Raises:
        MatchingError: the source lacks a joint; the message names it and the closest ones.
    """
    explicit = explicit or {}
    numbers = {key: joint for joint, key in enumerate(source.keys) if not source.end_sites[joint]}
    wanted = {joint: explicit.get(key, key) for joint, key in enumerate(target.keys) if not target.end_sites[joint]}
    missing = [key for key in wanted.values() if key not in numbers]
    if missing:
        raise MatchingError(missing, list(numbers))
    drivers = np.full(len(target), -1, dtype=np.intp)
    for joint, key in wanted.items():
        drivers[joint] = numbers[key]
    for joint in wanted:
        below = zip(_end_sites(target, joint), _end_sites(source, int(drivers[joint])), strict=False)
        for end, driver in below:
            drivers[end] = driver
    return drivers


def _end_sites(skeleton: Skeleton, joint: int) -> list[int]:
    return [child for child in skeleton.children[joint] if skeleton.end_sites[child]]
