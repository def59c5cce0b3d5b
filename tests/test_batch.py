"""A batch: what is written and skipped, the reports, and the effects of failures, dying workers and stops."""

from dataclasses import replace

import pytest
from bodies import other_lengths, person
from input_files import file_of, target_of
from program import last_records

from distretarget.batch import batch as batch_module
from distretarget.batch.batch import Batch
from distretarget.batch.pages import MARK, OUTPUT_MARK, Pages
from distretarget.batch.plan import find_clips, plan
from distretarget.batch.results import Database, Results
from distretarget.batch.summary import Tally
from distretarget.batch.workers import Result, target_of_job
from distretarget.errors import BatchError, FileError
from distretarget.io.files import encoded_parts
from distretarget.io.map_json import MapFile
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.measure.metrics import COLUMNS
from distretarget.pipeline.options import Options
from distretarget.pipeline.retargeting import Recipe

TARGET = target_of(skeleton_to_json(other_lengths(person()), "body"), "body.json")


class Workers:
    """Workers that do a job as soon as somebody asks what is finished."""

    count, start_seconds = 2, 0.0

    def __init__(self):
        self.jobs = []

    def submit(self, job):
        self.jobs.append(job)

    def finished(self):
        job = self.jobs.pop(0)
        yield job, self.result(job)

    def result(self, job):
        return copied(job)


class Seen(list):
    """The records that a batch has shown."""

    def of(self, status):
        return [record["output"] for record in self if record and record["status"] == status]

    @property
    def skipped(self):
        return self.count(None)


def copied(job, *_):
    """What becomes of a clip that is copied instead of converted; those with the word `fail` in them fail."""
    try:
        if "fail" in job.source.text:
            return job.failed("it fails")
    except FileError as error:
        return job.failed(str(error))
    text = f"{target_of_job(job.target).path}: {job.source.text}"
    metrics = dict.fromkeys(COLUMNS) | {"contact_error": float(len(job.source.text))}
    done = {"seconds": 0.5, "frames": 7, "metrics": metrics, "notes": ["a tail"], "warnings": ["careful"]}
    outputs = {job.outputs[0]: b"".join(encoded_parts(text))}
    return Result(job.record | done | {"status": "done"}, outputs, f"{MARK} {job.about}" if job.about else "")


@pytest.fixture
def folder(tmp_path):
    for name, text in (("a.bvh", "one"), ("deep/b.bvh", "other"), ("c.bvh", "third clip")):
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / name).write_text(text)
    return tmp_path


def clips_in(folder, target=TARGET):
    return plan(find_clips([folder / "in"])[0], [target], folder / "out", [folder / "in"])


def batch_of(folder, clips=None, **others):
    """A batch over the clips of a folder, with the options in `others`."""
    parts = []
    for kind in (Results, Recipe, Pages):
        parts.append({name: others.pop(name) for name in [*others] if name in kind.__dataclass_fields__})
    results, recipe, pages = parts
    pages = Pages(Results(folder / "out", **results), lambda clip, _: f"report on {clip.name}", **pages)
    return Batch(clips or clips_in(folder), pages, Recipe(**recipe), **others)


def go(folder, workers=None, clips=None, **others):
    seen, batch = Seen(), batch_of(folder, clips, **others)
    batch.convert(workers or Workers(), Tally(clips=len(batch.clips)), seen.append)
    return seen


def results(folder):
    files = (path for path in (folder / "out").rglob("*.bvh") if path.is_file())
    return {path.relative_to(folder / "out").as_posix(): path.read_text() for path in files}


def test_every_clip_gets_an_output_and_a_record(folder):
    seen = go(folder)
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]
    assert results(folder) == {
        "a.bvh": "body.json: one",
        "c.bvh": "body.json: third clip",
        "deep/b.bvh": "body.json: other",
    }
    assert last_records(folder / "out") == {record["output"]: record for record in seen}
    assert {(line["frames"], line["seconds"], *line["notes"], *line["warnings"]) for line in seen} == {
        (7, 0.5, "a tail", "careful")
    }


