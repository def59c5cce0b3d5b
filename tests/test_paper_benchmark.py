"""The paper's experiment: the exact checks hold, and docs/paper.md has the numbers that its functions give."""

import re

import numpy as np
import pytest
from bodies import ROOT
from paper_case import EDITS, POSTURE, case, checks, on_table_one
from paper_tables import edit_cells, pair_rows, pairs_table, spine_table
from table_one import table_one

PAGE = (ROOT / "docs" / "paper.md").read_text("utf-8")
SUBSET = ("legs +60 %", "spine +60 %")
EFFORT = "iterations"
"""A column that depends on the machine: a last bit changes the way to a minimum, though not the minimum."""


def lines_of(name):
    """The cells of a table of the page, head and rows."""
    text = PAGE.partition(f"<!-- {name} -->\n")[2].partition("<!-- end -->")[0]
    return cells_of(text)


def cells_of(text):
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.strip()]
    return [row for row in rows if set(row) != {"---"}]


def numbers_of(cell):
    return [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", cell)]


def assert_same(written, found):
    """Numbers agree to two units of their last digit, words are equal; otherwise run benchmarks/paper.py."""
    assert re.sub(r"[\d.]+", "#", written) == re.sub(r"[\d.]+", "#", found)
    digits = max(len(number.partition(".")[2]) for number in re.findall(r"\d+\.?\d*", written))
    np.testing.assert_allclose(numbers_of(found), numbers_of(written), rtol=0, atol=2.01 * 10.0**-digits)


def test_known_answers_are_found_and_are_on_the_page():
    rows = [list(check) for check in checks()]
    for check, known, found in rows:
        assert found == known, check
    assert lines_of("checks")[1:] == rows


def test_the_skeleton_is_that_of_table_one():
    skeleton, expected = on_table_one("walk").skeleton, table_one()
    assert parents_of(skeleton) == parents_of(expected)
    lengths, known = (dict(zip(each.names, each.lengths, strict=True)) for each in (skeleton, expected))
    assert lengths == pytest.approx(known, abs=1e-6)


def parents_of(skeleton):
    return {name: skeleton.names[parent] for name, parent in zip(skeleton.names[1:], skeleton.parents[1:], strict=True)}


@pytest.mark.parametrize("edit", SUBSET)
def test_the_page_has_what_the_solver_finds(edit):
    head, *rows = lines_of("edits")
    written = next(row for row in rows if row[0] == edit)
    for column, *cells in zip(head, written, edit_cells(edit), strict=True):
        if column != EFFORT:
            assert_same(*cells)


@pytest.mark.parametrize(("name", "found"), [("spine", spine_table), ("pairs", pairs_table)])
def test_the_page_has_the_long_spine(name, found):
    for written, row in zip(lines_of(name), cells_of(found()), strict=True):
        assert written[0] == row[0]
        for cells in zip(written[1:], row[1:], strict=True):
            if numbers_of(cells[0]):
                assert_same(*cells)


def test_the_page_has_every_edit():
    assert [row[0] for row in lines_of("edits")[1:]] == list(EDITS)


def test_parts_of_sigma_add_up():
    one = case("spine +60 %")
    sums = np.sum([sigmas for _, sigmas in pair_rows()], axis=0)
    np.testing.assert_allclose(sums, [one.sigma(points)[POSTURE] for points in one.postures().values()], rtol=1e-9)


def test_the_copy_is_that_of_the_program():
    one = case("spine +60 %")
    np.testing.assert_allclose(one.copy, one.paper.rotation_copy.positions, atol=1e-12)
