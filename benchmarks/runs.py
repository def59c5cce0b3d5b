"""How benchmarks run things: by several processes, alone in a process with one thread, and by turns for their times."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from timeit import timeit
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

PROCESSES = 2  # of what does not measure times
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # set to 1 before numpy is imported

Arguments, Result = ParamSpec("Arguments"), TypeVar("Result")


def in_processes(function: Callable[..., Result], tasks: Iterable[tuple[object, ...]]) -> list[Result]:
    """The results of a function for the arguments of each task, computed by several processes."""
    with ProcessPoolExecutor(PROCESSES) as pool:
        return list(pool.map(function, *zip(*tasks, strict=True)))


def clip_name(clip: Path) -> str:
    """The name of a clip, with its folder."""
    return f"{clip.parent.name}/{clip.stem}"


def alone(function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
    """The result of a function, computed in a new process whose libraries use one thread."""
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(function, *args, **kwargs).result()


def alternating(
    runs: Sequence[Callable[[], object]],
    rounds: int,
    clock: Callable[[], float] = time.process_time,
    repeats: Sequence[int] | None = None,
) -> NDArray[np.float64]:
    """(rounds, runs), the seconds of each run, the mean of its repeats; a first round is not counted."""
    counts = repeats or [1] * len(runs)

    def one_round() -> list[float]:
        return [timeit(run, timer=clock, number=count) / count for run, count in zip(runs, counts, strict=True)]

    return np.array([one_round() for _ in range(1 + rounds)])[1:]
