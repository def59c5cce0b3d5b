"""The workers that retarget clips, a few jobs at a time: processes of this machine, or a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from concurrent.futures.process import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from multiprocessing.util import get_temp_dir
from pathlib import Path

from distretarget.batch.job import Job, Result, convert
from distretarget.errors import BatchError
from distretarget.io.files import reason_of
from distretarget.numerics.compiled import loaded
from distretarget.numerics.interrupts import interrupts_held

# These set the threads of a process: workers have one each, as there is a worker for each core.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CHECK_INTERVAL = 5.0  # after this time without a result, check whether a worker has died [s]
CONNECT_TIMEOUT = 10.0  # time for a Dask scheduler to answer [s]
REMINDER = 60.0  # time from one line that there are no workers to the next [s]
QUEUED = 2  # jobs submitted at a time, running or waiting [jobs per worker]


class Processes:
    """Processes on this machine: their number, and the time that their start took [s]."""

    def __init__(self, count: int) -> None:
        """Prepare to start this many processes."""
        self.count, self.start_seconds = count, 0.0
        self._executor: ProcessPoolExecutor | None = None
        # Not "fork": a process with threads, which numerical libraries start, must not be forked.
        methods = multiprocessing.get_all_start_methods()
        self._context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
        if "forkserver" in methods:
            self._context.set_forkserver_preload(["distretarget.batch.workers"])
            with _worker_environment():
                resource_tracker.ensure_running()  # before another library starts it in another environment

    @property
    def executor(self) -> ProcessPoolExecutor:
        """The processes, started when first used."""
        if self._executor is None:
            started = time.perf_counter()
            loaded()  # if it cannot be, every clip would say so
            with _worker_environment():
                try:
                    self._executor = ProcessPoolExecutor(self.count, self._context, _start_worker, (get_temp_dir(),))
                except (OSError, ImportError) as error:  # no semaphores
                    reason = f"processes cannot share their work here: /dev/shm: {reason_of(error)}"
                    raise BatchError(f"{reason}; make it writable, or retarget clip by clip") from error
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
        """End the processes at once and silently, even while they start; the next use of the executor starts others."""
        for process in self._processes():
            process.kill()
        if self._executor:
            if queue := getattr(self._executor, "_call_queue", None):
                queue.cancel_join_thread()  # it may wait for ever to write to a process that is gone
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = None

    def _processes(self) -> list[BaseProcess]:
        return list((self._executor._processes or {}).values()) if self._executor else []


class Cluster:
    """A Dask cluster; its scheduler gives the jobs of workers that die to others."""

    def __init__(self, address: str, waiting: Callable[[str], object]) -> None:
        """Connect to the scheduler at an address; raise a BatchError if none answers or the cluster has no workers.

        If the workers leave later, `waiting` is called with that reason.
        """
        import asyncio  # here, as it is slow to import

        try:
            from distributed import Client
        except ImportError as missing:
            raise BatchError("--dask needs the package distributed: pip install 'distretarget[dask]'") from missing
        try:
            kind = asyncio.run(_kind(address))  # a client would wait for much longer, and not without noise
            client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False) if kind == "Scheduler" else None
        except TimeoutError as error:
            raise BatchError(f"no Dask scheduler answers at {address!r} within {CONNECT_TIMEOUT:g} s") from error
        except Exception as error:  # of all layers below: the address, the network, what another program answers
            raise BatchError(f"no Dask scheduler answers at {address!r}: {error}") from error
        if client is None:
            raise BatchError(f"{address!r} is the address of a Dask {kind.lower()}; expected that of the scheduler")
        self._client = client
        self.executor: Executor = client.get_executor(pure=False)
        self._waiting, self._next_reminder = waiting, 0.0
        self.count, self.start_seconds = sum(client.ncores().values()), 0.0
        if not self.count:
            self.close()
            raise BatchError(f"the Dask scheduler at {address} has no workers; start some and run this again")

    def lost(self) -> bool:
        """Return False, after a reminder if the cluster has no workers: it may get new ones."""
        if not self._client.scheduler_info()["workers"] and time.monotonic() >= self._next_reminder:
            self._next_reminder = time.monotonic() + REMINDER
            self._waiting("the Dask cluster has no workers")
        return False

    def close(self) -> None:
        """Leave the cluster; jobs not yet done are dropped."""
        with suppress(Exception):
            self._client.close(timeout=5)


async def _kind(address: str) -> str:
    """What the Dask process at an address is, such as "Scheduler" or "Worker"."""
    import asyncio

    from distributed import rpc

    async with rpc(address, timeout=CONNECT_TIMEOUT) as process:
        return str((await asyncio.wait_for(process.identity(), CONNECT_TIMEOUT))["type"])


Workers = Processes | Cluster


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
