"""The lines of a manifest."""

import json
from dataclasses import fields
from pathlib import PurePath

import pytest

from distretarget.batch.clips import Clip
from distretarget.batch.plan import Work
from distretarget.batch.record import ManifestRecord, Recipe, RecordedOptions, failed_record, parse_record, read_records
from distretarget.io.files import Text
from distretarget.io.map_json import MapFile
from distretarget.pipeline.options import Options

RECIPE = Recipe(Options(), MapFile({"Head": "Skull"}, ""), "1")
WORK = Work(Clip(PurePath("a.bvh"), PurePath("a.bvh"), 1), Text("{}", "hero.json"), PurePath("deep/a.bvh"))


def line_of(record):
    return json.dumps(record).encode() + b"\n"


def test_a_line_has_every_key():
    record = parse_record(line_of(failed_record(WORK, "in", RECIPE)))
    assert record.keys() == ManifestRecord.__required_keys__
    assert (record["input"], record["output"], record["target"]) == ("a.bvh", "deep/a.bvh", "hero.json")
    assert (record["status"], record["output_hash"], record["error"]) == ("failed", None, None)


def test_a_line_has_all_options_and_the_map():
    options = failed_record(WORK, "in", RECIPE)["options"]
    assert options.keys() == RecordedOptions.__required_keys__ == {each.name for each in fields(Options)} | {"map"}
    assert options["objective"] == "contact"
    assert options["map"] == {"Head": "Skull"}


@pytest.mark.parametrize("key", sorted(ManifestRecord.__required_keys__))
def test_a_line_without_one_of_the_keys_is_no_record(key):
    record = failed_record(WORK, "in", RECIPE)
    del record[key]
    assert parse_record(line_of(record)) is None


@pytest.mark.parametrize("key", sorted(ManifestRecord.__required_keys__))
@pytest.mark.parametrize("value", [True, ["x"], {"result": 1}, {"result": {"slide": "1"}}], ids=str)
def test_a_line_with_a_value_of_another_kind_is_no_record(key, value):
    record = failed_record(WORK, "in", RECIPE) | {key: value}
    kinds = {"frames": bool, "seconds": bool, "notes": list, "warnings": list}
    if isinstance(value, kinds.get(key, ())) or (key == "options" and isinstance(value, dict)):
        return
    assert parse_record(line_of(record)) is None


@pytest.mark.parametrize("line", [b"", b"{", b"[]", b"null", b"\xff", b"[" * 100_000])
def test_what_is_no_object_is_no_record(line):
    assert parse_record(line) is None


def test_records_are_read_in_order_and_none_where_there_is_no_manifest(tmp_path):
    path = tmp_path / "manifest.jsonl"
    assert list(read_records(path)) == []
    path.write_bytes(b"".join(line_of(failed_record(WORK, text, RECIPE)) for text in "ab") + b'{"inp')
    broken = []
    assert [record["input_hash"] for record in read_records(path, broken.append)] == ["a", "b"]
    assert broken == [3]
