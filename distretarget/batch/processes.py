"""Processes of this machine that retarget clips."""

from __future__ import annotations

import math
import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import connection, resource_tracker
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.util import get_temp_dir
from pathlib import Path
from queue import SimpleQueue

from distretarget.batch.job import Job, Result, run
from distretarget.errors import BatchError
from distretarget.numerics.compiled import loaded

# These set the threads of a process: workers have one each, as there is a worker for each core.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C and requests to end, in this process and in those that it starts in the block."""
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {number: signal.signal(number, lambda caught, _frame: received.append(caught)) for number in numbers}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)  # for started processes; other threads are not masked
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if received:
            signal.raise_signal(received[0])


class Processes:
    """Processes on this machine: their number, and the time that their start took [s]."""

    def __init__(self, count: int) -> None:
        """Prepare to start this many processes."""
        self.count, self.start_seconds = count, 0.0
        self._processes: list[_Process] = []
        # Not "fork": a process with threads, which numerical libraries start, must not be forked.
        methods = multiprocessing.get_all_start_methods()
        self._context: ForkServerContext | SpawnContext = multiprocessing.get_context("spawn")
        if "forkserver" in methods:
            self._context = multiprocessing.get_context("forkserver")
            self._context.set_forkserver_preload(["distretarget.batch.processes"])
            with _worker_environment():
                resource_tracker.ensure_running()  # before another library starts it in another environment

    def submit(self, job: Job) -> None:
        """Give a clip to the process that has the fewest; a BatchError if none can be started."""
        if not self._processes:
            self.start()
        min(self._processes, key=lambda process: len(process.jobs)).begin(job)

    def start(self) -> None:
        """Start the processes; a BatchError if they cannot be started."""
        started = time.perf_counter()
        loaded()  # if it cannot be, every clip would say so
        self._processes += [_Process(self._context) for _ in range(self.count)]
        try:
            for process in self._processes:
                process.receive()
        except (EOFError, OSError) as error:
            advice = 'a script that converts needs a file of its own, with `if __name__ == "__main__":`'
            raise BatchError(f"the workers die as they start; {advice}") from error
        self.start_seconds += time.perf_counter() - started

    def finished(self) -> Iterator[tuple[Job, Result | None]]:
        """Wait until a clip is finished, and yield those that are, with their results; None if the process died."""
        processes = {process.pipe: process for process in self._processes}
        time_left = min(process.time_left for process in self._processes)
        ready = connection.wait(processes, None if time_left == math.inf else max(time_left, 0.0))
        for process in (one for pipe, one in processes.items() if pipe in ready):
            try:
                result = process.receive()
            except (EOFError, OSError):
                yield from ((job, None) for job in self._replace(process))
            else:
                if result:
                    yield process.jobs.popleft(), result
        for process in [each for each in self._processes if each.time_left < 0.0]:
            for job in self._replace(process):
                limit = f"took longer than the limit of {job.time_limit:g} s; the next run tries it again"
                yield job, job.failed(f"{job.source.path}: {limit}")

    def _replace(self, process: _Process) -> Iterator[Job]:
        """End a process, let another one do what it has not begun, and yield the job that it was at work on, if any."""
        process.kill()
        other = _Process(self._context)
        self._processes[self._processes.index(process)] = other
        for job in [*process.jobs][1:]:
            other.begin(job)
        if process.jobs:
            yield process.jobs[0]

    def close(self) -> None:
        """End the processes; the next clip starts others."""
        for process in self._processes:
            process.kill()
        self._processes.clear()


class _Process:
    """A process that retargets clips in turn.

    Attributes:
        pipe: to it.
        jobs: that it has; it is at work on the first one.
    """

    def __init__(self, context: ForkServerContext | SpawnContext) -> None:
        """Start the process."""
        self.jobs, self._began = deque[Job](), 0.0
        self.pipe, its_end = context.Pipe()
        self._process = context.Process(target=_work, args=(its_end, get_temp_dir()))
        with _worker_environment():
            self._process.start()
        its_end.close()

    def begin(self, job: Job) -> None:
        """Give it one more job."""
        self.jobs.append(job)
        if len(self.jobs) == 1:
            self._began = time.monotonic()
        with suppress(OSError):  # it has died, which `receive` finds
            self.pipe.send(job)

    def receive(self) -> Result | None:
        """Return the result of its first job, or None if it says that it has started; an EOFError or OSError if it has
        died.
        """
        result: Result | None = self.pipe.recv()
        self._began = time.monotonic()
        return result

    @property
    def time_left(self) -> float:
        """The time until its first job is over the limit [s]."""
        limit = self.jobs[0].time_limit if self.jobs else None
        return math.inf if limit is None else self._began + limit - time.monotonic()

    def kill(self) -> None:
        """End it at once and silently, even while it starts."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _work(pipe: connection.Connection[Result | None, Job], temporary: str) -> None:
    """Retarget the clips that come through a pipe, until it ends, as its other end does with the parent; then remove
    temporary files. Ctrl-C is ignored: the parent handles it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_SETMASK, [])
    jobs = SimpleQueue[Job]()

    def receive() -> None:
        try:
            while True:
                jobs.put(pipe.recv())
        except (EOFError, OSError):
            shutil.rmtree(temporary, ignore_errors=True)
            os._exit(1)

    receiving = threading.Thread(target=receive, daemon=True)
    receiving.start()
    try:
        pipe.send(None)
        while True:
            pipe.send(run(jobs.get()))
    except OSError:
        receiving.join()


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
