"""Calls side by side in threads of this process: compiled functions and most of numpy let other threads run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import starmap
from typing import TypeVar

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
