"""The manifest: what counts as done, what may be replaced, and how broken lines are treated."""

import errno
import json
import os
import subprocess
import sys
import threading
from dataclasses import fields
from pathlib import PurePath

import pytest
from input_files import named_target, text_hash

from distretarget.batch import journal
from distretarget.batch.job import Recipe
from distretarget.batch.manifest import Manifest
from distretarget.batch.plan import MANIFEST, METRICS, Clip
from distretarget.batch.record import clip_line, new_record, parse_line, parse_row, row_of, settings_line
from distretarget.errors import FileError
from distretarget.io.files import hash_of_file
from distretarget.io.map_json import MapFile
from distretarget.measure.metrics import COLUMNS
from distretarget.pipeline.options import Options

OPTIONS = Options()
OUTPUT = "HIERARCHY"


def clip(name="a.bvh", target="{}"):
    return Clip(PurePath(name), named_target(target, "hero.json"), (name,), 1)


def record(one=None, input_hash="in", options=OPTIONS, joint_map=()):
    return new_record(one or clip(), Recipe(options, MapFile(dict(joint_map), "")).settings) | {
        "input_hash": input_hash
    }


def done(one=None, **others):
    return record(one) | {"status": "done", "output_hash": text_hash(OUTPUT), **others}


def measured():
    """What was measured of a clip, with texts that a table may not take as they are."""
    metrics = {name: None if k % 3 else 0.1 * k for k, name in enumerate(COLUMNS)}
    texts = {
        "verdict": 'as good, "as" it gets',
        "warnings": ["one, two", "three"],
        "notes": [],
        "alignment": "rig:AAAA",
    }
    return {"metrics": metrics, **texts}


def records(manifest):
    """The lines of clips."""
    found = (parse_line(line) for line in manifest.path.read_bytes().splitlines())
    return [one for one in found if one and "options" not in one]


def is_done(manifest, one, output_hash):
    return manifest.made(one, {one["output"]: output_hash}) is not None


# ---- a line


def test_the_line_of_settings_has_all_options_and_the_map():
    name, line = settings_line(record(joint_map={"Head": "Skull"}))
    found = parse_line(line)
    assert (found["settings"], found["target"]) == (name, "hero.json")
    assert found["options"].keys() == {each.name for each in fields(Options)} | {"map"}
    assert (found["options"]["objective"], found["options"]["map"]) == ("contact", {"Head": "Skull"})
    other, _ = settings_line(record())
    assert other != name


def test_the_line_of_a_clip_leaves_out_what_is_empty():
    failed = parse_line(clip_line(record() | {"error": "no"}, "abc", ""))
    assert failed.keys() == {"settings", "input", "input_hash", "output", "status", "frames", "seconds", "error"}
    assert parse_line(clip_line(done(others={"a.npz": "x"}), "abc", "row"))["others"] == {"a.npz": "x"}


REQUIRED = ("settings", "input", "output", "status", "frames", "seconds")


@pytest.mark.parametrize("key", REQUIRED)
def test_a_line_without_one_of_the_keys_is_no_record(key):
    one = json.loads(clip_line(done(), "abc", "row"))
    del one[key]
    assert parse_line(json.dumps(one).encode()) is None


@pytest.mark.parametrize("key", [*REQUIRED, "input_hash", "output_hash", "row", "error", "left_out", "others"])
@pytest.mark.parametrize("value", [["x"], {"result": 1}, None, -1, 10**400, float("inf"), float("nan")], ids=str)
def test_a_line_with_a_value_that_cannot_be_is_no_record(key, value):
    one = json.loads(clip_line(done(), "abc", "row")) | {key: value}
    assert parse_line(json.dumps(one).encode()) is None


@pytest.mark.parametrize("line", [b"", b"{", b"[]", b"null", b"\xff", b"[" * 100_000])
def test_what_is_no_object_is_no_record(line):
    assert parse_line(line) is None


# ---- metrics


def test_a_row_of_metrics_says_what_was_measured():
    row = row_of("a\nb.bvh", measured())
    assert b"\n" not in row
    assert parse_row(row + b"\n") == measured()


