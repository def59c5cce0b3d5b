"""Who does the work: processes of this machine, or a Dask cluster. Both are executors of `concurrent.futures`."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import cached_property
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Protocol

from distretarget.batch.compile_ahead import warm
from distretarget.errors import BatchError
from distretarget.retargeting import OBJECTIVES, Objective

# A worker of one thread: there are as many workers as cores.
SINGLE = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
ANSWER = "10s"  # for a scheduler to answer


class Pool(Protocol):
    """Workers.

    Attributes:
        workers: how many there are.
    """

    workers: int

    @property
    def executor(self) -> Executor:
        """Takes their tasks."""

    def lost(self) -> bool:
        """Whether a worker has died."""

    def renew(self) -> None:
        """Get new workers, after one has died and the executor with it."""

    def close(self) -> None:
        """Let go of the workers, whatever they do."""


class Processes:
    """Processes on this machine."""

    def __init__(self, workers: int, objective: Objective) -> None:
        """Make ready to start so many, for an objective."""
        self.workers = workers
        self._objective = objective
        # Not "fork": a process with threads, as numerical libraries have, must not be forked.
        methods = multiprocessing.get_all_start_methods()
        self._context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
        self._forks = "forkserver" in methods
        if self._forks:
            self._context.set_forkserver_preload(["distretarget.batch.warmed"])

    @cached_property
    def executor(self) -> ProcessPoolExecutor:
        """The processes, started when they are needed.

        What is to be compiled is compiled once: by the process that forks the others, or, where none does or for
        another objective than the default, here, so that they find it in the cache.
        """
        if not self._forks or self._objective != OBJECTIVES[0]:
            warm(self._objective)
        reader, self._writer = self._context.Pipe(duplex=False)
        with _surroundings():
            pool = ProcessPoolExecutor(self.workers, self._context, _begin, (reader,))
            if self._forks:
                forkserver.ensure_running()  # begun, not waited for
            else:
                pool.submit(os.getpid)  # begins the processes
        return pool

    def lost(self) -> bool:
        """Whether a process has ended, which the executor does not see if it ends while it sends a result."""
        processes = self.executor._processes or {}
        return any(process.exitcode is not None for process in processes.values())

    def renew(self) -> None:
        """Have new processes started."""
        self.close()
        del self.executor

    def close(self) -> None:
        """End the processes at once."""
        if "executor" in self.__dict__:
            self.executor.shutdown(wait=False, cancel_futures=True)
            self._writer.close()


class Cluster:
    """A Dask cluster."""

    def __init__(self, address: str) -> None:
        """Join the cluster whose scheduler is at an address.

        Raises:
            BatchError: Dask is not installed, or nobody answers there.
        """
        try:
            from distributed import Client
        except ImportError as error:
            raise BatchError("--dask needs the package distributed: pip install 'distretarget[dask]'") from error
        try:
            self._client = Client(address, timeout=ANSWER, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise BatchError(f"no Dask scheduler answers at {address}: {error}") from error
        self.workers = sum(self._client.ncores().values())
        if not self.workers:
            self._client.close()
            raise BatchError(f"the Dask scheduler at {address} has no workers; start some and run this again")
        self.executor: Executor = self._client.get_executor(pure=False)

    def lost(self) -> bool:
        """The scheduler sees to that."""
        return False

    def renew(self) -> None:
        """Nothing to do: the scheduler gives the tasks of a dead worker to others."""

    def close(self) -> None:
        """Leave the cluster; tasks not yet done are dropped."""
        with contextlib.suppress(Exception):
            self._client.close(timeout=5)


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _begin(life: Connection) -> None:
    """What a worker does first: it leaves Ctrl-C to the process that started it, and sees to its end with that.

    `life` becomes readable when the other process closes its end of it, if only by dying.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(life,), daemon=True).start()


def _end_with(life: Connection) -> None:
    life.poll(None)
    os._exit(1)


@contextlib.contextmanager
def _surroundings() -> Iterator[None]:
    """For a while, the environment variables of workers.

    They import from where this process does, and not from the folder they happen to be started in, which may hold
    another copy of this program.
    """
    before = dict(os.environ)
    path = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
    os.environ.update(dict.fromkeys(SINGLE, "1") | before | {"PYTHONSAFEPATH": "1", "PYTHONPATH": path})
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
