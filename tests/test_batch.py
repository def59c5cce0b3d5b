"""A batch: what is written and skipped, the reports, and the effects of failures, dying workers and stops."""

from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace

import pytest
from bodies import other_lengths, person
from input_files import file_of, target_of

from distretarget.batch import batch as batch_module
from distretarget.batch import workers as batch_workers
from distretarget.batch.batch import Batch
from distretarget.batch.job import Recipe, Result, unpacked
from distretarget.batch.manifest import Manifest
from distretarget.batch.pages import MARK, OF, Pages
from distretarget.batch.plan import find_clips, plan
from distretarget.batch.results import Results
from distretarget.batch.summary import Tally
from distretarget.errors import BatchError, FileError
from distretarget.io.files import encoded_parts
from distretarget.io.map_json import MapFile
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.measure.metrics import COLUMNS
from distretarget.pipeline.options import Options

TARGET = target_of(skeleton_to_json(other_lengths(person()), "body"), "body.json")


class Inline(Executor):
    """An executor that runs a job as soon as it is submitted."""

    def submit(self, function, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


class Workers:
    """Workers that run a job as soon as it is submitted."""

    count, start_seconds = 2, 0.0

    def __init__(self, executor=None):
        self.executor = executor or Inline()
        self.closed = 0

    def close(self):
        self.closed += 1


class Seen(list):
    """The lines of the manifest that a batch has shown."""

    def of(self, status):
        return [record["output"] for record in self if record and record["status"] == status]

    @property
    def skipped(self):
        return self.count(None)


def copied(job, *_):
    """What becomes of a clip that is copied instead of converted; those with the word `fail` in them fail."""
    if "fail" in job.source.text:
        return job.failed("it fails")
    text = f"{unpacked(job.target).path}: {job.source.text}"
    metrics = dict.fromkeys(COLUMNS) | {"contact_error": float(len(job.source.text))}
    done = {"seconds": 0.5, "frames": 7, "metrics": metrics, "notes": ["a tail"], "warnings": ["careful"]}
    outputs = {job.outputs[0]: b"".join(encoded_parts(text))}
    return Result(job.record | done | {"status": "done"}, outputs, f"{MARK} {job.about}" if job.about else "")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(batch_workers, "convert", copied)


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
    pages = Pages(lambda clip, _: f"report on {clip.name}", **pages)
    return Batch(clips or clips_in(folder), Results(folder / "out", **results), Recipe(**recipe), pages, **others)


def go(folder, workers=None, clips=None, **others):
    seen, batch = Seen(), batch_of(folder, clips, **others)
    batch.convert(workers or Workers(), Tally(clips=len(batch.clips)), seen.append)
    return seen


def lines(folder):
    return [*Manifest(folder / "out", read_only=True).latest(clip.output for clip in clips_in(folder))]


def runs(folder):
    """How often a clip has a line in the manifest."""
    return (folder / "out" / "manifest.jsonl").read_text().count('"frames": ')


def results(folder):
    files = (path for path in (folder / "out").rglob("*.bvh") if path.is_file())
    return {path.relative_to(folder / "out").as_posix(): path.read_text() for path in files}


def test_every_clip_gets_an_output_and_a_line(folder):
    seen = go(folder)
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]
    assert results(folder) == {
        "a.bvh": "body.json: one",
        "c.bvh": "body.json: third clip",
        "deep/b.bvh": "body.json: other",
    }
    assert lines(folder) == seen
    assert {(line["frames"], line["seconds"], *line["notes"], *line["warnings"]) for line in seen} == {
        (7, 0.5, "a tail", "careful")
    }


def test_a_second_run_has_nothing_to_do(folder):
    go(folder)
    seen = go(folder)
    assert seen == [None] * 3
    assert runs(folder) == 3