@pytest.mark.parametrize("change", [lambda row: row[:-1], lambda row: row + b",1", lambda row: row[1:], lambda _: b""])
def test_a_damaged_row_says_nothing(change):
    assert parse_row(change(row_of("a.bvh", measured()))) is None


def test_metrics_have_a_table_of_their_own(manifest, tmp_path):
    for name in ("a.bvh", "b.bvh", "b.bvh"):
        manifest.add(done(clip(name), **measured()))
    manifest.add(record(clip("c.bvh")) | {"error": "no"})
    lines = (tmp_path / "out" / METRICS).read_text().splitlines()
    assert [line.split(",")[1] for line in lines] == ["output", "a.bvh", "b.bvh"]
    (one,) = Manifest(tmp_path / "out").latest(["b.bvh"])
    assert {key: one[key] for key in measured()} == measured()


def test_a_clip_whose_row_is_damaged_or_lost_is_not_done(manifest, tmp_path):
    manifest.add(done(**measured()))
    rows = tmp_path / "out" / METRICS
    for text in (rows.read_text().replace("gets", "got"), ""):
        rows.write_text(text)
        again = Manifest(tmp_path / "out")
        assert not is_done(again, record(), text_hash(OUTPUT))
        assert not [*again.latest(["a.bvh"])]
    again.add(done(**measured()))
    assert is_done(Manifest(tmp_path / "out"), record(), text_hash(OUTPUT))


def test_metrics_of_another_version_are_put_aside(manifest, tmp_path):
    manifest.add(done(**measured()))
    rows = tmp_path / "out" / METRICS
    rows.write_text("row,output,beauty\nabc,a.bvh,1\n")
    manifest = Manifest(tmp_path / "out")
    manifest.add(done(**measured()))
    assert is_done(manifest, record(), text_hash(OUTPUT))
    assert rows.read_text().startswith("row,output,verdict,")
    assert rows.with_name("metrics.old.csv").read_text().startswith("row,output,beauty")


def test_rows_of_metrics_are_sorted_by_output_whichever_was_done_first(tmp_path):
    tables = []
    for names in (("b.bvh", "a, 1.bvh", "c.bvh"), ("c.bvh", "b.bvh", "a, 1.bvh")):
        manifest = Manifest(tmp_path / names[0])
        for name in names:
            manifest.add(done(clip(name), **measured()))
        manifest.sort_metrics()
        tables.append((tmp_path / names[0] / METRICS).read_bytes())
    assert tables[0] == tables[1]
    assert [line.split(b",")[1] for line in tables[0].splitlines()] == [b"output", b'"a', b"b.bvh", b"c.bvh"]


def test_a_run_finds_rows_that_another_has_sorted_meanwhile(manifest, tmp_path):
    one, other = (done(clip(name), **measured()) for name in ("b.bvh", "a.bvh"))
    manifest.add(one)
    manifest.add(other)
    Manifest(tmp_path / "out").sort_metrics()
    assert all(is_done(manifest, each, text_hash(OUTPUT)) for each in (one, other))
    manifest.add(done(clip("c.bvh"), **measured()))
    assert len((tmp_path / "out" / METRICS).read_text().splitlines()) == 4


def test_a_clip_takes_few_bytes(manifest):
    """Settings stand once, metrics elsewhere."""
    names = [f"day_12/walk_{number:03}.bvh" for number in range(50)]
    for name in names:
        manifest.add(done(clip(name), input_hash=text_hash(name), frames=1000, seconds=0.123, **measured()))
    assert manifest.path.stat().st_size < 400 * len(names)


# ---- a manifest


@pytest.fixture
def manifest(tmp_path):
    return Manifest(tmp_path / "out")


def test_a_clip_is_done_if_its_output_is_as_the_manifest_says(manifest):
    output_hash = text_hash(OUTPUT)
    assert not is_done(manifest, record(), output_hash)
    manifest.add(done())
    assert is_done(manifest, record(), output_hash)
    assert not is_done(manifest, record(), None)
    assert not is_done(manifest, record(), text_hash("edited"))
    for other in (
        record(input_hash="other"),
        record(clip(target="{ }")),
        record(clip("b.bvh")),
        record(options=Options(supports="free")),
        record(joint_map={"Head": "Head"}),
        record() | {"version": "another"},
    ):
        assert not is_done(manifest, other, output_hash)


