"""The table of a batch, CSV or Parquet: a row for each clip with its metrics, warnings and what it was made from."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from distretarget.batch.record import VERSION, BatchRecord
from distretarget.errors import FileError, MissingPackageError
from distretarget.measure.metrics import COLUMNS
from distretarget.report.csv_table import csv_lines

TABLES = (".csv", ".parquet")
TEXTS = ("output", "status", "input", "target", "verdict", "warnings", "error")
HASHES = ("input_hash", "target_hash", "output_hash", "version")
TABLE = (*TEXTS, "frames", *HASHES, "notes", *COLUMNS)  # the columns
TABLE_HEAD = ",".join(TEXTS)  # the beginning of a CSV file
PARQUET_MARK = b"distretarget_version"  # in the metadata of a Parquet file
PARQUET_TAIL = 1 << 18  # the end of a Parquet file that has its metadata [bytes]
BETWEEN = " | "  # warnings of a clip, and notes


def is_parquet(path: Path) -> bool:
    """Return whether a table of this name is written as Parquet."""
    return path.suffix.lower() == ".parquet"


def check_table(path: Path) -> None:
    """Raise an error if no table can be written to a file of this name."""
    if path.suffix.lower() not in TABLES:
        raise FileError(path, f"the ending says what to write, expected one of {', '.join(TABLES)}")
    if is_parquet(path) and find_spec("pyarrow") is None:
        raise MissingPackageError(
            "Parquet needs the package pyarrow; install it with `pip install pyarrow`, or write .csv", path
        )


def table(path: Path, records: Iterable[BatchRecord]) -> bytes | Iterator[str]:
    """Return the content of a table of records, in their order; that of CSV in parts."""
    rows = map(_row, records)
    return _parquet(rows) if is_parquet(path) else csv_lines(TABLE, rows)


def _row(record: BatchRecord) -> dict[str, Any]:
    """The row of a clip, by column; None for what it does not have."""
    texts = {name: record.get(name) or None for name in (*TEXTS, *HASHES)}
    lists = {name: BETWEEN.join(record[name]) or None for name in ("warnings", "notes")}
    metrics = {name: number if number is None else float(f"{number:.7g}") for name, number in record["metrics"].items()}
    return {**texts, "frames": record["frames"], **lists, **metrics}


def _parquet(rows: Iterable[dict[str, Any]]) -> bytes:
    """The rows as Parquet; bytes of texts that are not UTF-8, as in paths, are replaced."""
    import pyarrow
    from pyarrow import parquet

    kinds = {"frames": pyarrow.int64(), **dict.fromkeys(COLUMNS, pyarrow.float64())}
    schema = pyarrow.schema([(name, kinds.get(name, pyarrow.string())) for name in TABLE], {PARQUET_MARK: VERSION})
    valid = [
        {
            name: each.encode("utf-8", "replace").decode() if isinstance(each, str) else each
            for name, each in row.items()
        }
        for row in rows
    ]
    content = io.BytesIO()
    parquet.write_table(pyarrow.Table.from_pylist(valid, schema), content)
    return content.getvalue()
