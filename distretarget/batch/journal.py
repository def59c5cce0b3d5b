"""Files of lines to which several runs may add at the same time: `Journal`, and of these the table `metrics.csv`.

Each line is there whole, or is not used.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import chain
from pathlib import Path

from distretarget.batch.plan import METRICS
from distretarget.batch.record import ROW, Measured, parse_row, row_of
from distretarget.errors import FileError
from distretarget.io.files import reason_of, write_whole

HEADER = ",".join(ROW).encode()  # of the table of metrics


class Journal:
    """The lines of a file, of which only the places are kept in memory: there may be a million.

    Attributes:
        path: of the file, which may be missing.
        broken: the numbers of the lines, from 1, that say nothing and are not used.
    """

    def __init__(self, path: Path, lock: AbstractContextManager[object]) -> None:
        """`lock` is held while lines are read or added, and may be held already."""
        self.path, self._lock = path, lock
        self._forget()

    def _forget(self) -> None:
        """Begin to read the file again with its first line."""
        self.broken = list[int]()
        self._size = self._lines = 0  # how much of the file has been read [bytes], [lines]
        self._ends_whole = True

    def _note(self, line: bytes, start: int) -> bool:
        """Note a line and its beginning [bytes]; return whether it says anything."""
        raise NotImplementedError

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs from adding lines; raise a FileError if that fails."""
        with self._named_errors(), self._lock:
            yield

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Raise an error of the operating system as one of the file."""
        try:
            yield
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error

    def _catch_up(self) -> None:
        """Note the lines that this run and others have added since the last call."""
        with self._named_errors():
            if not self.path.exists() or self.path.stat().st_size == self._size:
                return
            with self._lock, self.path.open("rb") as file:
                file.seek(self._size)
                for line in file:
                    self._lines += 1
                    if not self._note(line, self._size) and line.strip():
                        self.broken.append(self._lines)
                    self._size += len(line)
                    self._ends_whole = line.endswith(b"\n")

    def _append(self, *lines: bytes, flush: bool = True) -> None:
        """Add lines, while the file is locked, and flush them to the disk; if that fails, raise a FileError and leave
        the file as it was.
        """
        self._catch_up()
        text = b"".join([b"" if self._ends_whole else b"\n", *(line + b"\n" for line in lines)])
        with self._named_errors(), self.path.open("ab", buffering=0) as file:
            try:
                while text:
                    text = text[file.write(text) :]
                if flush:
                    os.fsync(file.fileno())
            except OSError:
                file.truncate(self._size)
                raise
        self._catch_up()

    def _lines_at(self, starts: Iterable[int]) -> Iterator[bytes]:
        """Yield the lines that begin at these places [bytes]."""
        with self._named_errors(), self.path.open("rb") as file:
            for start in starts:
                file.seek(start)
                yield file.readline()


class MetricRows(Journal):
    """The table `metrics.csv` in a folder of results: a row for each clip that was measured.

    Rows are added as clips are done, and sorted by output at the end of a run.
    """

    def __init__(self, folder: Path, lock: AbstractContextManager[object]) -> None:
        super().__init__(folder / METRICS, lock)

    def _forget(self) -> None:
        super()._forget()
        self._starts: dict[str, int] = {}  # where each row begins [bytes], by its name

    def _note(self, line: bytes, start: int) -> bool:
        self._starts[_name_in(line)] = start
        return True

    def add(self, output: str, measured: Measured) -> str:
        """Add the row of an output, unless it is there, and return its name; a FileError if that fails.

        The file is locked. It need not be on the disk: the clip of a row that gets lost is retargeted again.
        """
        row = row_of(output, measured)
        self._catch_up()
        head = () if self._has_header() else (HEADER,)
        if (name := _name_in(row)) not in self._starts:
            self._append(*head, row, flush=False)
        return name

    def find(self, name: str) -> Measured | None:
        """Return what the row with this name says; None if there is none."""
        self._catch_up()
        if name in self._starts and not self._line(name):  # another run has sorted the rows
            self._forget()
            self._catch_up()
        return parse_row(self._line(name))

    def _line(self, name: str) -> bytes:
        """The row with this name; empty if it is not where it was."""
        line = next(self._lines_at([self._starts[name]])) if name in self._starts else b""
        return line if _name_in(line) == name else b""

    def sort(self) -> None:
        """Order the rows by output, so that the same clips leave the same file whichever was done first."""
        self._catch_up()
        if not self._starts:
            return
        outputs = map(_output_in, self._lines_at(self._starts.values()))
        order = sorted(zip(outputs, self._starts.items(), strict=True))
        starts = [start for _, (name, start) in order if name != _name_in(HEADER)]
        rows = (row.rstrip(b"\n") + b"\n" for row in self._lines_at(starts))
        write_whole(self.path, chain([HEADER + b"\n"], rows), overwrite=True)
        self._forget()

    def _has_header(self) -> bool:
        """Whether the file begins as this version writes it; one of another version is put aside."""
        if not self.path.exists():
            return False
        with self.path.open("rb") as file:
            first = file.readline()
        if first and first.rstrip(b"\n") != HEADER:
            self.path.replace(self.path.with_suffix(".old.csv"))
            self._forget()
            return False
        return bool(first)


def _name_in(row: bytes) -> str:
    return row.partition(b",")[0].decode("ascii", "replace")


def _output_in(row: bytes) -> bytes:
    content = row.partition(b",")[2]
    return content.partition(b'",' if content.startswith(b'"') else b",")[0]
