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

from distretarget.batch import manifest as batch_manifest
from distretarget.batch.manifest import Manifest, ManifestRecord, new_record, options_of, parse_record
from distretarget.batch.plan import MANIFEST, Clip
from distretarget.errors import FileError
from distretarget.io.files import hash_of_file
from distretarget.io.map_json import MapFile
from distretarget.pipeline.options import Options

OPTIONS = Options()
OUTPUT = "HIERARCHY"


def clip(name="a.bvh", target="{}"):
    return Clip(PurePath(name), named_target(target, "hero.json"), PurePath(name), 1)


def record(one=None, input_hash="in", options=OPTIONS, joint_map=()):
    return new_record(one or clip(), options_of(options, MapFile(dict(joint_map), ""))) | {"input_hash": input_hash}


def done(one=None):
    return record(one) | {"status": "done", "output_hash": text_hash(OUTPUT)}


def line_of(one):
    return json.dumps(one).encode() + b"\n"


def records(manifest):
    return [parsed for line in manifest.path.read_bytes().splitlines() if (parsed := parse_record(line))]


# ---- a line


def test_a_line_has_every_key_all_options_and_the_map():
    one = parse_record(line_of(record(joint_map={"Head": "Skull"})))
    assert one.keys() == ManifestRecord.__required_keys__
    assert (one["input"], one["output"], one["target"]) == ("a.bvh", "a.bvh", "hero.json")
    assert (one["status"], one["output_hash"], one["error"]) == ("failed", None, None)
    assert one["options"].keys() == {each.name for each in fields(Options)} | {"map"}
    assert (one["options"]["objective"], one["options"]["map"]) == ("contact", {"Head": "Skull"})
    assert parse_record(line_of(record()))["options"]["map"] is None


@pytest.mark.parametrize("key", sorted(ManifestRecord.__required_keys__))
def test_a_line_without_one_of_the_keys_is_no_record(key):
    one = record()
    del one[key]
    assert parse_record(line_of(one)) is None


@pytest.mark.parametrize("key", sorted(ManifestRecord.__required_keys__))
@pytest.mark.parametrize("value", [True, ["x"], {"result": 1}, {"result": {"foot_skate": "1"}}], ids=str)
def test_a_line_with_a_value_of_another_kind_is_no_record(key, value):
    one = record() | {key: value}
    kinds = {"frames": bool, "seconds": bool, "notes": list, "warnings": list}
    if isinstance(value, kinds.get(key, ())) or (key == "options" and isinstance(value, dict)):
        return
    assert parse_record(line_of(one)) is None


@pytest.mark.parametrize("number", [10**400, float("inf"), float("nan")], ids=["long", "inf", "nan"])
def test_a_line_with_a_number_that_cannot_be_computed_with_is_no_record(number):
    assert parse_record(line_of(record() | {"metrics": {"result": {"foot_skate": number}}})) is None
    assert parse_record(line_of(record() | {"frames": number})) is None


@pytest.mark.parametrize("line", [b"", b"{", b"[]", b"null", b"\xff", b"[" * 100_000])
def test_what_is_no_object_is_no_record(line):
    assert parse_record(line) is None


# ---- a manifest


@pytest.fixture
def manifest(tmp_path):
    return Manifest(tmp_path / "out")


def test_a_clip_is_done_if_its_output_is_as_the_manifest_says(manifest):
    output_hash = text_hash(OUTPUT)
    assert not manifest.is_done(record(), output_hash)
    manifest.add(done())
    assert manifest.is_done(record(), output_hash)
    assert not manifest.is_done(record(), None)
    assert not manifest.is_done(record(), text_hash("edited"))
    for other in (
        record(input_hash="other"),
        record(clip(target="{ }")),
        record(clip("b.bvh")),
        record(options=Options(supports="free")),
        record(joint_map={"Head": "Head"}),
        record() | {"version": "another"},
    ):
        assert not manifest.is_done(other, output_hash)


def test_the_next_run_reads_what_was_done(manifest, tmp_path):
    manifest.add(done())
    again = Manifest(tmp_path / "out")
    assert again.is_done(record(), text_hash(OUTPUT))
    again.add(record() | {"error": "no"})
    assert again.is_done(record(), text_hash(OUTPUT))
    third = Manifest(tmp_path / "out")
    assert third.is_done(record(), text_hash(OUTPUT))
    assert next(third.latest([clip()]))["status"] == "failed"
    third.confirm("a.bvh", text_hash(OUTPUT))
    third.confirm("a.bvh", text_hash(OUTPUT))
    assert next(third.latest([clip()]))["status"] == "done"
    assert len(records(third)) == 3


def test_the_newest_lines_come_last(manifest):
    for name in ("a.bvh", "b.bvh", "a.bvh", "c.bvh"):
        manifest.add(done(clip(name)))
    latest = [*manifest.latest([clip(name) for name in ("a.bvh", "b.bvh", "none.bvh")])]
    assert [one["output"] for one in latest] == ["b.bvh", "a.bvh"]


def check(manifest, one, folder):
    path = folder / one["output"]
    manifest.check_replaceable(one, path, hash_of_file(path))


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
    ("rest", "broken"), [(b'{"input": "b.b', [2]), (b"\xff\xfe", [2]), (b"[]\nnull\n{}\n", [2, 3, 4]), (b"\n\n", [])]
)
def test_broken_lines_are_skipped(manifest, tmp_path, rest, broken):
    manifest.add(done())
    with manifest.path.open("ab") as file:
        file.write(rest)
    again = Manifest(tmp_path / "out")
    again.add(done(clip("c.bvh")))
    assert again.broken == broken
    assert [one["output"] for one in records(again)] == ["a.bvh", "c.bvh"]
    assert len([*again.latest([clip(), clip("c.bvh")])]) == 2


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
        broken.setattr(batch_manifest.os, "fsync", full)
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
    assert not manifest.is_done(record(), text_hash(OUTPUT))
    assert not (tmp_path / "out").exists()


def test_two_runs_may_write_to_one_manifest(manifest, tmp_path):
    other = Manifest(tmp_path / "out")
    for number in range(20):
        for run, name in ((manifest, "a"), (other, "b")):
            run.add(done(clip(f"{name}{number}.bvh")))
    assert len(records(manifest)) == 40
    assert len([*other.latest([clip(f"{name}{number}.bvh") for number in range(20) for name in "ab"])]) == 40


def test_a_run_learns_what_another_has_done_meanwhile(manifest, tmp_path):
    other = Manifest(tmp_path / "out")
    for name in ("a.bvh", "b.bvh"):
        one, path = record(clip(name)), tmp_path / "out" / name
        path.write_text(OUTPUT)
        assert not manifest.is_done(one, text_hash(OUTPUT))
        with pytest.raises(FileError, match="exists already"):
            check(manifest, one, tmp_path / "out")
        other.add(done(clip(name)))
        assert manifest.is_done(one, text_hash(OUTPUT))
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
