"""Calls side by side in threads of this process: compiled functions and most of numpy let other threads run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise, starmap
from typing import TypeVar

import numpy as np

FEWEST_JOINTS = 150_000  # joints of all frames that are worth a thread

Result = TypeVar("Result")


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(function: Callable[..., Result], *arguments: Iterable[object]) -> Iterator[Result]:
    """Call a function on arguments, as `map` does, in as many threads as there are cores; results come in order."""
    calls = list(zip(*arguments, strict=True))
    workers = min(cores(), len(calls))
    if workers < 2:
        yield from starmap(function, calls)
        return
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(lambda call: function(*call), calls)


def over_frames(compute: Callable[[slice], object], frames: int, joints: int) -> None:
    """Call a function that computes each frame on its own for all frames of a clip with so many joints: those of a long
    one in parts of it, side by side.
    """
    parts = min(cores(), frames * joints // FEWEST_JOINTS)
    edges = np.linspace(0, frames, max(parts, 1) + 1).astype(int).tolist()
    own, *others = [slice(first, end) for first, end in pairwise(edges)]
    if not others:
        compute(own)
        return
    with ThreadPoolExecutor(len(others)) as pool:
        computed = [pool.submit(compute, part) for part in others]
        compute(own)
    for each in computed:
        each.result()
