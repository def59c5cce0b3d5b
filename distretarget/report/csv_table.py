"""Tables as CSV, which spreadsheets show as they are."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

FORMULAS = ("=", "+", "-", "@", "\t")  # a text that begins with one is run by spreadsheets


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
        table.writerow([_plain(cell) if isinstance(cell, str) else cell for cell in cells])
        yield line.getvalue()
        line.seek(0)
        line.truncate()


def _plain(text: str) -> str:
    """The text of a cell; a carriage return, which ends the row for some readers, is a space."""
    text = text.replace("\r", " ")
    return f"'{text}" if text.startswith(FORMULAS) else text