def test_the_next_run_reads_what_was_done(manifest, tmp_path):
    manifest.add(done())
    again = Manifest(tmp_path / "out")
    assert is_done(again, record(), text_hash(OUTPUT))
    again.add(record() | {"error": "no"})
    assert is_done(again, record(), text_hash(OUTPUT))
    third = Manifest(tmp_path / "out")
    assert is_done(third, record(), text_hash(OUTPUT))
    assert next(third.latest(["a.bvh"]))["status"] == "failed"
    third.confirm("a.bvh", text_hash(OUTPUT))
    third.confirm("a.bvh", text_hash(OUTPUT))
    assert next(third.latest(["a.bvh"]))["status"] == "done"
    assert len(records(third)) == 3


def test_the_newest_lines_come_last(manifest):
    for name in ("a.bvh", "b.bvh", "a.bvh", "c.bvh"):
        manifest.add(done(clip(name)))
    latest = [*manifest.latest(["a.bvh", "b.bvh", "none.bvh"])]
    assert [one["output"] for one in latest] == ["b.bvh", "a.bvh"]


def check(manifest, one, folder):
    manifest.check_replaceable(one, one["output"], hash_of_file(folder / one["output"]))


def test_only_what_was_made_here_may_be_replaced(manifest, tmp_path):
    out = tmp_path / "out"
    check(manifest, record(), out)  # no output
    (out / "a.bvh").write_text(OUTPUT)
    with pytest.raises(FileError, match="exists already; --overwrite replaces it"):
        check(manifest, record(), out)
    manifest.add(done())
    manifest.add(done() | {"output_hash": text_hash("another")})
    for text in (OUTPUT, "another"):
        (out / "a.bvh").write_text(text)
        check(manifest, record(), out)
    (out / "b.bvh").write_text(OUTPUT)
    (out / "a.bvh").write_text(OUTPUT + " edited")
    for name in ("a.bvh", "b.bvh"):
        with pytest.raises(FileError, match="exists already"):
            check(manifest, record(clip(name)), out)


@pytest.mark.parametrize("other", ["input", "target"])
def test_the_result_of_other_files_is_left_alone(manifest, tmp_path, other):
    known = tmp_path / "other"
    known.write_text("")
    (tmp_path / "out" / "a.bvh").write_text(OUTPUT)
    manifest.add(done() | {other: str(known)})
    paths = {"input": tmp_path / "a.bvh", "target": tmp_path / "hero.json"}
    for path in paths.values():
        path.write_text("")
    now = record() | {key: str(path) for key, path in paths.items()}
    with pytest.raises(FileError, match=f"is the result of .*{known}.*--overwrite replaces it"):
        check(manifest, now, tmp_path / "out")
    known.unlink()  # looks as if it was moved
    check(manifest, now, tmp_path / "out")


def test_names_that_are_not_valid_text_survive(manifest):
    manifest.add(done(clip(os.fsdecode(b"caf\xe9\n.bvh"))))
    assert [one["output"] for one in records(manifest)] == [os.fsdecode(b"caf\xe9\n.bvh")]


@pytest.mark.parametrize(
    ("rest", "broken"), [(b'{"input": "b.b', [3]), (b"\xff\xfe", [3]), (b"[]\nnull\n{}\n", [3, 4, 5]), (b"\n\n", [])]
)
def test_broken_lines_are_skipped(manifest, tmp_path, rest, broken):
    manifest.add(done())
    with manifest.path.open("ab") as file:
        file.write(rest)
    again = Manifest(tmp_path / "out")
    again.add(done(clip("c.bvh")))
    assert again.broken == broken
    assert [one["output"] for one in records(again)] == ["a.bvh", "c.bvh"]
    assert len([*again.latest(["a.bvh", "c.bvh"])]) == 2


def test_a_first_line_cut_short_is_no_obstacle(tmp_path):
    (tmp_path / MANIFEST).write_text('{"inp')
    manifest = Manifest(tmp_path)
    manifest.add(done())
    assert len(records(manifest)) == 1


