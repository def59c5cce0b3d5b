"""The table of a batch: a row for each clip, in CSV and Parquet, the same in every run."""

from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest
from bodies import other_lengths, person, swaying
from program import last_records, refused, run

from distretarget import write_bvh
from distretarget.batch import pages
from distretarget.errors import MissingPackageError
from distretarget.io.skeleton_json import skeleton_to_json


def batch(*arguments):
    return run("batch", *arguments, "--jobs", 1)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(("b", "a")):
        (tmp_path / "in").mkdir(exist_ok=True)
        write_bvh(tmp_path / f"in/{name}.bvh", swaying(person(), seed=seed))
    (tmp_path / "in/broken.bvh").write_text("HIERARCHY\n")
    (tmp_path / "body.json").write_text(skeleton_to_json(other_lengths(person()), "body"))
    return tmp_path


def test_a_row_has_what_is_recorded(folder):
    done = batch("in", "body.json", "-o", "out", "--table", "metrics.csv")
    assert done.returncode == 1
    rows = pd.read_csv("metrics.csv").set_index("output")
    assert rows.index.tolist() == ["a.bvh", "b.bvh", "broken.bvh"]
    assert rows["status"].tolist() == ["done", "done", "failed"]
    for name, record in last_records(folder / "out").items():
        row = rows.loc[name]
        assert row["frames"] == record["frames"]
        assert row["input_hash"] == record["input_hash"]
        if record["status"] == "done":
            for name in ("direction_error", "direction_error_copy", "jerk_source"):
                assert row[name] == pytest.approx(record["metrics"][name], rel=1e-6)
            assert row["verdict"].endswith(".")
    assert "in/broken.bvh" in rows.loc["broken.bvh", "error"]


@pytest.mark.usefixtures("folder")
def test_two_runs_and_a_second_look_write_the_same_table():
    batch("in", "body.json", "-o", "out", "--table", "one.csv")
    batch("in", "body.json", "-o", "more", "--table", "other.csv")
    assert Path("one.csv").read_bytes() == Path("other.csv").read_bytes()
    batch("in", "body.json", "-o", "out", "--table", "one.csv")
    assert Path("one.csv").read_bytes() == Path("other.csv").read_bytes()


def test_a_table_of_other_origin_is_left_alone(folder):
    Path("mine.csv").write_text("name,age\n")
    once = "batch", "in", "body.json", "-o", "out", "--table"
    assert "mine.csv: exists already" in refused(*once, "mine.csv")
    assert "expected one of .csv, .parquet" in refused(*once, "mine.txt")
    assert not (folder / "out").exists()


@pytest.mark.skipif(find_spec("pyarrow") is None, reason="pyarrow is not installed")
@pytest.mark.usefixtures("folder")
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
