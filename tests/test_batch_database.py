"""The database of a batch: what is done, replaced and refused, several runs in one folder; and the table made of it."""

import os
import sqlite3
import subprocess
import sys
import threading
import zlib
from contextlib import closing
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path, PurePath

import pandas as pd
import pytest
from bodies import other_lengths, person, swaying
from input_files import named_target, text_hash
from program import last_records, refused, run

from distretarget import write_bvh
from distretarget.batch import pages
from distretarget.batch import results as database_module
from distretarget.batch.plan import DATABASE, PlannedClip
from distretarget.batch.results import Database, Results, new_record, packed, unpacked
from distretarget.errors import FileError, MissingPackageError
from distretarget.io.map_json import MapFile
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.measure.metrics import COLUMNS
from distretarget.pipeline.options import Options
from distretarget.pipeline.retargeting import Recipe

OPTIONS = Options()
OUTPUT = "HIERARCHY"


def clip(name="a.bvh", target="{}"):
    return PlannedClip(PurePath(name), named_target(target, "hero.json"), (name,), 1)


def record(one=None, input_hash="in", options=OPTIONS, joint_map=()):
    return new_record(one or clip(), Recipe(options, MapFile(dict(joint_map), "")).settings, input_hash)


def done(one=None, **others):
    return record(one) | {"status": "done", "output_hash": text_hash(OUTPUT), **others}


def measured():
    """What was measured of a clip, with texts that a table may not take as they are."""
    metrics = {name: None if k % 3 else 0.5 * k for k, name in enumerate(COLUMNS)}
    texts = {"verdict": 'as good, "as" it gets', "warnings": ["one, two", "three"], "alignment": "rig:AAAA"}
    return {"metrics": metrics, "notes": ["a tail"], **texts}


def test_a_record_has_lists_of_its_own_all_options_and_seven_digits():
    one = record()
    for key in ("notes", "warnings"):
        one[key].append("a word")
    one["others"]["b.bvh"] = "a hash"
    assert not any(record()[key] for key in ("notes", "warnings", "others"))
    one = done(metrics=dict.fromkeys(COLUMNS, 1 / 3))
    assert {f"{number:.7g}" for number in unpacked(*packed(one))["metrics"].values()} == {"0.3333333"}
    options = record(joint_map={"Head": "Skull"})["options"]
    assert options.keys() == {each.name for each in fields(Options)} | {"map"}
    assert (options["objective"], options["map"]) == ("contact", {"Head": "Skull"})


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


@pytest.fixture
def database(folder):
    with closing(Database(folder)) as one:
        yield one


@pytest.fixture
def results(folder, database):
    one = Results(folder)
    one.__dict__["database"] = database
    return one


# ---- a record


@pytest.mark.parametrize(
    "one", [done(), record() | {"error": "no"}, done(**measured()), done(others={"a.npz": "x"}, frames=3, seconds=0.1)]
)
def test_a_record_comes_back_as_it_was(one):
    assert unpacked(*packed(one)) == one


BROKEN = [{"output": ["x"]}, {"frames": -1}, {"frames": 10**400}, {"seconds": float("nan")}, {"others": {"a": 1}}]


@pytest.mark.parametrize("change", [*BROKEN, {"warnings": "w"}, {"warnings": [1]}, {"options": 1}, {"notes": None}])
def test_a_record_with_a_value_that_cannot_be_is_refused(change):
    with pytest.raises(ValueError, match=f"{next(iter(change))} cannot be "):
        unpacked(*packed(done() | change))


def test_names_that_are_not_valid_text_survive(folder, database):
    name = os.fsdecode(b"caf\xe9\n.bvh")
    database.add(done(clip(name)))
    assert [*last_records(folder)] == [name]


def test_a_clip_takes_few_bytes(folder):
    """Settings stand once."""
    names = [f"day_12/walk_{number:03}.bvh" for number in range(200)]
    with closing(Database(folder)) as database:
        for name in names:
            database.add(done(clip(name), input_hash=text_hash(name), frames=1000, seconds=0.123, **measured()))
    assert (folder / DATABASE).stat().st_size < 500 * len(names)


# ---- what is done, and what may be replaced


def is_done(results, one):
    return results.known(one, [one["output"]]) is not None


def test_a_clip_is_done_if_its_result_is_as_recorded(results, database, folder):
    assert not is_done(results, record())
    database.add(done())
    assert not is_done(results, record())
    (folder / "a.bvh").write_text(OUTPUT)
    assert is_done(results, record())
    for other in (
        record(input_hash="other"),
        record(clip(target="{ }")),
        record(clip("b.bvh")),
        record(options=Options(supports="free")),
        record(joint_map={"Head": "Head"}),
        record() | {"version": "another"},
    ):
        assert not is_done(results, other)
    (folder / "a.bvh").write_text("edited")
    assert not is_done(results, record())


