"""Jobs, each to retarget a clip, and the workers that do them: processes of this machine, or a Dask cluster."""

from __future__ import annotations

import logging
import math
import multiprocessing
import os
import pickle
import shutil
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from multiprocessing import connection, resource_tracker
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.util import get_temp_dir
from pathlib import Path, PurePath
from queue import SimpleQueue

from distretarget.batch.results import BatchRecord
from distretarget.batch.summary import alignment_text
from distretarget.character.nodes import Animation
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import BatchError, DistretargetError
from distretarget.io.bvh_writer import python_refusals, refusals
from distretarget.io.files import encoded_parts
from distretarget.io.input_file import OUTPUTS, InputFile
from distretarget.io.motion_writer import character_animation, content_of
from distretarget.io.reading import TargetFile
from distretarget.matching.unmatched import others_without_source, parts_without_source
from distretarget.measure.metrics import in_columns
from distretarget.numerics.compiled import loaded
from distretarget.numerics.parallel import thread_limit
from distretarget.pipeline.retargeting import Conversion, Recipe
from distretarget.report.clip_page import run_page
from distretarget.report.diff_document import About
from distretarget.report.page import VERSION

# Number of threads of a process, 1 in workers, since there is a worker for each core.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CHECK_INTERVAL = 5.0  # after this time without a result, check whether there are workers [s]
CONNECT_TIMEOUT = 10.0  # for a scheduler to answer [s]
REMINDER = 60.0  # between two lines that say that there are no workers [s]
QUEUED = 2  # submitted jobs, running or waiting, per worker
TIME_LIMITS = (0.001, 1e6)  # bounds of a job's time limit [s]

Output = bytes | Animation


@dataclass(frozen=True)
class Job:
    """A clip to retarget."""

    source: InputFile
    target: bytes  # a pickled `TargetFile`, which a worker unpickles once for all clips
    recipe: Recipe
    record: BatchRecord  # the record of the clip before it is done
    outputs: tuple[str, ...]  # paths of the results in the folder of results, the one in `record` first
    contacts: ContactList = NO_CONTACTS
    about: About | None = None  # for its report; None for no report
    time_limit: float | None = None  # after which the process is killed [s]
    threads: int | None = None  # for a long clip, which one core alone would finish after all others

    def failed(self, reason: str) -> Result:
        """Return the result of a clip that failed; the reason names the file."""
        return Result({**self.record, "error": " ".join(reason.split())})


@dataclass(frozen=True)
class Result:
    """The result of a job: the record and, if done, contents by path, of characters the animation, and its report."""

    record: BatchRecord
    outputs: Mapping[str, Output] = field(default_factory=dict)
    report: str = ""


@lru_cache(maxsize=4)
def target_of_job(target: bytes) -> TargetFile:
    """Return the target of a job, unpickled and cached."""
    file: TargetFile = pickle.loads(target)
    return file


def run(job: Job) -> Result:
    """Retarget a clip; an error is recorded in the result."""
    started = time.perf_counter()
    path = job.source.path
    if job.record["version"] != VERSION:
        return job.failed(f"{path}: a worker runs version {VERSION}, this is {job.record['version']}")
    try:
        with thread_limit(job.threads):
            result = _converted(job)
    except DistretargetError as error:
        result = job.failed(str(error))
    except MemoryError:
        result = job.failed(f"{path}: out of memory")
    except Exception as error:  # one clip must not stop the others
        result = job.failed(f"{path}: unexpected {type(error).__name__}: {error}; please report this")
    result.record["seconds"] = round(time.perf_counter() - started, 3)
    return result


