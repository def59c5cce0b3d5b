"""Numbers in the prose are those of the tables that the benchmarks write into docs/results.md."""

import math
import re
from pathlib import Path

import pytest
from make_docs import lines

ROOT = Path(__file__).resolve().parents[1]
JERK = "jerk against rotation copy's"
METHODS = ("copy", "paper", "contact")


def numbers(cell):
    """The numbers in a cell, in their order."""
    return [float(number) for number in re.findall(r"\d+\.?\d*", cell.replace(",", ""))]


def summary(start, method, number=0):
    """A number of the summary: of the row that begins so, for a method."""
    row = next(row for row in lines("summary") if row[0].startswith(start))
    return numbers(row[1 + METHODS.index(method)])[number]


def column(table, place, number):
    """The numbers at a place of the cells in a column of a table; rows with `-` have none."""
    return [numbers(row[place])[number] for row in lines(table)[1:] if not row[place].startswith("-")]


RESULTS = {
    r"written stress is ([\d.]+) times its free stress": lambda: summary("written stress / free", "paper"),
    r"Contact error is ([\d.]+) of the rotation copy's": lambda: summary("contact error, mean", "contact"),
    r"turn show this, as does the picture of 13_11 below\. (\d+) of": lambda: summary("frames that did", "paper"),
    r"The largest is ([\d.]+) \(spine": lambda: summary("hand to hip", "contact", 1),
    r"is below (\d+) degrees at the 99th": lambda: math.ceil(summary("direction error, 99th", "contact", 1)),
    r"is the copy's \(([\d.]+) times at most\)": lambda: summary(f"{JERK}, captured", "contact", 1),
    r"on spine \+60 % has ([\d.]+) times the copy's": lambda: summary(f"{JERK}, samples", "contact", 1),
    r"\*\*Pops\*\* are left in (\d+) runs": lambda: summary("runs with pops", "contact"),
}
CHANGES = {
    r"contacts are off by ([\d.]+) of what": lambda: summary("contact error, mean", "contact"),
    r"at a mean direction error of ([\d.]+) degrees": lambda: summary("direction error, mean", "contact"),
    r"they slide as much as the source's, ([\d.]+) times": lambda: summary("foot skate", "copy", 2),
    r"a leg apart, are (\d+) to": lambda: min(column("duets", 1, 2)),
    r"a leg apart, are \d+ to (\d+) %": lambda: max(column("duets", 1, 2)),
    r"retargeted alone, and (\d) to": lambda: min(column("duets", 1, 3)),
    r"retargeted alone, and \d to (\d) %": lambda: max(column("duets", 1, 3)),
    r"put\s+them up to (\d+) % off": lambda: max(column("supports", 1, 0)),
}
QUOTES = [
    (page, pattern, value)
    for page, quotes in (("docs/results.md", RESULTS), ("CHANGELOG.md", CHANGES))
    for pattern, value in quotes.items()
]


@pytest.mark.parametrize(("page", "pattern", "value"), QUOTES, ids=[pattern for _, pattern, _ in QUOTES])
def test_a_number_in_the_prose_is_that_of_the_table(page, pattern, value):
    found = re.search(pattern.replace(" ", r"\s+"), (ROOT / page).read_text("utf-8"))
    assert found, "the sentence has changed: change it here as well"
    digits = len(found[1].partition(".")[2])
    assert found[1] == f"{value():.{digits}f}"
