"""The workers: processes of this machine, or a Dask cluster. Both are executors of `concurrent.futures`."""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, wait
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.util import get_temp_dir
from pathlib import Path
from typing import Any, Protocol, cast

from distretarget.batch.compile_ahead import warm
from distretarget.batch.interrupts import interrupts_held
from distretarget.errors import BatchError
from distretarget.pipeline.options import Objective

# The variables that set the threads of a process. Workers have one thread each, as there is a worker for each core.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CONNECT_TIMEOUT = 10.0  # time for a scheduler to answer [s]


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

    def trouble(self) -> str:
        """Return why no results may come, a clause for the user; empty if nothing is known to be wrong."""

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
        self._executor: ProcessPoolExecutor | None = None
        # Not "fork": a process with threads, which numerical libraries start, must not be forked.
        methods = multiprocessing.get_all_start_methods()
        self._context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
        if "forkserver" in methods:
            self._context.set_forkserver_preload(["distretarget.batch.warmed"])
            with _worker_environment():
                resource_tracker.ensure_running()

    @property
    def executor(self) -> ProcessPoolExecutor:
        """The processes, which start when they are first needed.

        Code is compiled only once, by this process; the others find it in the folder of compiled code.
        """
        return self._executor or self._start()

    def _start(self) -> ProcessPoolExecutor:
        started = time.perf_counter()
        warm(self._objective)
        reader, self._writer = self._context.Pipe(duplex=False)
        with _worker_environment():
            pool = ProcessPoolExecutor(self.workers, self._context, _start_worker, (reader, get_temp_dir()))
            self._executor = pool
            wait([pool.submit(os.getpid) for _ in range(self.workers)])  # starts the processes
        self.start_seconds += time.perf_counter() - started
        return pool

    def lost(self) -> bool:
        """Return whether a process has ended; the executor does not notice one that ends while it sends a result."""
        processes = self.executor._processes or {}
        return any(process.exitcode is not None for process in processes.values())

    def trouble(self) -> str:
        """Return nothing: processes that die are replaced."""
        return ""

    def renew(self) -> None:
        """Replace the processes by new ones."""
        self.close()
        self._executor = None

    def close(self) -> None:
        """End the processes at once, without a word, even while they start."""
        if self._executor:
            for process in list((self._executor._processes or {}).values()):
                process.kill()
            self._executor.shutdown(wait=False, cancel_futures=True)
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
        _check_answers(address)
        try:
            self._client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise BatchError(f"no Dask scheduler answers at {address!r}: {error}") from error
        self.start_seconds = 0.0
        self.workers = sum(self._client.ncores().values())
        if not self.workers:
            self._client.close()
            raise BatchError(f"the Dask scheduler at {address} has no workers; start some and run this again")
        self.executor: Executor = self._client.get_executor(pure=False)

    def lost(self) -> bool:
        """Return False: the scheduler itself replaces workers that die."""
        return False

    def trouble(self) -> str:
        """Return that the cluster has no workers, if that is so."""
        return "" if self._client.scheduler_info()["workers"] else "the Dask cluster has no workers"

    def renew(self) -> None:
        """Nothing to do: the scheduler gives the tasks of a dead worker to others."""

    def close(self) -> None:
        """Leave the cluster; tasks not yet done are dropped."""
        with contextlib.suppress(Exception):
            self._client.close(timeout=5)


def _check_answers(address: str) -> None:
    """Check that a scheduler answers, which a client would wait for much longer, and not without noise.

    Raises: BatchError: none does.
    """
    try:
        kind = asyncio.run(_identity(address))["type"]
    except TimeoutError as error:
        raise BatchError(f"no Dask scheduler answers at {address!r} within {CONNECT_TIMEOUT:g} s") from error
    except Exception as error:  # of all layers below: the address, the network, what another program answers
        raise BatchError(f"no Dask scheduler answers at {address!r}: {error}") from error
    if kind != "Scheduler":
        raise BatchError(f"{address!r} is the address of a Dask {kind.lower()}; expected that of the scheduler")


async def _identity(address: str) -> dict[str, Any]:
    """What the Dask process at an address says of itself."""
    from distributed import rpc

    async with rpc(address, timeout=CONNECT_TIMEOUT) as process:
        return cast(dict[str, Any], await asyncio.wait_for(process.identity(), CONNECT_TIMEOUT))


def _start_worker(parent: Connection, temporary: str) -> None:
    """Make a worker ignore Ctrl-C, which its parent process handles, and end when the parent dies.

    `parent` becomes readable when the parent process dies; `temporary` is its folder of temporary files.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_SETMASK, [])
    threading.Thread(target=_end_with, args=(parent, temporary), daemon=True).start()


def _end_with(parent: Connection, temporary: str) -> None:
    """End this process when the parent dies, and remove the temporary files that the parent leaves."""
    parent.poll(None)
    shutil.rmtree(temporary, ignore_errors=True)
    os._exit(1)


@contextlib.contextmanager
def _worker_environment() -> Iterator[None]:
    """Set the environment variables of workers while they are started, and let Ctrl-C wait until they are.

    Workers import from the same folders as this process. They do not import from the working directory, which may hold
    another copy of this program. After a kill of this process, nothing is said of the semaphores that are cleared away.
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
