"""The run over a plan: clips go to workers, their results are written, and the manifest records what was done."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from distretarget.batch.manifest import Manifest
from distretarget.batch.plan import Work
from distretarget.batch.pools import Pool
from distretarget.batch.record import ManifestRecord, Recipe, failed_record
from distretarget.batch.task import Outcome, Task, convert
from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.files import (
    Text,
    check_inside,
    hash_of,
    hash_of_file,
    make_folder,
    read_bytes,
    text_of,
    write_whole,
)
from distretarget.report.document import About

CHECK_INTERVAL = 5.0  # time without a result after which the run checks that all workers are alive [s]
QUEUED = 2  # tasks that are submitted at a time, running or waiting [tasks per worker]
WAITS = 12  # how many intervals without a result pass from one line on that to the next
SPLIT_SIZE = 1 << 20  # smallest clip that is split into chunks if it would keep one worker busy at the end [bytes]


class Watcher(Protocol):
    """Receives the progress of a run."""

    def clip(self, record: ManifestRecord | None) -> None:
        """Take note that a clip is done or has failed; `record` is None if there was nothing to do."""

    def waiting(self, reason: str) -> None:
        """Take note that no results come, and why."""

    def report(self, work: Work, outcome: Outcome) -> None:
        """Take the report on a clip, which is in its outcome."""


@dataclass
class _Running:
    """A clip that has been submitted to a worker.

    Attributes:
        work: the clip.
        content_hash: the hash of the clip's file.
        task: the task of the worker.
        alone: whether it is the only submitted clip, after an earlier try in which a worker died.
    """

    work: Work
    content_hash: str
    task: Task
    alone: bool = False


@dataclass(kw_only=True)
class Run:
    """A run over a plan.

    Attributes:
        folder: the folder of results.
        recipe: what determines an output besides clip and target.
        manifest: the manifest of the folder.
        pool: the workers.
        watcher: receives the progress.
        overwrite: whether to convert again what is done, and to replace files that no batch made.
        fail_fast: whether the first failure ends the run.
        about: returns what the report on a clip says of it; None for no reports.
    """

    folder: Path
    recipe: Recipe
    manifest: Manifest
    pool: Pool
    watcher: Watcher
    overwrite: bool = False
    fail_fast: bool = False
    about: Callable[[Work], About] | None = None
    _running: dict[Future[Outcome], _Running] = field(default_factory=dict)
    _suspects: list[_Running] = field(default_factory=list)
    _waits: int = 0

    def go(self, works: Iterable[Work], left: int) -> None:
        """Convert the clips of a plan, the largest first; `left` is their total size [bytes].

        Raises:
            BatchError: the workers are gone, or a clip failed and `fail_fast` is set.
        """
        for work in works:
            while len(self._running) >= QUEUED * self.pool.workers:
                self._finish_some()
            self._begin(work, left)
            left -= work.clip.size
        while self._running:
            self._finish_some()
        for suspect in self._suspects:
            suspect.alone = True
            self._submit(suspect, split=False)
            while self._running:
                self._finish_some()

    # ---- a clip begins

    def _begin(self, work: Work, left: int) -> None:
        """Read a clip and submit it to a worker, unless it is done already."""
        try:
            content = read_bytes(work.clip.path)
            content_hash = hash_of(content)
            self.manifest.catch_up()
            if not self.overwrite and self.manifest.is_done(work, content_hash, self.recipe, self.folder):
                self.manifest.confirm(work)
                self.watcher.clip(None)
                return
            task = _task_of(work, content, self.recipe, self.about)
        except FileError as error:
            self._record_failure(failed_record(work, None, self.recipe) | {"error": str(error)})
            return
        split = work.clip.size > SPLIT_SIZE and work.clip.size > left / self.pool.workers
        self._submit(_Running(work, content_hash, task), split)

    def _submit(self, running: _Running, split: bool) -> None:
        """Submit a clip to one worker, or split it into chunks for all workers."""
        task, pool = running.task, self.pool
        future = _in_thread(convert, task, pool.executor.map) if split else _submitted(task, pool)
        self._running[future] = running

    # ---- a clip ends

    def _finish_some(self) -> None:
        """Wait until at least one clip is converted, and write the results of those that are."""
        done, _ = wait(self._running, CHECK_INTERVAL, FIRST_COMPLETED)
        self._waits = 0 if done else self._waits + 1
        if self._waits % WAITS == 1 and (reason := self.pool.trouble()):
            self.watcher.waiting(reason)
        if not done and self.pool.lost():
            unfinished, self._running = self._running, {}
            self.pool.renew()
            for each in unfinished.values():
                self._suspect(each)
        for future in done:
            running = self._running.pop(future)
            try:
                outcome = future.result()
            except BrokenExecutor:
                self._suspect(running)
                continue
            except CancelledError as error:
                raise BatchError("the workers are gone; run this again to go on") from error
            except Exception as error:  # of the cluster; it concerns this clip only
                outcome = Outcome(version=self.recipe.version, error=f"{running.work.clip.path}: {_described(error)}")
            self._finish(running, outcome)

    def _suspect(self, running: _Running) -> None:
        """Keep a clip for another try after a worker died; if the clip was the only one submitted, it fails."""
        if running.alone:
            reason = "the process that converted it died, perhaps out of memory"
            self._finish(running, Outcome(version=self.recipe.version, error=f"{running.work.clip.path}: {reason}"))
        else:
            self._suspects.append(running)

    def _finish(self, running: _Running, outcome: Outcome) -> None:
        """Write the result of a clip, or record that it failed."""
        work, error = running.work, outcome.error
        if outcome.version != self.recipe.version:
            error = f"{work.clip.path}: a worker runs version {outcome.version}, this is {self.recipe.version}"
        record = failed_record(work, running.content_hash, self.recipe) | {
            "seconds": round(outcome.seconds, 3),
            "frames": outcome.frames,
            "figures": outcome.figures,
            "notes": list(outcome.notes),
            "warnings": list(outcome.warnings),
            "error": error or None,
        }
        if not error:
            record |= {"status": "done", "output_hash": outcome.bvh_hash}
            try:
                self._write(work, outcome.bvh, record)
            except DistretargetError as fault:
                record |= {"status": "failed", "output_hash": None, "error": str(fault)}
            else:
                self.watcher.clip(record)
                if outcome.report:
                    self.watcher.report(work, outcome)
                return
        self._record_failure(record)

    def _write(self, work: Work, text: str, record: ManifestRecord) -> None:
        """Write an output, with its record just before it is put in place."""
        path = self.folder / work.place
        check_inside(path, self.folder)
        make_folder(path.parent)
        existing_hash = hash_of_file(path)
        try:
            self._put(work, path, existing_hash, text, record)
        except FileError:
            if (hash_now := hash_of_file(path)) == existing_hash:
                raise
            self._put(work, path, hash_now, text, record)  # another run has written the file meanwhile

    def _put(self, work: Work, path: Path, existing_hash: str | None, text: str, record: ManifestRecord) -> None:
        """Put an output in the place of a file with this hash, unless that is the output already."""
        if existing_hash == record["output_hash"]:
            self.manifest.add(record)  # another run was faster
            return
        if not self.overwrite:
            self.manifest.catch_up()
            self.manifest.check_replaceable(work, path, existing_hash)
        write_whole(path, text, self.overwrite or existing_hash is not None, lambda: self.manifest.add(record))

    def _record_failure(self, record: ManifestRecord) -> None:
        """Record that a clip failed."""
        try:
            self.manifest.add(record)
        except FileError as error:
            record["error"] = f"{record['error']} ({error})"
        self.watcher.clip(record)
        if self.fail_fast:
            raise BatchError(f"stopped at the first failure: {record['error']}")


def reports(
    works: Iterable[Work], recipe: Recipe, about: Callable[[Work], About], pool: Pool
) -> Iterator[tuple[Work, Outcome]]:
    """Convert clips again for their reports, and yield those for which a report could be made."""
    pending: deque[tuple[Work, Task, Future[Outcome]]] = deque()
    for work in works:
        if len(pending) >= QUEUED * pool.workers:
            yield from _reported(*pending.popleft(), pool)
        with contextlib.suppress(FileError):
            task = _task_of(work, read_bytes(work.clip.path), recipe, about)
            pending.append((work, task, _submitted(task, pool)))
    while pending:
        yield from _reported(*pending.popleft(), pool)


def _task_of(work: Work, content: bytes, recipe: Recipe, about: Callable[[Work], About] | None) -> Task:
    """The task for a clip whose file has this content.

    Raises: FileError: the content is not text.
    """
    return Task(
        source=Text(text_of(content, work.clip.path), work.clip.path),
        target=work.target,
        map=recipe.map,
        options=recipe.options,
        about=about(work) if about else None,
    )


def _reported(work: Work, task: Task, future: Future[Outcome], pool: Pool) -> Iterator[tuple[Work, Outcome]]:
    """The clip with its outcome, if that has a report; after a worker died, the clip is tried once more."""
    try:
        outcome = future.result()
    except BrokenExecutor:  # this clip or another one killed a worker
        future = _submitted(task, pool)
        try:
            outcome = future.result()
        except (BrokenExecutor, CancelledError):
            return
    except CancelledError:
        return
    if outcome.report:
        yield work, outcome


def _submitted(task: Task, pool: Pool) -> Future[Outcome]:
    """The future of a task submitted to the workers, which are replaced first if one of them has died."""
    try:
        return pool.executor.submit(convert, task)
    except BrokenExecutor:
        pool.renew()
    try:
        return pool.executor.submit(convert, task)
    except BrokenExecutor as error:
        advice = 'a script that converts needs a file of its own, with `if __name__ == "__main__":`'
        raise BatchError(f"the workers die as they start; {advice}") from error


def _described(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _in_thread(function: Callable[..., Outcome], *arguments: Any) -> Future[Outcome]:
    """The future of a function that runs in a thread, for which the end of the program does not wait."""
    future: Future[Outcome] = Future()

    def run() -> None:
        try:
            future.set_result(function(*arguments))
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future
