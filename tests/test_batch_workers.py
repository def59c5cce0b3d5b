"""The conversion of one clip by a worker: its result is that of `retarget`, or says what went wrong."""

import errno
import os
import pickle
import threading
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from bodies import other_lengths, person, swaying
from input_files import file_of, target_of

from distretarget import retarget
from distretarget.batch import job as batch_job
from distretarget.batch import workers
from distretarget.batch.job import Job, Recipe, convert
from distretarget.batch.plan import Clip
from distretarget.batch.record import new_record
from distretarget.errors import BatchError
from distretarget.io.bvh import parse_bvh
from distretarget.io.bvh_writer import format_bvh
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.report.diff_document import About

TARGET = target_of(skeleton_to_json(other_lengths(person()), "body"), "body.json")


def job_of(text, target=TARGET, about=None):
    record = new_record(Clip(Path("in.bvh"), target, ("out.bvh",), 0), {})
    return Job(file_of(text, "in.bvh"), pickle.dumps(target), Recipe(), record, ("out.bvh",), about=about)


def test_a_worker_does_what_retargeting_does():
    text = format_bvh(swaying(person()))
    result = convert(job_of(text))
    record = result.record
    assert (record["status"], record["error"], record["frames"]) == ("done", "", 20)
    expected = format_bvh(retarget(parse_bvh(text, "in.bvh"), other_lengths(person())).motion)
    assert result.outputs == {"out.bvh": expected.encode()}
    assert record["metrics"]["bone_error"] < 1e-9
    assert "<title>" in convert(job_of(text, about=About(a="a", b="b", command="", version="1"))).report
    assert convert(replace(job_of(text), threads=2)).outputs == result.outputs


def error_of(job):
    record = convert(job).record
    assert (record["status"], record["output_hash"]) == ("failed", "")
    return record["error"]


def test_a_worker_stops_a_clip_that_takes_longer_than_its_limit(monkeypatch):
    def last_for_ever(*_, **__):
        while True:
            with suppress(Exception):
                time.sleep(0.001)

    monkeypatch.setattr(batch_job, "retarget_onto", last_for_ever)
    job = replace(job_of(format_bvh(swaying(person()))), time_limit=0.05)
    assert error_of(job) == "in.bvh: took longer than the limit of 0.05 s; the next run tries it again"
    monkeypatch.undo()
    assert convert(replace(job, time_limit=1000.0)).record["status"] == "done"
    assert not [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer) and thread.is_alive()]


def test_a_worker_says_what_went_wrong(monkeypatch):
    assert error_of(job_of("HIERARCHY")).startswith("in.bvh:1: ")

    def fail(*_):
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr(batch_job, "parse_motion", fail)
    assert error_of(job_of("")) == "in.bvh: unexpected ZeroDivisionError: two lines; please report this"


def test_a_clip_too_large_for_the_memory_fails_alone(monkeypatch):
    def fill(*_):
        raise MemoryError

    monkeypatch.setattr(batch_job, "parse_motion", fill)
    assert error_of(job_of("")) == "in.bvh: out of memory"


def test_a_worker_starts_with_one_thread_unless_the_user_says_otherwise(monkeypatch):
    """There is a worker for each core; with more threads they would get in each other's way."""
    for name in workers.THREAD_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    with workers._worker_environment():
        threads = {name: os.environ[name] for name in workers.THREAD_VARIABLES}
    assert threads == {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "3"}
    assert "OMP_NUM_THREADS" not in os.environ


def test_a_worker_of_another_version_refuses(monkeypatch):
    job = job_of("")
    monkeypatch.setattr(batch_job, "VERSION", "0")
    assert error_of(job) == f"in.bvh: a worker runs version 0, this is {job.record['version']}"


def test_a_machine_without_shared_memory_says_so_in_one_line(monkeypatch):
    def refuse(*_):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(workers, "ProcessPoolExecutor", refuse)
    with pytest.raises(BatchError, match="/dev/shm: Read-only file system; make it writable"):
        _ = workers.Processes(2).executor