def test_a_line_that_cannot_be_written_leaves_the_file_as_it_was(manifest, monkeypatch):
    def full(_number):
        raise OSError(errno.ENOSPC, "no space")

    manifest.add(done())
    before = manifest.path.read_bytes()
    with monkeypatch.context() as broken:
        broken.setattr(journal.os, "fsync", full)
        with pytest.raises(FileError, match=r"manifest\.jsonl: the disk is full"):
            manifest.add(done(clip("b.bvh")))
    assert manifest.path.read_bytes() == before
    manifest.add(done(clip("c.bvh")))
    assert [one["output"] for one in records(manifest)] == ["a.bvh", "c.bvh"]


def test_a_manifest_of_another_program_is_left_alone(tmp_path):
    (tmp_path / MANIFEST).write_text('{"name": "my own"}\n')
    with pytest.raises(FileError, match="not the manifest of a batch"):
        Manifest(tmp_path)
    assert json.loads((tmp_path / MANIFEST).read_text()) == {"name": "my own"}
    assert [path.name for path in tmp_path.iterdir()] == [MANIFEST]


def test_a_folder_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(FileError, match="expected a folder"):
        Manifest(tmp_path / "out")


def test_a_manifest_that_is_only_read_makes_nothing(tmp_path):
    manifest = Manifest(tmp_path / "out", read_only=True)
    assert not is_done(manifest, record(), text_hash(OUTPUT))
    assert not (tmp_path / "out").exists()


def test_two_runs_may_write_to_one_manifest(manifest, tmp_path):
    other = Manifest(tmp_path / "out")
    for number in range(20):
        for run, name in ((manifest, "a"), (other, "b")):
            run.add(done(clip(f"{name}{number}.bvh")))
    assert len(records(manifest)) == 40
    assert len([*other.latest([f"{name}{number}.bvh" for number in range(20) for name in "ab"])]) == 40


def test_a_run_learns_what_another_has_done_meanwhile(manifest, tmp_path):
    other = Manifest(tmp_path / "out")
    for name in ("a.bvh", "b.bvh"):
        one, path = record(clip(name)), tmp_path / "out" / name
        path.write_text(OUTPUT)
        assert not is_done(manifest, one, text_hash(OUTPUT))
        with pytest.raises(FileError, match="exists already"):
            check(manifest, one, tmp_path / "out")
        other.add(done(clip(name)))
        assert is_done(manifest, one, text_hash(OUTPUT))
        check(manifest, one, tmp_path / "out")


LOCKS = """
import sys
from pathlib import Path
from distretarget.batch.manifest import Manifest

with Manifest(Path(sys.argv[1])).locked():
    print("locked", flush=True)
    sys.stdin.read()
"""


def test_a_run_waits_while_another_writes(manifest, tmp_path):
    words = [sys.executable, "-c", LOCKS, tmp_path / "out"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"locked\n"
        added = threading.Thread(target=manifest.add, args=[done()])
        added.start()
        added.join(0.2)
        assert added.is_alive()
        assert records(manifest) == []
        other.stdin.close()
        added.join()
    assert len(records(manifest)) == 1


def test_files_left_by_a_killed_run_are_removed(tmp_path):
    left = tmp_path / "out" / "deep" / ".distretarget-0123.tmp"
    left.parent.mkdir(parents=True)
    Manifest(tmp_path / "out")
    left.write_text("half")
    Manifest(tmp_path)  # of a folder above
    assert left.exists()
    Manifest(tmp_path / "out", read_only=True)
    assert left.exists()
    Manifest(tmp_path / "out")
    assert not left.exists()


def test_results_are_there_only_if_every_one_of_their_files_is(tmp_path):
    manifest, one = Manifest(tmp_path), done(others={"a.npz": "hash of arrays"})
    manifest.add(one)
    own = {"a.bvh": text_hash(OUTPUT)}
    assert manifest.made(one, own) is not None
    assert manifest.made(one, own | {"a.npz": "hash of arrays"}) is not None
    for other in ({"a.npz": "another hash"}, {"a.npz": None}, {"a.glb": "hash of arrays"}):
        assert manifest.made(one, own | other) is None
