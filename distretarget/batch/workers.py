"""Retarget clips by workers, a few at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from distretarget.batch.cluster import Cluster
from distretarget.batch.job import Job, Result
from distretarget.batch.processes import Processes

QUEUED = 2  # jobs submitted at a time, running or waiting [jobs per worker]

Workers = Processes | Cluster


def convert_all(workers: Workers, jobs: Iterable[Job]) -> Iterator[Result]:
    """Retarget clips, a few at a time, and yield the results as they come.

    The clip of a worker that dies is tried again at the end, alone; one that kills its worker again fails.

    Raises:
        BatchError: the workers are gone, or die as they start.
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
    """Retarget clips, and yield them with their results; None if the worker died."""
    running = 0
    for job in jobs:
        workers.submit(job)
        running += 1
        while running >= QUEUED * workers.count:
            for finished in workers.finished():
                running -= 1
                yield finished
    while running:
        for finished in workers.finished():
            running -= 1
            yield finished