def test_a_run_leaves_to_another_what_that_is_at_work_on(folder):
    """It takes it over at the end, if the other one has not done it by then."""
    first, begun = Database(folder / "out"), []
    assert first.claim("c.bvh")

    class Watched(Workers):
        def submit(self, job):
            begun.append(job.record["output"])
            super().submit(job)

    go(folder, Watched())
    assert begun == ["deep/b.bvh", "a.bvh", "c.bvh"]
    for name in ("c.bvh", "a.bvh"):
        (folder / "out" / name).unlink()
    assert first.claim("c.bvh")

    class Finishing(Watched):
        def result(self, job):
            (folder / "out" / "c.bvh").write_text("body.json: third clip")
            return super().result(job)

    workers = Finishing()
    workers.count = 0.5  # so that it finishes a clip before it begins the next
    seen = go(folder, workers)
    assert (begun[3:], seen.skipped) == (["a.bvh"], 2)
    first.close()


def test_what_another_run_has_done_just_now_is_not_done_again(folder, monkeypatch):
    """The other run does a clip between the look whether it is done and the claim."""

    def late(database, output):
        monkeypatch.undo()
        assert len(go(folder).of("done")) == 3
        return database.claim(output)

    monkeypatch.setattr(Database, "claim", late)
    assert go(folder) == [None] * 3


def test_what_changed_is_done_again(folder):
    go(folder)
    (folder / "in" / "a.bvh").write_text("one, changed")
    (folder / "out" / "c.bvh").unlink()
    seen = go(folder)
    assert (sorted(seen.of("done")), seen.skipped) == (["a.bvh", "c.bvh"], 1)
    assert results(folder)["a.bvh"] == "body.json: one, changed"
    assert len(go(folder, options=Options(supports="free")).of("done")) == 3
    assert len(go(folder, map_file=MapFile({"Head": None}, "m.json")).of("done")) == 3
    other = clips_in(folder, replace(TARGET, file=file_of("{}", "body.json")))
    assert len(go(folder, clips=other).of("done")) == 3
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
    clips = clips_in(folder)
    (folder / "in" / "a.bvh").unlink()
    (folder / "in" / "c.bvh").write_bytes(b"\0binary")
    seen = go(folder, clips=clips)
    assert (sorted(seen.of("failed")), seen.of("done")) == (["a.bvh", "c.bvh"], ["deep/b.bvh"])
    errors = {record["output"]: record["error"] for record in seen}
    assert errors["a.bvh"].endswith("a.bvh: there is no such file")
    assert "is not a text file" in errors["c.bvh"]


def test_what_another_run_writes_meanwhile_is_no_failure(folder):
    """The other run, with other options, converts all clips while this one converts its first."""

    class WithOtherOptions(Workers):
        def result(self, job):
            return Result(copied(job).record, {job.outputs[0]: b"with other options"})

    class Late(Workers):
        def result(self, job):
            if not results(folder):
                assert len(go(folder, WithOtherOptions(), options=Options(root_scale=2.0)).of("done")) == 3
                assert set(results(folder).values()) == {"with other options"}
            return copied(job)

    assert len(go(folder, Late()).of("done")) == 3
    assert results(folder)["a.bvh"] == "body.json: one"
    assert {record["options"]["root_scale"] for record in last_records(folder / "out").values()} == {None}


def test_an_output_that_is_there_already_is_taken_over_as_it_is(folder):
    """Byte for byte the same, it gets a line but is not written again, whoever made it: another run or a person."""
    path = folder / "out" / "a.bvh"
    path.parent.mkdir()
    path.write_text("body.json: one")
    before = path.stat()
    assert sorted(go(folder).of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]
    after = path.stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert go(folder).skipped == 3


def test_a_file_in_the_place_of_a_folder_fails_the_clips_below_it(folder):
    (folder / "out").mkdir()
    (folder / "out" / "deep").write_text("a file")
    seen = go(folder)
    assert seen.of("failed") == ["deep/b.bvh"]
    assert len(seen.of("done")) == 2


def test_a_result_is_recorded_before_it_is_in_place(folder, monkeypatch):
    def full(database, *_):
        raise FileError(database.path, "the disk is full")

    monkeypatch.setattr(Database, "add", full)
    seen = go(folder)
    assert len(seen.of("failed")) == 3
    assert "the disk is full" in seen[0]["error"]
    assert results(folder) == {}


class Dying(Workers):
    """Workers of which one dies when it is given certain clips."""

    def __init__(self, deadly, always):
        super().__init__()
        self.deadly, self.always = deadly, always

    def result(self, job):
        if self.deadly not in job.source.text:
            return copied(job)
        self.deadly = self.deadly if self.always else "nothing"
        return None


def test_a_worker_that_dies_costs_a_retry(folder):
    seen = go(folder, Dying("other", always=False))
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]


