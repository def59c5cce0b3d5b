"""The manifest: what counts as done, what may be replaced, and how broken lines are treated."""

import json
import os
from pathlib import PurePath

import pytest

from distretarget.batch.clips import Clip
from distretarget.batch.manifest import Manifest
from distretarget.batch.plan import MANIFEST, Work
from distretarget.batch.record import Recipe, failed_record, read_records
from distretarget.errors import FileError
from distretarget.io.files import Text, hash_of_file, text_hash
from distretarget.io.map_json import MapFile
from distretarget.pipeline.options import Options

RECIPE = Recipe(Options(), MapFile({}, ""), "1")
OUTPUT = "HIERARCHY"


def work(name="a.bvh", target="{}"):
    return Work(Clip(PurePath(name), PurePath(name), 1), Text(target, "hero.json"), PurePath(name))


def done(one, input_hash="in", recipe=RECIPE):
    return failed_record(one, input_hash, recipe) | {"status": "done", "output_hash": text_hash(OUTPUT)}


@pytest.fixture
def manifest(tmp_path):
    opened = Manifest(tmp_path / "out")
    yield opened
    opened.close()


def test_a_clip_is_done_if_its_output_is_as_the_manifest_says(manifest, tmp_path):
    folder = tmp_path / "out"
    assert not manifest.is_done(work(), "in", RECIPE, folder)
    manifest.add(done(work()))
    assert not manifest.is_done(work(), "in", RECIPE, folder)
    (folder / "a.bvh").write_text(OUTPUT)
    assert manifest.is_done(work(), "in", RECIPE, folder)
    assert not manifest.is_done(work(), "other", RECIPE, folder)
    assert not manifest.is_done(work(target="{ }"), "in", RECIPE, folder)
    assert not manifest.is_done(work("b.bvh"), "in", RECIPE, folder)
    for other in (
        Recipe(Options(supports="free"), MapFile({}, ""), "1"),
        Recipe(Options(), MapFile({"Head": "Head"}, ""), "1"),
        Recipe(Options(), MapFile({}, ""), "2"),
    ):
        assert not manifest.is_done(work(), "in", other, folder)
    (folder / "a.bvh").write_text(OUTPUT + " edited")
    assert not manifest.is_done(work(), "in", RECIPE, folder)


def test_the_next_run_reads_what_was_done(manifest, tmp_path):
    manifest.add(done(work()))
    (tmp_path / "out" / "a.bvh").write_text(OUTPUT)
    again = Manifest(tmp_path / "out")
    assert again.is_done(work(), "in", RECIPE, tmp_path / "out")
    again.add(failed_record(work(), "in", RECIPE) | {"error": "no"})
    assert again.is_done(work(), "in", RECIPE, tmp_path / "out")
    again.close()
    third = Manifest(tmp_path / "out")
    assert third.is_done(work(), "in", RECIPE, tmp_path / "out")
    assert third.latest([work()])[0]["status"] == "failed"
    third.confirm(work())
    third.confirm(work())
    assert third.latest([work()])[0]["status"] == "done"
    assert len(list(read_records(third.path))) == 3
    check(third, work(), tmp_path / "out")
    third.close()


def check(manifest, work, folder):
    path = folder / work.place
    manifest.check_replaceable(work, path, hash_of_file(path))


def test_only_what_was_made_here_may_be_replaced(manifest, tmp_path):
    out = tmp_path / "out"
    check(manifest, work(), out)  # no output
    (out / "a.bvh").write_text(OUTPUT)
    with pytest.raises(FileError, match="exists already; --overwrite replaces it"):
        check(manifest, work(), out)
    manifest.add(done(work()))
    manifest.add(done(work()) | {"output_hash": text_hash("another")})
    for text in (OUTPUT, "another"):
        (out / "a.bvh").write_text(text)
        check(manifest, work(), out)
    (out / "b.bvh").write_text(OUTPUT)
    (out / "a.bvh").write_text(OUTPUT + " edited")
    for name in ("a.bvh", "b.bvh"):
        with pytest.raises(FileError, match="exists already"):
            check(manifest, work(name), out)


