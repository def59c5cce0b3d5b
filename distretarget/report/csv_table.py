"""Tables as CSV, which spreadsheets show as they are."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

FORMULAS = ("=", "+", "-", "@", "\t", "\r")  # a text that begins with one is run by spreadsheets


def csv_text(rows: Sequence[Mapping[str, object]]) -> str:
    """Return rows with the same keys as CSV: a row of keys, then each row; None is an empty cell."""
    return "".join(csv_lines([*rows[0]], rows))


def csv_lines(columns: Sequence[str], rows: Iterable[Mapping[str, object]]) -> Iterator[str]:
    """Yield the lines of a table: the names of its columns, then each row; a missing value or None is an empty cell.

    A text that a spreadsheet would run as a formula has an apostrophe before it.
    """
    line = io.StringIO()
    table = csv.writer(line, lineterminator="\n")
    for cells in chain([columns], (map(row.get, columns) for row in rows)):
        table.writerow([f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULAS) else cell for cell in cells])
        yield line.getvalue()
        line.seek(0)
        line.truncate()
