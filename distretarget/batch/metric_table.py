"""A table of a batch: a row for each clip with its metrics, warnings and what it was made from, as CSV or Parquet."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from distretarget.batch.metric_rows import BETWEEN
from distretarget.batch.record import ManifestRecord
from distretarget.errors import FileError, MissingPackageError
from distretarget.measure.metrics import COLUMNS as METRICS

KINDS = (".csv", ".parquet")
TEXTS = ("output", "status", "input", "target", "verdict", "warnings", "error")
HASHES = ("input_hash", "target_hash", "output_hash", "version")
COLUMNS = (*TEXTS, "frames", *HASHES, *METRICS)
MARK = b"distretarget_version"  # in the metadata of a Parquet file
HEAD = ",".join(TEXTS).encode()  # the beginning of a CSV file
TAIL = 1 << 18  # the end of a Parquet file that has its metadata [bytes]


def check_table(path: Path) -> None:
    """Raise an error if no table can be written to a file of this name."""
    if path.suffix.lower() not in KINDS:
        raise FileError(path, f"the ending says what to write, expected one of {', '.join(KINDS)}")
    if path.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise MissingPackageError(
            "Parquet needs the package pyarrow; install it with `pip install pyarrow`, or write .csv", path
        )


def is_table(path: Path) -> bool:
    """Return whether a file is a table that a batch has written."""
    try:
        with path.open("rb") as file:
            if path.suffix.lower() == ".csv":
                return file.read(len(HEAD)) == HEAD
            file.seek(max(path.stat().st_size - TAIL, 0))
            return MARK in file.read()
    except OSError:
        return False


def table(path: Path, records: Iterable[ManifestRecord], version: str) -> bytes:
    """Return the content of a table of lines of a manifest, in the order of the outputs; `version` is the program's."""
    rows = [_row(record) for record in sorted(records, key=lambda record: record["output"])]
    if path.suffix.lower() == ".parquet":
        return _parquet(rows, version)
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode("utf-8", "surrogateescape")


def _row(record: ManifestRecord) -> dict[str, Any]:
    """The row of a clip, by column; None for what it does not have."""
    return {
        **{name: record.get(name) or None for name in (*TEXTS, *HASHES)},
        "frames": record["frames"],
        "status": "left out" if record["left_out"] else record["status"],
        "warnings": BETWEEN.join(record["warnings"]) or None,
        **dict.fromkeys(METRICS),
        **record["metrics"],
    }


def _parquet(rows: list[dict[str, Any]], version: str) -> bytes:
    import pyarrow
    from pyarrow import parquet

    kinds = {"frames": pyarrow.int64(), **dict.fromkeys(METRICS, pyarrow.float64())}
    schema = pyarrow.schema([(name, kinds.get(name, pyarrow.string())) for name in COLUMNS], {MARK: version})
    columns = {name: list(_texts(rows, name)) if name not in kinds else [row[name] for row in rows] for name in COLUMNS}
    content = io.BytesIO()
    parquet.write_table(pyarrow.table(columns, schema), content)
    return content.getvalue()


def _texts(rows: list[dict[str, Any]], name: str) -> Iterator[str | None]:
    """A column of texts, in which bytes that are not UTF-8, as in paths, are replaced."""
    for row in rows:
        text = row[name]
        yield None if text is None else str(text).encode("utf-8", "replace").decode()