@pytest.mark.parametrize("other", ["input", "target"])
def test_the_result_of_other_files_is_left_alone(manifest, tmp_path, other):
    known = tmp_path / "other"
    known.write_text("")
    (tmp_path / "out" / "a.bvh").write_text(OUTPUT)
    manifest.add(done(work()) | {other: str(known)})
    paths = {name: tmp_path / name for name in ("a.bvh", "hero.json")}
    for path in paths.values():
        path.write_text("")
    now = Work(Clip(paths["a.bvh"], PurePath("a.bvh"), 1), Text("{}", paths["hero.json"]), PurePath("a.bvh"))
    with pytest.raises(FileError, match=f"is the result of .*{known}.*--overwrite replaces it"):
        check(manifest, now, tmp_path / "out")
    known.unlink()  # looks as if it was moved
    check(manifest, now, tmp_path / "out")


def test_names_that_are_not_valid_text_survive(manifest):
    manifest.add(done(work(os.fsdecode(b"caf\xe9\n.bvh"))))
    assert [record["output"] for record in read_records(manifest.path)] == [os.fsdecode(b"caf\xe9\n.bvh")]


@pytest.mark.parametrize("rest", [b'{"input": "b.b', b"\xff\xfe", b"[]\nnull\n{}\n", b"\n\n"])
def test_broken_lines_are_skipped(manifest, tmp_path, rest):
    manifest.add(done(work()))
    manifest.close()
    with manifest.path.open("ab") as file:
        file.write(rest)
    again = Manifest(tmp_path / "out")
    again.add(done(work("c.bvh")))
    again.close()
    assert [record["output"] for record in read_records(again.path)] == ["a.bvh", "c.bvh"]


def test_a_first_line_cut_short_is_no_obstacle(tmp_path):
    (tmp_path / MANIFEST).write_text('{"inp')
    manifest = Manifest(tmp_path)
    manifest.add(done(work()))
    manifest.close()
    assert len(list(read_records(manifest.path))) == 1


def test_a_manifest_of_another_program_is_left_alone(tmp_path):
    (tmp_path / MANIFEST).write_text('{"name": "my own"}\n')
    with pytest.raises(FileError, match="not the manifest of a batch"):
        Manifest(tmp_path)
    assert json.loads((tmp_path / MANIFEST).read_text()) == {"name": "my own"}


def test_a_folder_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(FileError, match="expected a folder"):
        Manifest(tmp_path / "out")


def test_two_runs_may_write_to_one_manifest(manifest, tmp_path):
    other = Manifest(tmp_path / "out")
    for number in range(20):
        for run, name in ((manifest, "a"), (other, "b")):
            run.add(done(work(f"{name}{number}.bvh")))
    other.close()
    assert len(list(read_records(manifest.path))) == 40


def test_a_run_learns_what_another_has_done_meanwhile(manifest, tmp_path):
    other = Manifest(tmp_path / "out")
    for name in ("a.bvh", "b.bvh"):
        (tmp_path / "out" / name).write_text(OUTPUT)
        other.add(done(work(name)))
        assert not manifest.is_done(work(name), "in", RECIPE, tmp_path / "out")
        with pytest.raises(FileError, match="exists already"):
            check(manifest, work(name), tmp_path / "out")
        manifest.catch_up()
        assert manifest.is_done(work(name), "in", RECIPE, tmp_path / "out")
        check(manifest, work(name), tmp_path / "out")
    other.close()


def test_files_left_by_a_killed_run_are_removed_unless_another_run_is_at_work(manifest, tmp_path):
    left = tmp_path / "out" / "deep" / ".distretarget-0123.tmp"
    left.parent.mkdir()
    left.write_text("half")
    Manifest(tmp_path / "out").close()
    assert left.exists()
    manifest.close()
    Manifest(tmp_path).close()  # of a folder above
    Manifest(tmp_path).close()
    assert left.exists()
    Manifest(tmp_path / "out").close()
    assert not left.exists()
