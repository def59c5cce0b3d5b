"""Work in blocks of frames, in parallel threads: compiled functions and most of numpy release the interpreter lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import starmap
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Value = TypeVar("Value", bound=np.generic)
Result = TypeVar("Result")

LIMIT = "OMP_NUM_THREADS"  # the environment variable that limits threads
BLOCK_FRAMES = 384  # most frames of a block
FEWEST_JOINTS = 150_000  # the least work that is worth a thread [frames x joints]


def blocks_of(frames: int) -> Iterator[slice]:
    """Yield the frames of a clip in blocks of about equal length, at most `BLOCK_FRAMES`; none for an empty clip."""
    blocks = -(-frames // BLOCK_FRAMES)
    for block in range(blocks):
        yield slice(frames * block // blocks, frames * (block + 1) // blocks)


def in_blocks(compute: Callable[[slice], NDArray[Value]], frames: int) -> NDArray[Value]:
    """The results of `compute` for the blocks of a clip, concatenated into one preallocated array."""
    first, *others = list(blocks_of(frames)) or [slice(0, 0)]
    values = compute(first)
    joined = np.empty((frames, *values.shape[1:]), values.dtype)
    joined[first] = values
    for block in others:
        joined[block] = compute(block)
    return joined


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def threads() -> int:
    """Return the number of threads to use: one per core, or fewer if OMP_NUM_THREADS says so."""
    limit = os.environ.get(LIMIT, "").strip()
    return min(cores(), max(int(limit), 1)) if limit.isdecimal() else cores()


@contextmanager
def thread_limit(count: int | None) -> Iterator[None]:
    """Limit the threads within to `count`; None sets no limit."""
    before = os.environ.get(LIMIT)
    if count:
        os.environ[LIMIT] = str(count)
    try:
        yield
    finally:
        if count and before is None:
            del os.environ[LIMIT]
        elif count:
            os.environ[LIMIT] = str(before)


def in_threads(function: Callable[..., Result], *arguments: Iterable[object]) -> Iterator[Result]:
    """Call a function like `map`, in parallel threads; results come in order."""
    calls = list(zip(*arguments, strict=True))
    workers = min(threads(), len(calls)) if len(calls) > 1 else 1
    if workers < 2:
        yield from starmap(function, calls)
        return
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(lambda call: function(*call), calls)


def mapper_for(frames: int, joints: int) -> Callable[..., Iterable[Any]]:
    """Return `in_threads` for a clip that is worth several threads, else `map`."""
    return in_threads if _threads_for(frames, joints) > 1 else map


def over_blocks(compute: Callable[[slice], object], frames: int, joints: int) -> None:
    """Call `compute` for all blocks of a clip, in parallel if the clip is long; blocks must be independent."""
    blocks, parts = list(blocks_of(frames)), _threads_for(frames, joints)

    def compute_part(part: int) -> None:
        for block in blocks[len(blocks) * part // parts : len(blocks) * (part + 1) // parts]:
            compute(block)

    if parts == 1:
        compute_part(0)
        return
    for _ in in_threads(compute_part, range(parts)):
        pass


def _threads_for(frames: int, joints: int) -> int:
    """The number of threads for a clip of this size."""
    worth = frames * joints // FEWEST_JOINTS
    return min(threads(), worth) if worth > 1 else 1
