"""Numbers in the change log are those of the tables that the benchmarks write into docs/results.md."""

import re

import pytest
from bodies import ROOT
from make_docs import lines

METHODS = ("source", "copy", "paper", "contact")


def numbers(cell):
    """The numbers in a cell, in their order."""
    return [float(number) for number in re.findall(r"\d+\.?\d*", cell.replace(",", ""))]


def summary(start, method):
    """The mean in the row of the summary that begins so, for a method."""
    row = next(row for row in lines("summary") if row[0].startswith(start))
    return numbers(row[1 + METHODS.index(method)])[0]


def column(table, place, number):
    """The numbers at a place of the cells in a column of a table; rows with `-` have none."""
    return [numbers(row[place])[number] for row in lines(table)[1:] if not row[place].startswith("-")]


CHANGES = {
    r"contacts are off by ([\d.]+) of what": lambda: (
        summary("contact error", "contact") / summary("contact error", "copy")
    ),
    r"at a mean direction error of ([\d.]+) degrees": lambda: summary("direction error", "contact"),
    r"they slide as much as the source's, ([\d.]+) times": lambda: (
        summary("foot skate", "copy") / summary("foot skate", "source")
    ),
    r"a leg apart, are (\d+) to": lambda: min(column("duets", 1, 2)),
    r"a leg apart, are \d+ to (\d+) %": lambda: max(column("duets", 1, 2)),
    r"retargeted alone, and (\d) to": lambda: min(column("duets", 1, 3)),
    r"retargeted alone, and \d to (\d) %": lambda: max(column("duets", 1, 3)),
    r"put\s+them up to (\d+) % off": lambda: max(column("supports", 1, 0)),
}


@pytest.mark.parametrize(("pattern", "value"), CHANGES.items(), ids=CHANGES)
def test_a_number_in_the_prose_is_that_of_the_table(pattern, value):
    found = re.search(pattern.replace(" ", r"\s+"), (ROOT / "CHANGELOG.md").read_text("utf-8"))
    assert found, "the sentence has changed: change it here as well"
    digits = len(found[1].partition(".")[2])
    assert found[1] == f"{value():.{digits}f}"
