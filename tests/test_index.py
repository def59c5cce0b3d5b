"""The page over clips, without a browser: its content, and its size."""

import html
import json
import re
from pathlib import Path

import pytest

import distretarget.report
from distretarget.measure.metrics import COLUMNS
from distretarget.report.page import FIELDS, METRIC_COLUMNS, index_page

NASTY = "</script><!--<b>&amp; \"q' ü \u2028\u2029 \ud800 {{batch}}"


def metrics(value=0.123456789):
    return dict.fromkeys(COLUMNS, value)


def record(name="a.bvh", **others):
    """The record of a clip, as far as the page reads it."""
    return {
        "input": f"/clips/{name}",
        "output": name,
        "target": "/rigs/tall.json",
        "frames": 10,
        "seconds": 0.5,
        "metrics": metrics(),
        "warnings": [],
        "status": "done",
        "error": "",
        **others,
    }


def failed(name="bad.bvh", error="no reason", **others):
    return record(name, frames=0, seconds=0.0, metrics={}, status="failed", error=error, **others)


def embedded(text):
    """The data of the page, which ends where a browser ends it: at the first `</script`."""
    start = text.index('<script type="application/json" id="batch">')
    return json.loads(text[text.index(">", start) + 1 : text.index("</script", start)])


def rows_of(*records, links=None):
    batch = embedded(index_page(records, links or {}, "title"))
    assert tuple(batch["fields"]) == FIELDS
    return [dict(zip(FIELDS, row, strict=True)) for row in batch["rows"]]


def test_names_of_all_kinds_stay_text():
    one = failed(NASTY, NASTY, target=NASTY, warnings=[NASTY])
    text = index_page([one], {NASTY: NASTY}, NASTY)
    assert text.encode("utf-8")
    plain = index_page([failed()], {}, "title")
    for mark in ("<script", "</script", "<!--", "<b>"):
        assert text.count(mark) == plain.count(mark)
    batch = embedded(text)
    (row,) = batch["rows"]
    assert one["input"].endswith(batch["folder"] + row[FIELDS.index("clip")])
    assert batch["warnings"] == [NASTY]
    assert row[FIELDS.index("error")] == NASTY
    assert html.escape(NASTY.replace("\ud800", "\ufffd")) in text


@pytest.mark.parametrize(
    ("path", "url"),
    [
        ("a/b c.html", "a/b%20c.html"),
        ("javascript:alert(1)", "javascript%3Aalert%281%29"),
        ("50%#?.html", "50%25%23%3F.html"),
        ("ü\"'<>.html", "%C3%BC%22%27%3C%3E.html"),
        ("\udcff.html", "%FF.html"),
        ("\ud800.html", "%ED%A0%80.html"),
    ],
)
def test_links_are_quoted(path, url):
    with_link, without = rows_of(record("a.bvh"), record("b.bvh"), links={"a.bvh": path})
    assert with_link["link"] == url
    assert without["link"] is None


def test_the_page_is_one_file_that_asks_for_nothing():
    text = index_page([record(), failed()], {"a.bvh": "a.html"}, "title")
    assert not re.search(r'(src|href)="(?!#|data:)', text)
    assert not re.search(r"https?:|@import|url\(", text)
    assert "default-src 'none'" in text
    assert '<meta name="generator" content="distretarget">' in text
    assert "{{" not in text
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(", text)


def test_a_failed_clip_has_a_reason_and_no_numbers():
    (row,) = rows_of(failed(error="there is nothing to retarget"))
    assert row["done"] == 0
    assert row["error"] == "there is nothing to retarget"
    assert all(row[name] is None for name in ("frames", "seconds", *METRIC_COLUMNS))


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        ("/clips/bad.bvh:7: found 'nan'", "line 7: found 'nan'"),
        ("/clips/bad.bvh: no frames", "no frames"),
        ("/clips/bad.bvh: /rigs/tall.json: no match", "no match"),
        ("/rigs/tall.json: no match", "no match"),
        ("/clips/bad.bvh.gz: no frames", "/clips/bad.bvh.gz: no frames"),
        ("", "no reason given"),
    ],
)
def test_a_reason_leaves_out_what_stands_beside_it(error, reason):
    assert rows_of(failed(error=error))[0]["error"] == reason


def test_metrics_that_are_missing_or_no_numbers_are_none():
    (row,) = rows_of(record(metrics={**metrics(), "jerk": float("nan"), "pop": None}))
    missing = {"jerk", "pop"}
    assert {name for name in METRIC_COLUMNS if row[name] is None} == missing
    assert row["contact_error"] == 0.123457


def test_names_leave_out_the_folder_they_share():
    batch = embedded(index_page([record("x/a.bvh"), record("x/ab.bvh", target="/rigs/t.json")], {}, "title"))
    assert batch["folder"] == "x/"
    assert [row[0] for row in batch["rows"]] == ["a.bvh", "ab.bvh"]
    assert batch["targets"] == ["tall.json", "t.json"]
    windows = embedded(index_page([record(input=rf"C:\clips\{name}") for name in "ab"], {}, "title"))
    assert windows["folder"] == "clips\\"


def test_no_records_at_all():
    batch = embedded(index_page([], {}, "title"))
    assert batch["rows"] == batch["targets"] == batch["warnings"] == []


def test_a_clip_takes_few_bytes():
    def size(count):
        names = [f"folder/clip_{k:05}.bvh" for k in range(count)]
        records = [record(name, warnings=["w" * 300], input=f"/{'long/' * 30}{name}", version="1") for name in names]
        return len(index_page(records, {name: f"{name}.html" for name in names}, "title").encode())

    assert (size(1100) - size(100)) / 1000 < 300


def test_the_script_reads_fields_that_the_page_has():
    script = Path(distretarget.report.__file__).with_name("index.js").read_text("utf-8")
    assert set(re.findall(r"clip\.(\w+)", script)) <= {*FIELDS, "clip"}
