"""The table `metrics.csv` in a folder of results: a row for each clip that was measured.

A row is found by the hash of what it says, which is its first cell, so that a damaged row is not used. Rows are added
as clips are done, and sorted by output at the end of a run.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping
from contextlib import AbstractContextManager
from itertools import chain
from pathlib import Path
from typing import TypedDict

from distretarget.batch.journal import Journal
from distretarget.batch.plan import METRICS as NAME
from distretarget.io.files import write_whole
from distretarget.measure.metrics import COLUMNS as METRICS

TEXTS = ("verdict", "warnings", "notes", "alignment")
COLUMNS = ("row", "output", *TEXTS, *METRICS)
HEADER = ",".join(COLUMNS).encode()
BETWEEN = " | "  # warnings of a clip, and notes


class Measured(TypedDict):
    """What was measured of a clip.

    Attributes:
        metrics: by `measure.metrics.COLUMNS`; None where nothing was to be measured; empty of a clip that failed.
        verdict: on the result, in a sentence.
        warnings: a line each.
        notes: joints of the target without a counterpart, in a line, and which readers refuse the result.
        alignment: of the two bodies, as `alignment_text` has it.
    """

    metrics: Mapping[str, float | None]
    verdict: str
    warnings: list[str]
    notes: list[str]
    alignment: str


def row_of(output: str, measured: Measured) -> bytes:
    """Return the row of an output."""
    warnings, notes = (BETWEEN.join(measured[key]) for key in ("warnings", "notes"))
    texts = [" ".join(each.splitlines()) for each in (output, measured["verdict"], warnings, notes)]
    row = io.StringIO()
    numbers = (measured["metrics"].get(name) for name in METRICS)
    csv.writer(row, lineterminator="").writerow([*texts, measured["alignment"], *numbers])
    content = row.getvalue().encode("utf-8", "surrogateescape")
    return _hash_of(content) + b"," + content


def parse_row(line: bytes) -> Measured | None:
    """Return what a row says; None if it is damaged, or of another version."""
    name, _, content = line.rstrip(b"\n").partition(b",")
    if name != _hash_of(content):
        return None
    _, verdict, warnings, notes, alignment, *cells = next(csv.reader([content.decode("utf-8", "surrogateescape")]))
    numbers = [float(cell) if cell else None for cell in cells]
    return Measured(
        metrics=dict(zip(METRICS, numbers, strict=True)),
        verdict=verdict,
        warnings=warnings.split(BETWEEN) if warnings else [],
        notes=notes.split(BETWEEN) if notes else [],
        alignment=alignment,
    )


def _hash_of(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest()[:16].encode()


def _name_in(row: bytes) -> str:
    return row.partition(b",")[0].decode("ascii", "replace")


def _output_in(row: bytes) -> bytes:
    content = row.partition(b",")[2]
    return content.partition(b'",' if content.startswith(b'"') else b",")[0]


class MetricRows:
    """The rows in a folder of results."""

    def __init__(self, folder: Path, lock: AbstractContextManager[object]) -> None:
        self._path, self._lock = folder / NAME, lock
        self._forget()

    def _forget(self) -> None:
        """Begin to read the file again with its first row."""
        self._starts: dict[str, int] = {}  # where each row begins [bytes], by its name
        self._journal = Journal(self._path, self._lock, self._note)

    def add(self, output: str, measured: Measured) -> str:
        """Add the row of an output, unless it is there, and return its name; a FileError if that fails.

        The file is locked. It need not be on the disk: the clip of a row that gets lost is retargeted again.
        """
        row = row_of(output, measured)
        self._journal.catch_up()
        head = () if self._has_header() else (HEADER,)
        if (name := _name_in(row)) not in self._starts:
            self._journal.add(*head, row, flush=False)
        return name

    def find(self, name: str) -> Measured | None:
        """Return what the row with this name says; None if there is none."""
        self._journal.catch_up()
        if name in self._starts and self._line(name) is None:  # another run has sorted the rows
            self._forget()
            self._journal.catch_up()
        line = self._line(name)
        return None if line is None else parse_row(line)

    def _line(self, name: str) -> bytes | None:
        """The row with this name, if it is where it was."""
        start = self._starts.get(name)
        line = b"" if start is None else next(self._journal.lines_at([start]))
        return line if _name_in(line) == name else None

    def sort(self) -> None:
        """Order the rows by output, so that the same clips leave the same file whichever was done first."""
        self._journal.catch_up()
        if not self._starts:
            return
        outputs = map(_output_in, self._journal.lines_at(self._starts.values()))
        order = sorted(zip(outputs, self._starts.items(), strict=True))
        starts = [start for _, (name, start) in order if name != _name_in(HEADER)]
        rows = (row.rstrip(b"\n") + b"\n" for row in self._journal.lines_at(starts))
        write_whole(self._path, chain([HEADER + b"\n"], rows), overwrite=True)
        self._forget()

    def _has_header(self) -> bool:
        """Whether the file begins as this version writes it; one of another version is put aside."""
        if not self._path.exists():
            return False
        with self._path.open("rb") as file:
            first = file.readline()
        if first and first.rstrip(b"\n") != HEADER:
            self._path.replace(self._path.with_suffix(".old.csv"))
            self._forget()
            return False
        return bool(first)

    def _note(self, row: bytes, start: int) -> bool:
        self._starts[_name_in(row)] = start
        return True