def test_of_earlier_results_only_that_which_is_there_is_kept(results, database, folder):
    for text in ("first", "second"):
        database.add(done(output_hash=text_hash(text)))
    (folder / "a.bvh").write_text("second")
    results.add(done(output_hash=text_hash("third")), ["a.bvh"])
    assert [each["output_hash"] for each in database.records("a.bvh")] == [text_hash("third"), text_hash("second")]


def test_only_what_was_made_here_may_be_replaced(results, database, folder):
    results.check_replaceable(record(), "a.bvh")  # nothing there
    (folder / "a.bvh").write_text(OUTPUT)
    with pytest.raises(FileError, match="exists already; --overwrite replaces it"):
        results.check_replaceable(record(), "a.bvh")
    database.add(done())
    results.check_replaceable(record(), "a.bvh")
    (folder / "b.bvh").write_text(OUTPUT)
    (folder / "a.bvh").write_text(OUTPUT + " edited")
    for name in ("a.bvh", "b.bvh"):
        with pytest.raises(FileError, match="exists already"):
            results.check_replaceable(record(clip(name)), name)


@pytest.mark.parametrize("other", ["input", "target"])
def test_the_result_of_other_files_is_left_alone(results, database, folder, tmp_path, other):
    known = tmp_path / "other"
    known.write_text("")
    (folder / "a.bvh").write_text(OUTPUT)
    database.add(done() | {other: str(known)})
    paths = {"input": tmp_path / "a.bvh", "target": tmp_path / "hero.json"}
    for path in paths.values():
        path.write_text("")
    now = record() | {key: str(path) for key, path in paths.items()}
    with pytest.raises(FileError, match=f"is the result of .*{known}.*--overwrite replaces it"):
        results.check_replaceable(now, "a.bvh")
    known.unlink()  # looks as if it was moved
    results.check_replaceable(now, "a.bvh")


def test_results_are_there_only_if_every_one_of_their_files_is(results, database, folder):
    (folder / "a.bvh").write_text(OUTPUT)
    (folder / "a.npz").write_text("arrays")
    database.add(done(others={"a.npz": text_hash("arrays")}))
    for outputs in (["a.bvh"], ["a.bvh", "a.npz"], ["a.npz"]):
        assert results.known(record(), outputs)
    assert not results.known(record(), ["a.bvh", "a.glb"])
    (folder / "a.npz").write_text("others")
    assert not results.known(record(), ["a.bvh", "a.npz"])


def test_a_result_that_is_killed_before_it_is_in_place_is_known_as_its_own(results, database, folder, monkeypatch):
    (folder / "a.bvh").write_text(OUTPUT)
    database.add(done())
    with monkeypatch.context() as killed:
        killed.setattr(Results, "check_replaceable", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            results.put(record(), {"a.bvh": [b"new"]})
    for text in (OUTPUT, "new"):  # whether the file was renamed or not
        (folder / "a.bvh").write_text(text)
        results.check_replaceable(record(), "a.bvh")
        assert is_done(results, record())


# ---- the file


def test_a_file_of_another_program_is_left_alone(folder, tmp_path):
    (folder / DATABASE).write_text("name: my own")
    with pytest.raises(FileError, match=r"results\.sqlite: is not the database of a batch; choose another folder"):
        Database(folder)
    assert (folder / DATABASE).read_text() == "name: my own"
    (folder / DATABASE).unlink()
    with closing(sqlite3.connect(folder / DATABASE)) as other:
        other.execute("CREATE TABLE clips (name TEXT)")
    before = (folder / DATABASE).read_bytes()
    with pytest.raises(FileError, match="is not the database of a batch"):
        Database(folder)
    assert (folder / DATABASE).read_bytes() == before
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="expected a folder"):
        Database(tmp_path / "file")


@pytest.mark.parametrize("part", [b"", b"\0\xff", zlib.compress(b"1"), "text", None, 1])
def test_what_no_batch_has_written_is_refused(folder, database, part):
    database.add(done())
    with closing(sqlite3.connect(folder / DATABASE)) as other, other:
        other.execute("UPDATE clips SET clip = ?", [part])
    with pytest.raises(FileError, match=r"results\.sqlite: is damaged; delete it"):
        database.records("a.bvh")


def test_a_database_that_is_only_read_makes_nothing(tmp_path):
    with closing(Database(tmp_path / "out", read_only=True)) as database:
        assert database.records("a.bvh") == []
    assert not (tmp_path / "out").exists()


def test_a_record_that_cannot_be_written_changes_nothing(folder, database):
    database.add(done())
    before = last_records(folder)
    database._do("PRAGMA max_page_count = 1")
    with pytest.raises(FileError, match=r"results\.sqlite: the disk is full"):
        database.add(done(clip("b.bvh"), verdict=os.urandom(400_000).hex()))
    assert last_records(folder)["a.bvh"] == before["a.bvh"]