def test_a_clip_that_kills_its_worker_fails_alone(folder):
    seen = go(folder, Dying("other", always=True))
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh"]
    assert seen.of("failed") == ["deep/b.bvh"]
    assert "the process that converted it died" in seen[-1]["error"]


def test_a_clip_that_would_keep_one_worker_busy_at_the_end_gets_several_threads(folder, monkeypatch):
    monkeypatch.setattr(batch_module, "SPLIT_SIZE", 4)
    monkeypatch.setattr(batch_module, "cores", lambda: 7)
    threads = {}

    class Watched(Workers):
        def submit(self, job):
            threads[job.source.path.name] = job.threads
            super().submit(job)

    assert len(go(folder, Watched()).of("done")) == 3  # of 10, 5 and 3 bytes
    assert threads == {"c.bvh": 7, "b.bvh": 7, "a.bvh": None}


def test_the_next_clip_waits_at_each_worker(folder):
    """So no worker waits for a clip, and not all clips are in memory at once."""
    waiting = []

    class All(Workers):
        def finished(self):
            waiting.append(len(self.jobs))
            while self.jobs:
                yield from super().finished()

    workers = All()
    workers.count = 1
    assert len(go(folder, workers).of("done")) == 3
    assert waiting == [2, 1]


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), BatchError("the workers are gone")])
def test_a_run_that_is_stopped_leaves_whole_tables_of_what_is_done(folder, stop):
    class Stopped(Workers):
        def result(self, job):
            if results(folder):
                raise stop
            return copied(job)

    with pytest.raises(type(stop)):
        go(folder, Stopped(), table=folder / "table.csv")
    for path in (folder / "table.csv", folder / "out" / "metrics.csv"):
        assert [row.split(",")[0] for row in path.read_text().splitlines()] == ["output", "c.bvh"]
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["c.bvh", "metrics.csv", "results.sqlite"]


# ---- pages


def pages(folder):
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*.html")}


@pytest.mark.parametrize(("reports", "names"), [(0, ""), (1, "c"), (2, "bc"), (None, "abc")])
def test_the_worst_clips_get_reports(folder, reports, names):
    go(folder, index=folder / "index.html", reports=reports)
    made = pages(folder)
    assert MARK in made.pop("index.html")
    texts = {name: made[next(path for path in made if path.endswith(f"{name}.html"))] for name in names}
    assert len(made) == len(texts)
    for name, text in texts.items():
        assert text.startswith(MARK + OUTPUT_MARK[:20])
        assert text.endswith(f" report on {name}.bvh")


def test_reports_that_are_there_are_not_made_again(folder):
    go(folder, index=folder / "index.html", reports=1)
    before = pages(folder)
    go(folder, Dying("", always=True), index=folder / "index.html", reports=1)
    assert pages(folder) == before


def test_reports_are_made_for_clips_that_can_still_be_read(folder):
    clips = clips_in(folder)
    go(folder)
    batch = batch_of(folder, clips, index=folder / "index.html", reports=3)
    (folder / "in" / "a.bvh").unlink()
    batch.convert(Workers(), Tally(clips=3))
    assert pages(folder).keys() == {"index.html", "index_reports/c.html", "index_reports/deep/b.html"}


@pytest.mark.parametrize("always", [True, False])
def test_reports_survive_a_worker_that_dies(folder, always):
    go(folder)
    go(folder, Dying("other", always), index=folder / "index.html", reports=3)
    made = {"index.html", "index_reports/a.html", "index_reports/c.html"}
    assert pages(folder).keys() == made | (set() if always else {"index_reports/deep/b.html"})


def test_only_pages_of_a_batch_are_replaced_in_folders_that_can_be_written_to(folder):
    page = folder / "index.html"
    batch_of(folder, index=page).check()
    page.write_text("my own")
    with pytest.raises(FileError, match="exists already; --overwrite replaces it"):
        batch_of(folder, index=page).check()
    batch_of(folder, index=page, overwrite=True).check()
    page.write_text(f"<html>{MARK}")
    batch_of(folder, index=page).check()
    path = folder / "map.json"
    path.write_text("{}")
    with pytest.raises(BatchError, match="is an input, or the place of a result"):
        batch_of(folder, map_file=MapFile({}, str(path)), index=path, overwrite=True).check()
    (folder / "file").write_text("")
    with pytest.raises(FileError, match="nothing can be written to"):
        batch_of(folder, index=folder / "file" / "index.html").check()
    batch_of(folder, index=folder / "new" / "deep" / "index.html").check()
