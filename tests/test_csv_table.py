"""Tables as CSV: no text of a file becomes a formula."""

import csv

import pytest

from distretarget.report.diff_document import csv_lines, csv_text


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1"])
def test_no_text_is_a_formula(text):
    rows = list(csv.reader(csv_lines([text, "b"], [{text: text, "b": -1.5}])))
    assert rows == [[f"'{text}", "b"], [f"'{text}", "-1.5"]]


def test_no_text_ends_its_row():
    assert [*csv.reader(csv_lines(["a", "b"], [{"a": "x\r\ny", "b": "\r=1"}]))][1:] == [["x \ny", " =1"]]


def test_what_is_missing_is_an_empty_cell():
    assert [*csv_lines(["a", "b"], [{"a": None}, {"b": 'x, "y"'}])] == ["a,b\n", ",\n", ',"x, ""y"""\n']
    assert csv_text([{"a": 1}, {"a": 2}]) == "a\n1\n2\n"