def test_a_run_leaves_to_another_what_that_is_at_work_on(folder):
    first, begun = Manifest(folder / "out"), []
    assert first.claim("c.bvh")

    class Finishing(Inline):
        """Before the clip a.bvh, another run finishes c.bvh if it is at work on it."""

        def submit(self, function, *arguments):
            begun.extend(job.source.path.name for job in arguments)
            if begun[-1] == "a.bvh" and len(begun) > 3:
                (folder / "out" / "c.bvh").write_text("body.json: third clip")
                first.release("c.bvh")
            return super().submit(function, *arguments)

    go(folder, Workers(Finishing()))
    assert begun == ["b.bvh", "a.bvh", "c.bvh"]
    for name in ("c.bvh", "a.bvh"):
        (folder / "out" / name).unlink()
    seen = go(folder, Workers(Finishing()))
    assert (begun[3:], seen.skipped) == (["a.bvh"], 2)
    assert not [*(folder / "out").glob(".distretarget-*")]


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
    clips = clips_in(folder)
    (folder / "in" / "a.bvh").unlink()
    (folder / "in" / "c.bvh").write_bytes(b"\0binary")
    seen = go(folder, clips=clips)
    assert (sorted(seen.of("failed")), seen.of("done")) == (["a.bvh", "c.bvh"], ["deep/b.bvh"])
    errors = {record["output"]: record["error"] for record in seen}
    assert errors["a.bvh"].endswith("a.bvh: there is no such file")
    assert "is not a text file" in errors["c.bvh"]


def test_files_that_were_not_made_here_are_left_alone(folder):
    (folder / "out").mkdir()
    (folder / "out" / "a.bvh").write_text("mine")
    seen = go(folder)
    assert seen.of("failed") == ["a.bvh"]
    (failed,) = (record for record in seen if record["status"] == "failed")
    assert failed["error"].endswith("exists already; --overwrite replaces it")
    assert results(folder)["a.bvh"] == "mine"
    assert "a.bvh" in go(folder, overwrite=True).of("done")
    assert results(folder)["a.bvh"] == "body.json: one"


def test_what_another_run_writes_meanwhile_is_no_failure(folder, monkeypatch):
    """The other run, with other options, converts all clips while this one converts its first."""

    def late(job, *_):
        with monkeypatch.context() as other:
            other.setattr(batch_workers, "convert", lambda job, *_: with_other_options(job))
            assert len(go(folder, options=Options(root_scale=2.0)).of("done")) == 3
        monkeypatch.setattr(batch_workers, "convert", copied)
        assert set(results(folder).values()) == {"with other options"}
        return copied(job)

    def with_other_options(job):
        return Result(copied(job).record, {job.outputs[0]: b"with other options"})

    monkeypatch.setattr(batch_workers, "convert", late)
    assert len(go(folder).of("done")) == 3
    assert results(folder)["a.bvh"] == "body.json: one"


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
    assert "the disk is full" in seen[0]["error"]
    assert results(folder) == {}


class Dying(Inline):
    """An executor that dies when it is given certain clips, and does nothing more until it is replaced."""

    def __init__(self, deadly, always):
        self.deadly, self.always, self.dead = deadly, always, False

    def submit(self, function, job):
        if self.dead:
            raise BrokenProcessPool("dead before")
        if self.deadly in job.source.text:
            self.dead = True
            self.deadly = self.deadly if self.always else "nothing"
            future = Future()
            future.set_exception(BrokenProcessPool("died"))
            return future
        return super().submit(function, job)


class Replaced(Workers):
    def close(self):
        super().close()
        self.executor.dead = False


def test_a_worker_that_dies_costs_a_retry(folder):
    workers = Replaced(Dying("other", always=False))
    seen = go(folder, workers)
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]
    assert workers.closed == 1


def test_a_clip_that_kills_its_worker_fails_alone(folder):
    seen = go(folder, Replaced(Dying("other", always=True)))
    assert sorted(seen.of("done")) == ["a.bvh", "c.bvh"]
    assert seen.of("failed") == ["deep/b.bvh"]
    assert "the process that converted it died" in seen[-1]["error"]


def test_workers_that_cannot_start_end_the_run(folder):
    class NeverStarting(Inline):
        def submit(self, *_):
            raise BrokenProcessPool("dead")

    with pytest.raises(BatchError, match="the workers die as they start"):
        go(folder, Workers(NeverStarting()))


def test_a_cluster_that_goes_away_ends_the_run(folder):
    class Gone(Inline):
        def submit(self, *_):
            future = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    with pytest.raises(BatchError, match="the workers are gone"):
        go(folder, Workers(Gone()))