def _converted(job: Job) -> Result:
    recipe, target = job.recipe, target_of_job(job.target)
    motion, lost = recipe.read(job.source)
    kinds = {name: OUTPUTS[PurePath(name).suffix] for name in job.outputs}
    name = PurePath(next(iter(kinds))).stem
    done = Conversion.of(motion, job.source, target, recipe).converted(name, (*kinds.values(),), job.contacts)
    result = done.result
    body = result.motion.skeleton
    refused = (*refusals(body), *python_refusals(body)) if "BVH" in kinds.values() else ()
    record: BatchRecord = {
        **job.record,
        "status": "done",
        "frames": len(result.motion),
        "metrics": in_columns(result.metrics),
        "verdict": result.verdict,
        "warnings": [*done.left_out(lost), *result.warnings],
        "notes": [*parts_without_source(result.matching), *others_without_source(result.matching), *refused],
        "alignment": alignment_text(result.matching),
    }
    outputs = {
        name: character_animation(target, done.clip)
        if kind == "character"
        else b"".join(encoded_parts(content_of(name, done.clip, target, recipe.writing)))
        for name, kind in kinds.items()
    }
    return Result(record, outputs, run_page(result, job.about, target.target, job.source) if job.about else "")


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay SIGINT, SIGTERM and SIGHUP in this process and in those that it starts in the block."""
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {number: signal.signal(number, lambda caught, _frame: received.append(caught)) for number in numbers}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)  # started processes inherit it; other threads do not
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if received:
            signal.raise_signal(received[0])


class Processes:
    """Worker processes on this machine: their `count`, and the time that their start took, `start_seconds`."""

    def __init__(self, count: int) -> None:
        self.count, self.start_seconds = count, 0.0
        self._processes: list[_Process] = []
        # Not "fork": numerical libraries start threads, and a process with threads must not be forked.
        methods = multiprocessing.get_all_start_methods()
        self._context: ForkServerContext | SpawnContext = multiprocessing.get_context("spawn")
        if "forkserver" in methods:
            self._context = multiprocessing.get_context("forkserver")
            self._context.set_forkserver_preload(["distretarget.batch.workers"])
            with _worker_environment():
                resource_tracker.ensure_running()  # before a library starts it without these variables

    def submit(self, job: Job) -> None:
        """Give a clip to the process that has the fewest; a BatchError if none can be started."""
        if not self._processes:
            self.start()
        min(self._processes, key=lambda process: len(process.jobs)).begin(job)

    def start(self) -> None:
        """Start the processes; a BatchError if they cannot be started."""
        started = time.perf_counter()
        loaded()  # raises an error here instead of in every clip
        self._processes += [_Process(self._context) for _ in range(self.count)]
        try:
            for process in self._processes:
                process.receive()
        except (EOFError, OSError) as error:
            advice = 'a script that converts needs a file of its own, with `if __name__ == "__main__":`'
            raise BatchError(f"the workers die as they start; {advice}") from error
        self.start_seconds += time.perf_counter() - started

    def finished(self) -> Iterator[tuple[Job, Result | None]]:
        """Wait until a clip is finished, and yield all finished jobs with their results, None if the process died."""
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
        """Replace a process by a new one, which gets its waiting jobs, and yield the job that was running, if any."""
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
    """A process, at `pipe`, that retargets its `jobs` one after the other; the first is running."""

    def __init__(self, context: ForkServerContext | SpawnContext) -> None:
        self.jobs, self._began = deque[Job](), 0.0
        self.pipe, its_end = context.Pipe()
        self._process = context.Process(target=_work, args=(its_end, get_temp_dir()))
        with _worker_environment():
            self._process.start()
        its_end.close()

    def begin(self, job: Job) -> None:
        """Add a job."""
        self.jobs.append(job)
        if len(self.jobs) == 1:
            self._began = time.monotonic()
        with suppress(OSError):  # the process has died; `receive` finds out
            self.pipe.send(job)

    def receive(self) -> Result | None:
        """Return the first job's result, None after the start; an EOFError or OSError if the process has died."""
        result: Result | None = self.pipe.recv()
        self._began = time.monotonic()
        return result

    @property
    def time_left(self) -> float:
        """The time until the first job exceeds its limit [s]."""
        limit = self.jobs[0].time_limit if self.jobs else None
        return math.inf if limit is None else self._began + limit - time.monotonic()

    def kill(self) -> None:
        """End the process at once, even while it starts."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _work(pipe: connection.Connection[Result | None, Job], temporary: str) -> None:
    """Retarget the clips that come through a pipe, until the parent closes it; then remove temporary files."""
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
    """Set the environment variables that workers get when started in the block; signals are delayed. Workers import
    from the same folders, but not from the working directory, and do not warn of semaphores left by a kill.
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


