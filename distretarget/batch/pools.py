"""The workers: processes of this machine, or a Dask cluster. Both are executors of `concurrent.futures`."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import cached_property
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Protocol

from distretarget.batch.compile_ahead import warm
from distretarget.errors import BatchError
from distretarget.retargeting import Objective

# The variables that set the threads of a process. Workers have one thread each, as there is a worker for each core.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CONNECT_TIMEOUT = "10s"  # time for a scheduler to answer, as Dask writes it


class Pool(Protocol):
    """Workers.

    Attributes:
        workers: how many there are.
        start_seconds: the time that their start has taken, with the compilation of their code [s].
    """

    workers: int
    start_seconds: float

    @property
    def executor(self) -> Executor:
        """The executor that hands tasks to the workers."""

    def lost(self) -> bool:
        """Return whether a worker has died."""

    def renew(self) -> None:
        """Replace the workers after one has died, which breaks the executor."""

    def close(self) -> None:
        """Release the workers at once, even if they are busy."""


class Processes:
    """Processes on this machine."""

    def __init__(self, workers: int, objective: Objective) -> None:
        """Prepare to start this many processes, for an objective."""
        self.workers = workers
        self.start_seconds = 0.0
        self._objective = objective
        # Not "fork": a process with threads, which numerical libraries start, must not be forked.
        methods = multiprocessing.get_all_start_methods()
        self._context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
        if "forkserver" in methods:
            self._context.set_forkserver_preload(["distretarget.batch.warmed"])

    @cached_property
    def executor(self) -> ProcessPoolExecutor:
        """The processes, which start when they are first needed.

        Code is compiled only once, by this process; the others find it in the folder of compiled code.
        """
        started = time.perf_counter()
        warm(self._objective)
        reader, self._writer = self._context.Pipe(duplex=False)
        with _worker_environment():
            pool = ProcessPoolExecutor(self.workers, self._context, _start_worker, (reader,))
            pool.submit(os.getpid).result()  # starts the processes, and waits for them
        self.start_seconds += time.perf_counter() - started
        return pool

    def lost(self) -> bool:
        """Return whether a process has ended; the executor does not notice one that ends while it sends a result."""
        processes = self.executor._processes or {}
        return any(process.exitcode is not None for process in processes.values())

    def renew(self) -> None:
        """Replace the processes by new ones."""
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
        """Connect to the cluster whose scheduler is at an address.

        Raises:
            BatchError: Dask is not installed, no scheduler answers, or the cluster has no workers.
        """
        try:
            from distributed import Client
        except ImportError as error:
            raise BatchError("--dask needs the package distributed: pip install 'distretarget[dask]'") from error
        try:
            self._client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise BatchError(f"no Dask scheduler answers at {address}: {error}") from error
        self.start_seconds = 0.0
        self.workers = sum(self._client.ncores().values())
        if not self.workers:
            self._client.close()
            raise BatchError(f"the Dask scheduler at {address} has no workers; start some and run this again")
        self.executor: Executor = self._client.get_executor(pure=False)

    def lost(self) -> bool:
        """Return False: the scheduler itself replaces workers that die."""
        return False

    def renew(self) -> None:
        """Nothing to do: the scheduler gives the tasks of a dead worker to others."""

    def close(self) -> None:
        """Leave the cluster; tasks not yet done are dropped."""
        with contextlib.suppress(Exception):
            self._client.close(timeout=5)


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _start_worker(parent: Connection) -> None:
    """Make a worker ignore Ctrl-C, which its parent process handles, and end when the parent ends.

    `parent` becomes readable when the parent process closes its end of the connection or dies.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Connection) -> None:
    """End this process when the parent ends."""
    parent.poll(None)
    os._exit(1)


@contextlib.contextmanager
def _worker_environment() -> Iterator[None]:
    """Set the environment variables of workers while they are started.

    Workers import from the same folders as this process. They do not import from the working directory, which may hold
    another copy of this program.
    """
    before = dict(os.environ)
    path = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1") | before | {"PYTHONSAFEPATH": "1", "PYTHONPATH": path})
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