def test_a_database_that_nobody_uses_is_one_file(folder):
    with closing(Database(folder)) as one, closing(Database(folder)) as other:
        one.add(done())
        assert one.claim("a.bvh")
        assert not other.claim("a.bvh")
    assert [path.name for path in folder.iterdir()] == [DATABASE]
    with closing(Database(folder)) as next_one:
        assert next_one.claim("a.bvh")


def test_files_left_by_a_killed_run_are_removed(folder):
    left = folder / "deep" / ".distretarget-0123.tmp"
    of_another = folder / "inside" / ".distretarget-4567.tmp"
    for path in (left, of_another, folder / "inside" / DATABASE):
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
    Results(folder).database.close()
    assert (left.exists(), of_another.exists()) == (False, True)


# ---- several runs


HOLDS = """
import sys
from pathlib import Path
from distretarget.batch.results import Database

with Database(Path(sys.argv[1])).transaction():
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_run_waits_while_another_writes(folder):
    Database(folder).close()

    def add():
        with closing(Database(folder)) as own:
            own.add(done())

    words = [sys.executable, "-c", HOLDS, folder]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"held\n"
        added = threading.Thread(target=add)
        added.start()
        added.join(0.2)
        assert added.is_alive()
        assert last_records(folder) == {}
        other.stdin.close()
        added.join()
    assert len(last_records(folder)) == 1


def test_a_run_does_not_wait_for_ever(folder, database, monkeypatch):
    monkeypatch.setattr(database_module, "LONGEST_WAIT", 0.01)
    other = Database(folder)
    with database.transaction(), pytest.raises(FileError, match="another run has been writing"):
        other.add(done())
    other.close()


def batch(*arguments):
    return run("batch", *arguments, "--jobs", 1)


@pytest.fixture
def working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(("b", "a")):
        (tmp_path / "in").mkdir(exist_ok=True)
        write_bvh(tmp_path / f"in/{name}.bvh", swaying(person(), seed=seed))
    (tmp_path / "in/broken.bvh").write_text("HIERARCHY\n")
    (tmp_path / "body.json").write_text(skeleton_to_json(other_lengths(person()), "body"))
    return tmp_path


def test_a_row_has_what_is_recorded(working_folder):
    done = batch("in", "body.json", "-o", "out", "--table", "metrics.csv")
    assert done.returncode == 1
    rows = pd.read_csv("metrics.csv").set_index("output")
    assert rows.index.tolist() == ["a.bvh", "b.bvh", "broken.bvh"]
    assert rows["status"].tolist() == ["done", "done", "failed"]
    for name, record in last_records(working_folder / "out").items():
        row = rows.loc[name]
        assert row["frames"] == record["frames"]
        assert row["input_hash"] == record["input_hash"]
        if record["status"] == "done":
            for name in ("direction_error", "direction_error_copy", "jerk_source"):
                assert row[name] == pytest.approx(record["metrics"][name], rel=1e-6)
            assert row["verdict"].endswith(".")
    assert "in/broken.bvh" in rows.loc["broken.bvh", "error"]


@pytest.mark.usefixtures("working_folder")
def test_two_runs_and_a_second_look_write_the_same_table():
    batch("in", "body.json", "-o", "out", "--table", "one.csv")
    batch("in", "body.json", "-o", "more", "--table", "other.csv")
    assert Path("one.csv").read_bytes() == Path("other.csv").read_bytes()
    batch("in", "body.json", "-o", "out", "--table", "one.csv")
    assert Path("one.csv").read_bytes() == Path("other.csv").read_bytes()


def test_a_table_of_other_origin_is_left_alone(working_folder):
    Path("mine.csv").write_text("name,age\n")
    once = "batch", "in", "body.json", "-o", "out", "--table"
    assert "mine.csv: exists already" in refused(*once, "mine.csv")
    assert "expected one of .csv, .parquet" in refused(*once, "mine.txt")
    assert not (working_folder / "out").exists()


@pytest.mark.skipif(find_spec("pyarrow") is None, reason="pyarrow is not installed")
@pytest.mark.usefixtures("working_folder")
def test_parquet_has_the_same_rows_as_csv():
    for name in ("metrics.csv", "metrics.parquet", "metrics.parquet"):
        batch("in", "body.json", "-o", "out", "--table", name)
    both = pd.read_csv("metrics.csv"), pd.read_parquet("metrics.parquet")
    assert both[1]["direction_error"].dtype == "float64"
    pd.testing.assert_frame_equal(*both, check_dtype=False)


def test_without_pyarrow_a_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr(pages, "find_spec", lambda _: None)
    with pytest.raises(MissingPackageError, match="pip install pyarrow"):
        pages.check_table(Path("metrics.parquet"))