class Cluster:
    """A Dask cluster, whose scheduler moves jobs of dead workers to others."""

    def __init__(self, address: str, waiting: Callable[[str], object]) -> None:
        """Connect to a scheduler; a BatchError if none answers or it has no workers. `waiting` hears if all leave."""
        import asyncio  # here, since it is slow to import

        try:
            from distributed import Client
        except ImportError as missing:
            raise BatchError("--dask needs the package distributed: pip install 'distretarget[dask]'") from missing
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # it prints tracebacks of errors reported here
        try:
            kind = asyncio.run(_kind(address))  # a Client would wait much longer, and print warnings
            client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False) if kind == "Scheduler" else None
        except TimeoutError as error:
            raise BatchError(f"no Dask scheduler answers at {address!r} within {CONNECT_TIMEOUT:g} s") from error
        except Exception as error:  # of any layer: the address, the network, the answer of another program
            raise BatchError(f"no Dask scheduler answers at {address!r}: {error}") from error
        if client is None:
            raise BatchError(f"{address!r} is the address of a Dask {kind.lower()}; expected that of the scheduler")
        self._client = client
        self._executor: Executor = client.get_executor(pure=False)
        self._running: dict[Future[Result], Job] = {}
        self._waiting, self._next_reminder = waiting, 0.0
        self.count, self.start_seconds = sum(client.ncores().values()), 0.0
        if not self.count:
            self.close()
            raise BatchError(f"the Dask scheduler at {address} has no workers; start some and run this again")

    def submit(self, job: Job) -> None:
        """Give a clip to the cluster."""
        self._running[self._executor.submit(run, job)] = job

    def finished(self) -> Iterator[tuple[Job, Result]]:
        """Wait until a clip is finished, and yield finished jobs with results; a BatchError if the cluster is gone."""
        done, _ = wait(self._running, CHECK_INTERVAL, FIRST_COMPLETED)
        if not done and not self._client.scheduler_info()["workers"] and time.monotonic() >= self._next_reminder:
            self._next_reminder = time.monotonic() + REMINDER  # it may get new ones
            self._waiting("the Dask cluster has no workers")
        for future in done:
            job = self._running.pop(future)
            try:
                result = future.result()
            except CancelledError as error:
                raise BatchError("the workers are gone; run this again to go on") from error
            except Exception as error:  # of the cluster, for this clip only
                result = job.failed(f"{job.source.path}: {type(error).__name__}: {error}")
            yield job, result

    def close(self) -> None:
        """Disconnect from the cluster; unfinished jobs are dropped."""
        with suppress(Exception):
            self._client.close(timeout=5)


async def _kind(address: str) -> str:
    """The type of the Dask process at an address, such as "Scheduler" or "Worker"."""
    import asyncio

    from distributed import rpc

    async with rpc(address, timeout=CONNECT_TIMEOUT) as process:
        return str((await asyncio.wait_for(process.identity(), CONNECT_TIMEOUT))["type"])


Workers = Processes | Cluster


def convert_all(workers: Workers, jobs: Iterable[Job]) -> Iterator[Result]:
    """Retarget clips, a few at a time, and yield the results as they are finished. If a worker dies, its clip is tried
    again at the end, alone; if it dies again, the clip fails. A BatchError if the workers are gone, or die as they
    start.
    """
    died = []
    for job, result in _finished(workers, jobs):
        if result:
            yield result
        else:
            died.append(job)
    for each in died:
        for job, result in _finished(workers, [each]):
            yield result or job.failed(f"{job.source.path}: the process that converted it died, perhaps out of memory")


def _finished(workers: Workers, jobs: Iterable[Job]) -> Iterator[tuple[Job, Result | None]]:
    """Retarget clips, and yield the jobs with their results, None if the worker died."""
    running = 0
    for job in chain(jobs, [None]):  # after the last one, wait for all
        if job:
            workers.submit(job)
            running += 1
        while running >= (QUEUED * workers.count if job else 1):
            for finished in workers.finished():
                running -= 1
                yield finished