def test_what_a_cluster_raises_is_its_clips_failure(folder):
    class Raising(Inline):
        def submit(self, *_):
            future = Future()
            future.set_exception(RuntimeError("killed\nthrice"))
            return future

    seen = go(folder, Workers(Raising()))
    assert len(seen.of("failed")) == 3
    assert all(record["error"].endswith(".bvh: RuntimeError: killed thrice") for record in seen)


def test_a_clip_that_would_keep_one_worker_busy_at_the_end_gets_several_threads(folder, monkeypatch):
    monkeypatch.setattr(batch_module, "SPLIT_SIZE", 4)
    monkeypatch.setattr(batch_module, "cores", lambda: 7)
    threads = {}
    monkeypatch.setattr(
        batch_workers, "convert", lambda job: threads.update({job.source.path.name: job.threads}) or copied(job)
    )
    assert len(go(folder).of("done")) == 3  # of 10, 5 and 3 bytes
    assert threads == {"c.bvh": 7, "b.bvh": 7, "a.bvh": None}


def test_the_next_clip_waits_at_each_worker(folder, monkeypatch):
    """So no worker waits for a clip, and not all clips are in memory at once."""

    class Busy(Inline):
        def submit(self, _, job):
            future = Future()
            future.job = job
            return future

    def finish(running, *_):
        waiting.append(len(running))
        for future in running:
            future.set_result(copied(future.job))
        return set(running), set()

    waiting, workers = [], Workers(Busy())
    workers.count = 1
    monkeypatch.setattr(batch_workers, "wait", finish)
    assert len(go(folder, workers).of("done")) == 3
    assert waiting == [2, 1]


def test_a_worker_that_dies_unnoticed_costs_a_retry(folder, monkeypatch):
    class Silent(Inline):
        lost = True

        def submit(self, function, job):
            return Future() if self.lost and "other" in job.source.text else super().submit(function, job)

    class Seeing(Workers):
        def lost(self):
            lost, self.executor.lost = self.executor.lost, False
            return lost

    monkeypatch.setattr(batch_workers, "CHECK_INTERVAL", 0.01)
    assert sorted(go(folder, Seeing(Silent())).of("done")) == ["a.bvh", "c.bvh", "deep/b.bvh"]


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
        assert text.startswith(MARK + OF[:20])
        assert text.endswith(f" report on {name}.bvh")


def test_reports_that_are_there_are_not_made_again(folder, monkeypatch):
    go(folder, index=folder / "index.html", reports=1)
    monkeypatch.setattr(batch_workers, "convert", None)
    before = pages(folder)
    go(folder, index=folder / "index.html", reports=1)
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
    workers = Replaced(Dying("other", always))
    workers.executor.dead = True
    go(folder, workers, index=folder / "index.html", reports=3)
    made = {"index.html", "index_reports/a.html", "index_reports/c.html"}
    assert pages(folder).keys() == made | (set() if always else {"index_reports/deep/b.html"})


def test_a_report_that_cannot_be_written_is_a_problem(folder):
    path = folder / "index_reports" / "a.html"
    path.parent.mkdir()
    path.write_text("my own")
    batch = batch_of(folder, index=folder / "index.html", reports=None)
    batch.convert(Workers(), Tally(clips=3))
    assert [str(problem) for problem in batch.pages.problems.values()] == [
        f"{path}: exists already; --overwrite replaces it"
    ]
    assert path.read_text() == "my own"
    assert len(pages(folder)) == 4


def test_only_pages_of_a_batch_are_replaced(folder):
    page = folder / "index.html"
    batch_of(folder, index=page).check()
    page.write_text("my own")
    with pytest.raises(FileError, match="exists already; --overwrite replaces it"):
        batch_of(folder, index=page).check()
    batch_of(folder, index=page, overwrite=True).check()
    page.write_text(f"<html>{MARK}")
    batch_of(folder, index=page).check()


def test_the_page_does_not_replace_the_map(folder):
    path = folder / "map.json"
    path.write_text("{}")
    with pytest.raises(BatchError, match="is an input, or the place of a result"):
        batch_of(folder, map_file=MapFile({}, str(path)), index=path, overwrite=True).check()


def test_a_page_needs_a_folder_that_can_be_written_to(folder):
    (folder / "file").write_text("")
    with pytest.raises(FileError, match="nothing can be written to"):
        batch_of(folder, index=folder / "file" / "index.html").check()
    batch_of(folder, index=folder / "new" / "deep" / "index.html").check()
