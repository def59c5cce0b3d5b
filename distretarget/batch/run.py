"""The run over a plan: clips go to workers, what comes back is written, and the manifest tells of it."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from distretarget.batch.manifest import Manifest, Recipe, Record, record_of
from distretarget.batch.plan import Work
from distretarget.batch.pools import Pool
from distretarget.batch.task import Outcome, Task, convert
from distretarget.conversion import Text
from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.files import hash_of, hash_of_file, read_bytes, text_of, write_whole
from distretarget.report import About

PATIENCE = 5.0  # seconds without a result after which workers are looked after
AHEAD = 2  # tasks for each worker that are read and handed over before there is a worker for them
CUT = 1 << 20  # bytes from which a clip may be cut into pieces, if it would keep one worker busy when all else is done


class Watcher(Protocol):
    """Sees a run go on."""

    def clip(self, record: Record | None) -> None:
        """A clip is dealt with: its line, or None where there was nothing to do."""

    def report(self, work: Work, outcome: Outcome) -> None:
        """The report on a clip is there, of its outcome."""


@dataclass
class _Running:
    """A clip that is with a worker.

    Attributes:
        work: the clip.
        content_hash: of the file.
        task: what the worker has.
        alone: whether no other clip is with a worker, for one that has seen a worker die.
    """

    work: Work
    content_hash: str
    task: Task
    alone: bool = False


@dataclass
class Run:
    """A run.

    Attributes:
        folder: of the results.
        recipe: what decides an output besides clip and target.
        manifest: of the folder.
        pool: the workers.
        watcher: sees it go on.
        overwrite: whether outputs are replaced that were not made here, and made anew that are done.
        fail_fast: whether the first failure ends the run.
        about: what the report on a clip says of it; None for no report.
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

    def go(self, works: Iterable[Work], left: int) -> None:
        """Convert the clips of a plan, the largest first, of `left` bytes altogether.

        Raises:
            BatchError: the workers are gone, or a clip failed and `fail_fast` is set.
        """
        for work in works:
            while len(self._running) >= AHEAD * self.pool.workers:
                self._finish_some()
            self._begin(work, left)
            left -= work.clip.size
        while self._running:
            self._finish_some()
        for suspect in self._suspects:
            suspect.alone = True
            self._submit(suspect, cut=False)
            while self._running:
                self._finish_some()

    # ---- a clip begins

    def _begin(self, work: Work, left: int) -> None:
        """Read a clip and hand it to a worker, if there is anything to do."""
        try:
            content = read_bytes(work.clip.path)
            content_hash = hash_of(content)
            if not self.overwrite and self.manifest.is_done(work, content_hash, self.recipe, self.folder):
                self.watcher.clip(None)
                return
            text = Text(text_of(content, work.clip.path), work.clip.path)
        except FileError as error:
            self._tell(record_of(work, None, self.recipe, error=str(error)))
            return
        about = self.about(work) if self.about else None
        task = Task(text, work.target, self.recipe.map, self.recipe.options, about)
        cut = work.clip.size > CUT and work.clip.size > left / self.pool.workers
        self._submit(_Running(work, content_hash, task), cut)

    def _submit(self, running: _Running, cut: bool) -> None:
        task, pool = running.task, self.pool
        future = _in_thread(convert, task, pool.executor.map) if cut else _handed(task, pool)
        self._running[future] = running

    # ---- a clip ends

    def _finish_some(self) -> None:
        """Wait for workers, and deal with what they are done with."""
        done, _ = wait(self._running, PATIENCE, FIRST_COMPLETED)
        if not done and self.pool.lost():
            unheard, self._running = self._running, {}
            self.pool.renew()
            for each in unheard.values():
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
            except Exception as error:  # of the cluster: whatever it is, it is this clip's
                outcome = Outcome(version=self.recipe.version, error=f"{running.work.clip.path}: {_said(error)}")
            self._finish(running, outcome)

    def _suspect(self, running: _Running) -> None:
        """Deal with a clip that was with a worker, or on its way to one, when a worker died."""
        if running.alone:
            reason = "the process that converted it died, perhaps out of memory"
            self._finish(running, Outcome(version=self.recipe.version, error=f"{running.work.clip.path}: {reason}"))
        else:
            self._suspects.append(running)

    def _finish(self, running: _Running, outcome: Outcome) -> None:
        """Write what came of a clip."""
        work, error = running.work, outcome.error
        if outcome.version != self.recipe.version:
            error = f"{work.clip.path}: a worker runs version {outcome.version}, this is {self.recipe.version}"
        record = record_of(
            work,
            running.content_hash,
            self.recipe,
            seconds=round(outcome.seconds, 3),
            frames=outcome.frames,
            figures=outcome.figures,
            warnings=list(outcome.warnings),
            error=error or None,
        )
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
        self._tell(record)

    def _write(self, work: Work, text: str, record: Record) -> None:
        path = self.folder / work.place
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(path.parent, "the folder cannot be made: " + (error.strerror or str(error))) from error
        standing = hash_of_file(path)
        if standing == record["output_hash"]:  # another run was faster
            self.manifest.add(record)
            return
        if not self.overwrite:
            self.manifest.check_replaceable(work, path, standing)
        write_whole(path, text, self.overwrite or path.exists(), lambda: self.manifest.add(record))

    def _tell(self, record: Record) -> None:
        """Note that a clip failed."""
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
    """The clips that were converted once more, for their reports; without those of which none can be made."""
    pending: deque[tuple[Work, Task, Future[Outcome]]] = deque()
    for work in works:
        if len(pending) >= AHEAD * pool.workers:
            yield from _reported(*pending.popleft(), pool)
        with contextlib.suppress(FileError):
            text = Text(text_of(read_bytes(work.clip.path), work.clip.path), work.clip.path)
            task = Task(text, work.target, recipe.map, recipe.options, about(work))
            pending.append((work, task, _handed(task, pool)))
    while pending:
        yield from _reported(*pending.popleft(), pool)


def _reported(work: Work, task: Task, future: Future[Outcome], pool: Pool) -> Iterator[tuple[Work, Outcome]]:
    try:
        outcome = future.result()
    except BrokenExecutor:  # this clip's fault, or that of another
        future = _handed(task, pool)
        try:
            outcome = future.result()
        except (BrokenExecutor, CancelledError):
            return
    except CancelledError:
        return
    if outcome.report:
        yield work, outcome


def _handed(task: Task, pool: Pool) -> Future[Outcome]:
    """A task that was handed to the workers, to new ones if those there are gone."""
    try:
        return pool.executor.submit(convert, task)
    except BrokenExecutor:
        pool.renew()
        return pool.executor.submit(convert, task)


def _said(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _in_thread(function: Callable[..., Outcome], *arguments: Any) -> Future[Outcome]:
    """What a function returns, from a thread that the end of the program does not wait for."""
    future: Future[Outcome] = Future()

    def run() -> None:
        try:
            future.set_result(function(*arguments))
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future
