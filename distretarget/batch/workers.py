"""The workers that retarget clips, a few jobs at a time: processes of this machine, or a Dask cluster (`cluster`).

Both have an executor of `concurrent.futures`.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from concurrent.futures.process import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from multiprocessing.util import get_temp_dir
from pathlib import Path
from typing import Protocol

from distretarget.batch.job import Job, Result, convert
from distretarget.errors import BatchError
from distretarget.numerics.interrupts import interrupts_held
from distretarget.pipeline.compile_ahead import warm_for_others
from distretarget.pipeline.options import Objective

# These set the threads of a process: workers have one each, as there is a worker for each core.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CHECK_INTERVAL = 5.0  # after this time without a result, check whether a worker has died [s]
QUEUED = 2  # jobs submitted at a time, running or waiting [jobs per worker]


class Workers(Protocol):
    """Workers: their number, the time that their start took [s], and the executor that hands jobs to them."""

    count: int
    start_seconds: float

    @property
    def executor(self) -> Executor: ...

    def lost(self) -> bool:
        """Return whether a worker has died; called every `CHECK_INTERVAL` while no results come."""

    def close(self) -> None:
        """Release the workers at once, even if they are busy; the next use of the executor starts others."""


class Processes:
    """Processes on this machine."""

    def __init__(self, count: int, objective: Objective) -> None:
        """Prepare to start this many processes, for an objective."""
        self.count, self.start_seconds = count, 0.0
        self._objective = objective
        self._executor: ProcessPoolExecutor | None = None
        # Not "fork": a process with threads, which numerical libraries start, must not be forked.
        methods = multiprocessing.get_all_start_methods()
        self._context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
        if "forkserver" in methods:
            self._context.set_forkserver_preload(["distretarget.batch.warmed"])
            with _worker_environment():
                resource_tracker.ensure_running()  # before another library starts it in another environment

    @property
    def executor(self) -> ProcessPoolExecutor:
        """The processes, started when first used.

        This process compiles the code, and the others find it in the folder of compiled code.
        """
        if self._executor is None:
            started = time.perf_counter()
            warm_for_others(self._objective)
            with _worker_environment():
                self._executor = ProcessPoolExecutor(self.count, self._context, _start_worker, (get_temp_dir(),))
                wait([self._executor.submit(os.getpid) for _ in range(self.count)])  # starts the processes
            self.start_seconds += time.perf_counter() - started
        return self._executor

    def lost(self) -> bool:
        """Return whether a process has ended: the executor misses one that ends while it sends a result."""
        if any(process.exitcode is not None for process in self._processes()):
            self.close()
            return True
        return False

    def close(self) -> None:
        """End the processes at once and silently, even while they start."""
        for process in self._processes():
            process.kill()
        if self._executor:
            if queue := getattr(self._executor, "_call_queue", None):
                queue.cancel_join_thread()  # it may wait for ever to write to a process that is gone
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = None

    def _processes(self) -> list[BaseProcess]:
        return list((self._executor._processes or {}).values()) if self._executor else []


def convert_all(workers: Workers, jobs: Iterable[Job]) -> Iterator[Result]:
    """Retarget clips, a few at a time, and yield the results as they come.

    If a worker dies, the submitted clips are tried again at the end, one by one; one that kills its worker again fails.
    If all workers are gone, or die as they start, a BatchError is raised.
    """
    unfinished: list[Job] = []
    yield from _convert(workers, jobs, unfinished)
    for job in unfinished:
        deadly: list[Job] = []
        yield from _convert(workers, [job], deadly)
        if deadly:
            yield job.failed(f"{job.source.path}: the process that converted it died, perhaps out of memory")


def _convert(workers: Workers, jobs: Iterable[Job], unfinished: list[Job]) -> Iterator[Result]:
    """Retarget clips; those submitted when a worker dies are added to `unfinished`."""
    running: dict[Future[Result], Job] = {}
    for job in jobs:
        running[_submit(workers, job)] = job
        while len(running) >= QUEUED * workers.count:
            yield from _next_results(workers, running, unfinished)
    while running:
        yield from _next_results(workers, running, unfinished)


def _next_results(workers: Workers, running: dict[Future[Result], Job], unfinished: list[Job]) -> Iterator[Result]:
    """Wait for results, remove their clips from `running`, and yield them."""
    done, _ = wait(running, CHECK_INTERVAL, FIRST_COMPLETED)
    if not done and workers.lost():
        unfinished += running.values()
        running.clear()
    for future in done:
        job = running.pop(future)
        try:
            result = future.result()
        except BrokenExecutor:
            unfinished.append(job)
            continue
        except CancelledError as error:
            raise BatchError("the workers are gone; run this again to go on") from error
        except Exception as error:  # of the cluster; it concerns this clip only
            result = job.failed(f"{job.source.path}: {type(error).__name__}: {error}")
        yield result


def _submit(workers: Workers, job: Job, again: bool = True) -> Future[Result]:
    """Submit a clip; if a worker has died, start others first."""
    try:
        return workers.executor.submit(convert, job)
    except BrokenExecutor as error:
        if again:
            workers.close()
            return _submit(workers, job, again=False)
        advice = 'a script that converts needs a file of its own, with `if __name__ == "__main__":`'
        raise BatchError(f"the workers die as they start; {advice}") from error


def _start_worker(temporary: str) -> None:
    """Let a worker ignore Ctrl-C, which its parent handles, and end with its parent, removing temporary files."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_SETMASK, [])

    def end_with_parent() -> None:
        if parent := multiprocessing.parent_process():
            parent.join()
            shutil.rmtree(temporary, ignore_errors=True)
            os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def _worker_environment() -> Iterator[None]:
    """Set the environment variables of workers while they start; Ctrl-C waits meanwhile.

    Workers import from the same folders as this process, but not from the working directory, which may hold another
    copy of this program. They do not warn of semaphores that are left when this process is killed.
    """
    before = dict(os.environ)
    path = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
    quiet = {"PYTHONWARNINGS": "ignore:resource_tracker", "PYTHONSAFEPATH": "1", "PYTHONPATH": path}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1") | before | quiet)
    try:
        with interrupts_held():
            yield
    finally:
        os.environ.clear()
        os.environ.update(before)
