"""Running a plan: what is written and skipped, and the effects of failures, dying workers and stops."""

from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

import pytest
from bodies import other_lengths, person

from distretarget.batch import run as batch_run
from distretarget.batch.clips import find_clips
from distretarget.batch.manifest import Manifest
from distretarget.batch.plan import plan
from distretarget.batch.record import Recipe, read_records
from distretarget.batch.run import Run, reports
from distretarget.batch.task import Outcome
from distretarget.errors import BatchError, FileError
from distretarget.io.files import Text
from distretarget.io.map_json import MapFile
from distretarget.io.target_file import skeleton_to_json
from distretarget.pipeline.options import Options

TARGET = Text(skeleton_to_json(other_lengths(person()), "body"), "body.json")
RECIPE = Recipe(Options(), MapFile({}, ""), "1")


class Inline(Executor):
    """An executor that runs a task as soon as it is submitted."""

    def submit(self, function, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


class Pool:
    """A pool that runs a task as soon as it is submitted."""

    workers = 2

    def __init__(self, executor=None):
        self.executor = executor or Inline()
        self.renewals = 0

    def renew(self):
        self.renewals += 1

    def trouble(self):
        return ""

    def stop(self):
        pass


class Seen:
    """A listener that keeps what a run reports."""

    def __init__(self):
        self.records, self.htmls, self.reasons = [], {}, []

    def waiting(self, reason):
        self.reasons.append(reason)

    def clip(self, record):
        self.records.append(record)

    def report(self, work, outcome):
        self.htmls[work.place.as_posix()] = outcome.report

    def of(self, status):
        return [record["output"] for record in self.records if record and record["status"] == status]

    @property
    def skipped(self):
        return self.records.count(None)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Clips are copied instead of converted; those with the word `fail` in them fail."""

    def convert(task, *_):
        error = "it fails" if "fail" in task.source.text else ""
        return Outcome(
            version="1",
            seconds=0.5,
            error=error,
            bvh=f"{task.target.path}: {task.source.text}",
            frames=7,
            notes=("a tail",),
            warnings=("careful",),
            report=task.about or "",
        )

    monkeypatch.setattr(batch_run, "convert", convert)


@pytest.fixture
def folder(tmp_path):
    for name, text in (("a.bvh", "one"), ("deep/b.bvh", "other"), ("c.bvh", "third clip")):
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / name).write_text(text)
    return tmp_path


def works_in(folder):
    return plan(find_clips([folder / "in"]).clips, [TARGET], folder / "out", [folder / "in"])


def go(folder, pool=None, recipe=RECIPE, works=None, **others):
    seen, manifest = Seen(), Manifest(folder / "out")
    try:
        Run(folder=folder / "out", recipe=recipe, manifest=manifest, pool=pool or Pool(), watcher=seen, **others).go(
            works or works_in(folder), 100
        )
    finally:
        manifest.close()
    return seen


def results(folder):
    files = (path for path in (folder / "out").rglob("*") if path.is_file() and path.suffix != ".jsonl")
    return {path.relative_to(folder / "out").as_posix(): path.read_text() for path in files}


def test_every_clip_gets_an_output_and_a_line(folder):
    seen = go(folder)
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]
    assert results(folder) == {
        "a.bvh": "body.json: one",
        "c.bvh": "body.json: third clip",
        "deep/b.bvh": "body.json: other",
    }
    lines = list(read_records(folder / "out" / "manifest.jsonl"))
    assert lines == seen.records
    assert {
        (line["frames"], line["seconds"], line["version"], *line["notes"], *line["warnings"]) for line in lines
    } == {(7, 0.5, "1", "a tail", "careful")}


def test_a_second_run_has_nothing_to_do(folder):
    go(folder)
    seen = go(folder)
    assert seen.records == [None] * 3
    assert len(list(read_records(folder / "out" / "manifest.jsonl"))) == 3


def test_what_changed_is_done_again(folder):
    go(folder)
    (folder / "in" / "a.bvh").write_text("one, changed")
    (folder / "out" / "c.bvh").unlink()
    seen = go(folder)
    assert (sorted(seen.of("done")), seen.skipped) == (["a.bvh", "c.bvh"], 1)
    assert results(folder)["a.bvh"] == "body.json: one, changed"
    assert len(go(folder, recipe=replace(RECIPE, options=Options(supports="free"))).of("done")) == 3
    assert len(go(folder, recipe=replace(RECIPE, map=MapFile({"Head": None}, "m.json"))).of("done")) == 3
    other = plan(find_clips([folder / "in"]).clips, [replace(TARGET, text="{}")], folder / "out", [])
    assert len(go(folder, works=other).of("done")) == 3


def test_all_is_done_again_if_asked(folder):
    go(folder)
    assert len(go(folder, overwrite=True).of("done")) == 3


def test_a_failure_is_reported_and_tried_again(folder):
    (folder / "in" / "a.bvh").write_text("fail")
    seen = go(folder)
    assert (seen.of("failed"), len(seen.of("done"))) == (["a.bvh"], 2)
    assert "a.bvh" not in results(folder)
    again = go(folder)
    assert (again.of("failed"), again.skipped) == (["a.bvh"], 2)
    (folder / "in" / "a.bvh").write_text("mended")
    assert go(folder).of("done") == ["a.bvh"]


def test_the_first_failure_ends_the_run_if_asked(folder):
    (folder / "in" / "c.bvh").write_text("fail " * 10)
    with pytest.raises(BatchError, match="stopped at the first failure: it fails"):
        go(folder, fail_fast=True)


def test_files_that_cannot_be_read_fail_alone(folder):
    works = works_in(folder)
    (folder / "in" / "a.bvh").unlink()
    (folder / "in" / "c.bvh").write_bytes(b"\0binary")
    seen = go(folder, works=works)
    assert (sorted(seen.of("failed")), seen.of("done")) == (["a.bvh", "c.bvh"], ["deep/b.bvh"])
    errors = {record["output"]: record["error"] for record in seen.records}
    assert errors["a.bvh"].endswith("a.bvh: there is no such file")
    assert "is not a text file" in errors["c.bvh"]


def test_files_that_were_not_made_here_are_left_alone(folder):
    (folder / "out").mkdir()
    (folder / "out" / "a.bvh").write_text("mine")
    seen = go(folder)
    assert seen.of("failed") == ["a.bvh"]
    (failed,) = (record for record in seen.records if record["status"] == "failed")
    assert failed["error"].endswith("exists already; --overwrite replaces it")
    assert results(folder)["a.bvh"] == "mine"
    assert "a.bvh" in go(folder, overwrite=True).of("done")
    assert results(folder)["a.bvh"] == "body.json: one"


def test_what_another_run_writes_meanwhile_is_no_failure(folder, monkeypatch):
    """The other run, with other options, writes between the look at a place and the output for it."""
    look, convert, looks = batch_run.hash_of_file, batch_run.convert, []

    def late(path):
        found = look(path)
        if not looks:
            looks.append(path)
            with monkeypatch.context() as other:
                other.setattr(batch_run, "convert", lambda task, *_: replace(convert(task), bvh="with other options"))
                go(folder, recipe=replace(RECIPE, options=Options(root_scale=2.0)))
            assert set(results(folder).values()) == {"with other options"}
        return found

    monkeypatch.setattr(batch_run, "hash_of_file", late)
    assert len(go(folder).of("done")) == 3
    assert results(folder)["a.bvh"] == "body.json: one"


def test_an_output_that_was_edited_is_left_alone(folder):
    go(folder)
    (folder / "out" / "a.bvh").write_text("edited")
    assert go(folder).of("failed") == ["a.bvh"]
    assert results(folder)["a.bvh"] == "edited"


def test_a_file_in_the_place_of_a_folder_fails_the_clips_below_it(folder):
    (folder / "out").mkdir()
    (folder / "out" / "deep").write_text("a file")
    seen = go(folder)
    assert seen.of("failed") == ["deep/b.bvh"]
    assert len(seen.of("done")) == 2


def test_a_line_is_written_before_its_output_is_in_place(folder, monkeypatch):
    def full(manifest, _):
        raise FileError(manifest.path, "the disk is full")

    monkeypatch.setattr(Manifest, "add", full)
    seen = go(folder)
    assert len(seen.of("failed")) == 3
    assert "the disk is full" in seen.records[0]["error"]
    assert results(folder) == {}


def test_a_worker_of_another_version_is_reported(folder):
    seen = go(folder, recipe=replace(RECIPE, version="2"))
    assert "a worker runs version 1, this is 2" in seen.records[0]["error"]
    assert results(folder) == {}


class Dying(Inline):
    """A pool that dies when it is given certain clips, and does nothing more until it is renewed."""

    def __init__(self, deadly, always):
        self.deadly, self.always, self.dead = deadly, always, False
        self.tasks = 0

    def submit(self, function, task):
        if self.dead:
            raise BrokenProcessPool("dead before")
        self.tasks += 1
        if self.deadly in task.source.text:
            self.dead = True
            self.deadly = self.deadly if self.always else "nothing"
            future = Future()
            future.set_exception(BrokenProcessPool("died"))
            return future
        return super().submit(function, task)


class Renewing(Pool):
    def renew(self):
        super().renew()
        self.executor.dead = False


def test_a_worker_that_dies_costs_a_retry(folder):
    pool = Renewing(Dying("other", always=False))
    seen = go(folder, pool)
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]
    assert pool.renewals == 1


def test_a_clip_that_kills_its_worker_fails_alone(folder):
    seen = go(folder, Renewing(Dying("other", always=True)))
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh"]
    assert seen.of("failed") == ["deep/b.bvh"]
    assert "the process that converted it died" in seen.records[-1]["error"]


def test_workers_that_cannot_start_end_the_run(folder):
    class NeverStarting(Inline):
        def submit(self, *_):
            raise BrokenProcessPool("dead")

    with pytest.raises(BatchError, match="the workers die as they start"):
        go(folder, Pool(NeverStarting()))


def test_a_cluster_that_goes_away_ends_the_run(folder):
    class Gone(Inline):
        def submit(self, *_):
            future = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    with pytest.raises(BatchError, match="the workers are gone"):
        go(folder, Pool(Gone()))


def test_what_a_cluster_raises_is_its_clips_failure(folder):
    class Raising(Inline):
        def submit(self, *_):
            future = Future()
            future.set_exception(RuntimeError("killed\nthrice"))
            return future

    seen = go(folder, Pool(Raising()))
    assert len(seen.of("failed")) == 3
    assert all(record["error"].endswith(".bvh: RuntimeError: killed thrice") for record in seen.records)


def test_a_clip_that_would_keep_one_worker_busy_at_the_end_is_cut(folder, monkeypatch):
    cut = []
    monkeypatch.setattr(batch_run, "SPLIT_SIZE", 4)
    monkeypatch.setattr(
        batch_run, "_in_thread", lambda function, task, _: cut.append(task) or Inline().submit(function, task)
    )
    works = works_in(folder)  # of 10, 5 and 3 bytes
    seen = Seen()
    manifest = Manifest(folder / "out")
    Run(folder=folder / "out", recipe=RECIPE, manifest=manifest, pool=Pool(), watcher=seen).go(works, 18)
    manifest.close()
    assert [Path(task.source.path).name for task in cut] == ["c.bvh", "b.bvh"]
    assert len(seen.of("done")) == 3


def test_reports_are_made_in_a_run_and_afterwards(folder):
    seen = go(folder, about=lambda work: f"report on {work.place}")
    assert seen.htmls == {name: f"report on {name}" for name in ("c.bvh", "deep/b.bvh", "a.bvh")}
    works = works_in(folder)
    (folder / "in" / "a.bvh").unlink()
    made = {
        work.place.as_posix(): outcome.report for work, outcome in reports(works, RECIPE, lambda _: "again", Pool())
    }
    assert made == {"c.bvh": "again", "deep/b.bvh": "again"}


@pytest.mark.parametrize("always", [True, False])
def test_reports_survive_a_worker_that_dies(folder, always):
    pool = Renewing(Dying("other", always))
    pool.executor.dead = True
    made = [work.place.as_posix() for work, _ in reports(works_in(folder), RECIPE, lambda _: "again", pool)]
    assert made == ["c.bvh", "a.bvh"] if always else ["c.bvh", "deep/b.bvh", "a.bvh"]


def test_a_worker_that_dies_unnoticed_costs_a_retry(folder, monkeypatch):
    class Silent(Inline):
        lost = True

        def submit(self, function, task):
            return Future() if self.lost and "other" in task.source.text else super().submit(function, task)

    class Seeing(Pool):
        def lost(self):
            return self.executor.lost

        def trouble(self):
            return "nobody works"

        def renew(self):
            super().renew()
            self.executor.lost = False

    monkeypatch.setattr(batch_run, "CHECK_INTERVAL", 0.01)
    pool = Seeing(Silent())
    seen = go(folder, pool)
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]
    assert pool.renewals == 1
    assert seen.reasons == ["nobody works"]
