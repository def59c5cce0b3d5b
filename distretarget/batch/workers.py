"""The workers that retarget clips: texts in, texts and metrics out, without access to files.

They are processes on this machine or a Dask cluster (`cluster`); both have an executor of `concurrent.futures`.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from concurrent.futures.process import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from multiprocessing.util import get_temp_dir
from pathlib import Path, PurePath
from typing import Protocol

from distretarget.batch.alignment_spread import alignment_text
from distretarget.batch.compile_ahead import warm
from distretarget.batch.interrupts import interrupts_held
from distretarget.batch.manifest import VERSION, ManifestRecord
from distretarget.batch.time_limit import OverTime, time_limit
from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.character.nodes import Animation
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import BatchError, DistretargetError
from distretarget.ik.poses import Mapper
from distretarget.io.build_file import with_source
from distretarget.io.bvh_readers import refusals
from distretarget.io.bvh_writer import bvh_parts
from distretarget.io.files import encoded_parts, hash_of
from distretarget.io.input_file import InputFile
from distretarget.io.map_json import MapFile
from distretarget.io.motion_file import parse_motion
from distretarget.io.motion_writer import DEFAULT_OUTPUT, OUTPUTS, OutputSettings, character_animation
from distretarget.io.target_file import TargetFile
from distretarget.io.vrma import vrma
from distretarget.matching.unmatched import others_without_source, parts_without_source
from distretarget.pipeline.labels import labels_of
from distretarget.pipeline.options import Objective, Options
from distretarget.pipeline.retargeting import retarget_onto
from distretarget.report.clip_page import run_page
from distretarget.report.diff_document import About

# These set the threads of a process: workers have one each, as there is a worker for each core.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CHECK_INTERVAL = 5.0  # after this time without a result, check whether a worker has died [s]
QUEUED = 2  # jobs submitted at a time, running or waiting [jobs per worker]


@dataclass(frozen=True)
class Reading:
    """Which animation of a file is read, and at which frame rate; see `read_motion`."""

    clip: str | None = None
    fps: float | None = None


DEFAULT_READING = Reading()
Output = bytes | Animation


@dataclass(frozen=True)
class Job:
    """A clip to retarget."""

    source: InputFile
    target: TargetFile
    map_file: MapFile
    options: Options
    record: ManifestRecord  # its line of the manifest while it is not done
    about: About | None = None  # what its report says; None for no report
    split: bool = False  # share its frames among all workers
    reading: Reading = DEFAULT_READING
    writing: OutputSettings = DEFAULT_OUTPUT
    builds: Builds = OWN_BUILDS
    others: tuple[str, ...] = ()  # the other outputs, as paths in the folder of results
    time_limit: float | None = None  # [s]
    contacts: ContactList = NO_CONTACTS

    def failed(self, reason: str) -> Result:
        """Return the result of a clip that failed; the reason names the file."""
        return Result(self.record | {"error": " ".join(reason.split())})


@dataclass(frozen=True)
class Result:
    """What became of a clip: its line of the manifest and, if it is done, its output and the HTML of its report.

    The output of a character is the animation alone, which goes into the character's file where that is. `others` are
    the other outputs, by their paths in the folder of results.
    """

    record: ManifestRecord
    output: Output = b""
    report: str = ""
    others: Mapping[str, Output] = field(default_factory=dict)


def convert(job: Job, mapper: Mapper = map) -> Result:
    """Retarget a clip; the result has the error, if any. `mapper` is as in `retarget`."""
    started = time.perf_counter()
    path = job.source.path
    if job.record["version"] != VERSION:
        return job.failed(f"{path}: a worker runs version {VERSION}, this is {job.record['version']}")
    try:
        with time_limit(job.time_limit):
            result = _converted(job, mapper)
    except DistretargetError as error:
        result = job.failed(str(error))
    except OverTime:
        result = job.failed(f"{path}: took longer than the limit of {job.time_limit:g} s; the next run tries it again")
    except (BrokenExecutor, CancelledError):  # raised by the mapper: the clip is not to blame
        raise
    except MemoryError:
        result = job.failed(f"{path}: out of memory")
    except Exception as error:  # one clip must not stop the others
        result = job.failed(f"{path}: unexpected {type(error).__name__}: {error}; please report this")
    result.record["seconds"] = round(time.perf_counter() - started, 3)
    return result


def _converted(job: Job, mapper: Mapper) -> Result:
    path = job.source.path
    motion, lost = parse_motion(job.source, job.reading.clip, job.reading.fps)
    builds = job.builds if job.options.skin == "none" else with_source(job.builds, job.source)
    result = retarget_onto(
        motion,
        job.target,
        source=path,
        map_file=job.map_file,
        options=job.options,
        builds=builds,
        contacts=job.contacts,
        mapper=mapper,
    )
    clip = job.writing.clip(result.motion, PurePath(job.record["output"]).stem, result.world.up_vector)
    names = (job.record["output"], *job.others)
    # Texts are made by other workers, if the mapper has any, while metrics are made.
    texts = {name: bvh_parts(clip.motion, mapper) for name in names if OUTPUTS[PurePath(name).suffix] == "BVH"}
    refused = refusals(clip.motion.skeleton) if texts else ()
    record = job.record | {
        "status": "done",
        "frames": len(result.motion),
        "metrics": result.metrics,
        "notes": [*parts_without_source(result.matching), *others_without_source(result.matching), *refused],
        "warnings": [*lost, *result.warnings],
        "alignment": alignment_text(result.matching),
        "verdict": result.verdict,
    }
    report = run_page(result, job.about, job.target.target) if job.about else ""

    def made(name: str) -> Output:
        match OUTPUTS[PurePath(name).suffix]:
            case "BVH":
                return b"".join(encoded_parts(texts[name]))
            case "character":
                return character_animation(job.target, clip)
            case "VRMA":
                return b"".join(vrma(clip.motion, clip.name, clip.extras))
            case "arrays":
                return job.writing.arrays(replace(clip, labels=labels_of(result)))

    output, *others = map(made, names)
    if isinstance(output, bytes):
        record["output_hash"] = hash_of(output)
    return Result(record, output, report, dict(zip(job.others, others, strict=True)))


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
            warm(self._objective)
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
        yield from _convert(workers, [replace(job, split=False)], deadly)
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
    """Submit a clip to one worker, or split it for all; if a worker has died, start others first."""
    try:
        executor = workers.executor
        return _split(executor, job) if job.split else executor.submit(convert, job)
    except BrokenExecutor as error:
        if again:
            workers.close()
            return _submit(workers, job, again=False)
        advice = 'a script that converts needs a file of its own, with `if __name__ == "__main__":`'
        raise BatchError(f"the workers die as they start; {advice}") from error


def _split(executor: Executor, job: Job) -> Future[Result]:
    """Retarget a clip in chunks for all workers, from a thread that does not keep the program from ending."""
    future: Future[Result] = Future()

    def run() -> None:
        try:
            future.set_result(convert(job, executor.map))
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future


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
