"""Workers: the result of a clip is that of `retarget`, or says what went wrong; clusters that cannot be used."""

import os
import pickle
import signal
import sys
from contextlib import closing
from multiprocessing import active_children
from pathlib import Path

import pytest
from bodies import other_lengths, person, swaying
from bvh_texts import format_bvh
from input_files import file_of, target_of

from distretarget.batch import workers as workers_module
from distretarget.batch.plan import PlannedClip
from distretarget.batch.results import new_record
from distretarget.batch.workers import Job, Processes, run
from distretarget.errors import BatchError
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.pipeline import retargeting
from distretarget.pipeline.retargeting import Recipe

TARGET = target_of(skeleton_to_json(other_lengths(person()), "body"), "body.json")


def job_of(text, target=TARGET, about=None):
    record = new_record(PlannedClip(Path("in.bvh"), target, ("out.bvh",), 0), {})
    return Job(file_of(text, "in.bvh"), pickle.dumps(target), Recipe(), record, ("out.bvh",), about=about)


def error_of(job):
    record = run(job).record
    assert (record["status"], record["output_hash"]) == ("failed", "")
    return record["error"]


def test_a_worker_says_what_went_wrong(monkeypatch):
    assert error_of(job_of("HIERARCHY")).startswith("in.bvh:1: ")

    def fail(*_):
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr(retargeting, "parse_motion", fail)
    assert error_of(job_of("")) == "in.bvh: unexpected ZeroDivisionError: two lines; please report this"

    def fill(*_):
        raise MemoryError

    monkeypatch.setattr(retargeting, "parse_motion", fill)
    assert error_of(job_of("")) == "in.bvh: out of memory"


def test_a_worker_starts_with_one_thread_unless_the_user_says_otherwise(monkeypatch):
    """There is a worker for each core; with more threads they would get in each other's way."""
    for name in workers_module.THREAD_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    with workers_module._worker_environment():
        threads = {name: os.environ[name] for name in workers_module.THREAD_VARIABLES}
    assert threads == {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "3"}
    assert "OMP_NUM_THREADS" not in os.environ


def test_a_worker_of_another_version_refuses(monkeypatch):
    job = job_of("")
    monkeypatch.setattr(workers_module, "VERSION", "0")
    assert error_of(job) == f"in.bvh: a worker runs version 0, this is {job.record['version']}"


@pytest.fixture
def processes():
    with closing(Processes(1)) as some:
        yield some


def results_of(processes, count):
    found = []
    while len(found) < count:
        found += processes.finished()
    return found


def test_a_process_that_dies_costs_the_clip_that_it_was_at_work_on(processes):
    clips = [job_of(format_bvh(swaying(person(), frames=frames))) for frames in (20_000, 20)]
    for job in clips:
        processes.submit(job)
    for child in active_children():
        os.kill(child.pid, signal.SIGKILL)
    (first, died), (second, done) = results_of(processes, 2)
    assert (first, died, second) == (clips[0], None, clips[1])
    assert done.record["status"] == "done"


def test_processes_that_die_as_they_start_are_reported(monkeypatch):
    monkeypatch.setattr(workers_module, "_work", die)
    with closing(Processes(2)) as processes, pytest.raises(BatchError, match="the workers die as they start"):
        processes.submit(job_of(""))


def die(_pipe, _temporary):
    os._exit(1)


ADDRESS = "tcp://machine:8786"


class Idle:
    """A client of a cluster without workers."""

    def __init__(self, *_, **__):
        pass

    def ncores(self):
        return {}

    def get_executor(self, **_):
        pass

    def close(self, **_):
        pass


class Busy(Idle):
    """A client of a cluster whose workers have gone since."""

    def ncores(self):
        return {"worker": 2}

    def scheduler_info(self):
        return {"workers": {}}


@pytest.fixture
def cluster(monkeypatch):
    """The class of the cluster, which needs Dask, with one that answers as a scheduler."""
    pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    monkeypatch.setattr(workers_module, "_kind", answer("Scheduler"))
    return workers_module.Cluster


def is_refused(cluster, reason):
    with pytest.raises(BatchError, match=reason):
        cluster(ADDRESS, print)


def answer(kind):
    """What the Dask process at the address says that it is."""

    async def kind_of(_address):
        return kind

    return kind_of


def test_a_cluster_without_workers(cluster, monkeypatch):
    monkeypatch.setattr("distributed.Client", Idle)
    is_refused(cluster, f"the Dask scheduler at {ADDRESS} has no workers")
    monkeypatch.setattr(workers_module, "_kind", answer("Worker"))
    is_refused(cluster, f"{ADDRESS!r} is the address of a Dask worker; expected that of the scheduler")


def test_workers_that_are_gone_are_reported_now_and_then(cluster, monkeypatch):
    monkeypatch.setattr("distributed.Client", Busy)
    reasons = []
    gone = cluster(ADDRESS, reasons.append)
    monkeypatch.setattr(workers_module, "CHECK_INTERVAL", 0.0)
    assert [*gone.finished(), *gone.finished()] == []
    assert reasons == ["the Dask cluster has no workers"]


def test_an_installation_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    is_refused(workers_module.Cluster, "--dask needs the package distributed")
