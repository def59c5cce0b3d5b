"""The database of a folder of results: what became of each clip, in one SQLite file that several runs may share.

What a clip became is recorded just before its result is put in place. So a result whose hash is recorded is whole, and
a batch made it; if it is missing, the run was interrupted between the two, and the clip is retargeted again.
"""

from __future__ import annotations

import secrets
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import NoReturn

from distretarget.batch.packed import packed, unpacked
from distretarget.batch.plan import DATABASE
from distretarget.batch.record import BatchRecord, results_of
from distretarget.errors import FileError
from distretarget.io.files import check_inside, make_folder

SCHEMA = [
    "CREATE TABLE texts (id INTEGER PRIMARY KEY, text TEXT UNIQUE)",  # that many clips share
    "CREATE TABLE clips (place BLOB, number INTEGER, settings INTEGER, rig INTEGER, clip BLOB, metrics BLOB, "
    "PRIMARY KEY (place, number)) WITHOUT ROWID",
    "CREATE TABLE claims (output BLOB PRIMARY KEY, run TEXT) WITHOUT ROWID",
]
SELECT = (
    "SELECT place, number, s.text, r.text, clip, metrics FROM clips "
    "JOIN texts AS s ON s.id = settings JOIN texts AS r ON r.id = rig"
)
INSERT = (
    "INSERT INTO clips VALUES (?1, (SELECT ifnull(max(number), 0) + 1 FROM clips WHERE place = ?1), "
    "(SELECT id FROM texts WHERE text = ?2), (SELECT id FROM texts WHERE text = ?3), ?4, ?5)"
)
LONGEST_WAIT = 300.0  # for another run that writes; the longest is a table of all clips [s]
REASONS = {
    sqlite3.SQLITE_BUSY: f"another run has been writing for more than {LONGEST_WAIT:g} s; run this again",
    sqlite3.SQLITE_FULL: "the disk is full",
    sqlite3.SQLITE_READONLY: "permission denied to write",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened: is the folder writable?",
    sqlite3.SQLITE_CORRUPT: "is damaged; delete it, and give --overwrite to replace the results",
}


class Database:
    """The database in a folder of results; the newest record of a clip counts.

    Attributes:
        path: of its file.
    """

    def __init__(self, folder: Path, read_only: bool = False) -> None:
        """Open the database of a folder; unless `read_only`, make both if they do not exist.

        Raises:
            FileError: that fails, or the file is not the database of a batch.
        """
        self.path, self._run = folder / DATABASE, secrets.token_hex(4)
        if not read_only:
            make_folder(folder)
            check_inside(self.path, folder)
        if self.path.exists() and not self.path.is_file():
            raise FileError(self.path, "is not a regular file")
        with self._named_errors():
            place = ":memory:" if read_only and not self.path.exists() else self.path
            self._connection = sqlite3.connect(place, timeout=LONGEST_WAIT, isolation_level=None)
            self._do("PRAGMA trusted_schema = OFF")
            if not self._schema:
                with self.transaction():
                    for sql in SCHEMA if not self._schema else ():
                        self._do(sql)
            if self._schema != SCHEMA:
                self._refuse()
            self._do("PRAGMA journal_mode = WAL")
            self._do("PRAGMA synchronous = NORMAL")  # what a power cut takes is made again, and found to be there

    @property
    def _schema(self) -> list[str]:
        return [sql for (sql,) in self._do("SELECT sql FROM sqlite_master WHERE sql NOT NULL ORDER BY rowid")]

    def _refuse(self) -> NoReturn:
        raise FileError(self.path, "is not the database of a batch; choose another folder for the results")

    def _do(self, sql: str, *values: object) -> sqlite3.Cursor:
        return self._connection.execute(sql, values)

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Raise an error of SQLite as one of the file."""
        try:
            yield
        except sqlite3.Error as error:
            code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF  # without what is said beyond it
            if code == sqlite3.SQLITE_NOTADB:
                self._refuse()
            raise FileError(self.path, REASONS.get(code, str(error))) from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Keep other runs from writing; write all that the block does or, if it raises an error, nothing of it.

        Raises:
            FileError: the database cannot be written.
        """
        if self._connection.in_transaction:
            yield
            return
        with self._named_errors():
            self._do("BEGIN IMMEDIATE")
            try:
                yield
                self._do("COMMIT")
            except BaseException:
                self._connection.rollback()
                raise

    def close(self) -> None:
        """Give up all claims, and close the file."""
        with self._named_errors():
            if self._do("SELECT run FROM claims WHERE run = ?", self._run).fetchone():
                self._do("DELETE FROM claims WHERE run = ?", self._run)
            self._connection.close()

    def claim(self, output: str) -> bool:
        """Say that this run is at work on an output; return whether no other run is, or was when it was killed."""
        with self._named_errors():
            return self._do("INSERT OR IGNORE INTO claims VALUES (?, ?)", _bytes(output), self._run).rowcount > 0

    def release(self, output: str) -> None:
        """Say that no run is at work on an output."""
        with self._named_errors():
            self._do("DELETE FROM claims WHERE output = ?", _bytes(output))

    def records(self, output: str) -> list[BatchRecord]:
        """Return what is recorded of an output and of other kinds of results at its place, the newest first."""
        return [record for _, record in self._numbered(output)]

    def _numbered(self, output: str) -> list[tuple[int, BatchRecord]]:
        with self._named_errors():
            rows = self._do(f"{SELECT} WHERE place = ? ORDER BY number DESC", _place(output))
            return [(number, self._unpacked(*parts)) for _, number, *parts in rows]

    def latest(self) -> Iterator[BatchRecord]:
        """Yield the newest record of each clip, those of other runs as well, sorted by place."""
        with self._named_errors():
            for _, rows in groupby(self._do(f"{SELECT} ORDER BY place, number"), lambda row: row[0]):
                records = (self._unpacked(*parts) for _, _, *parts in rows)
                yield from {record["output"]: record for record in records}.values()

    def _unpacked(self, *parts: object) -> BatchRecord:
        try:
            return unpacked(*parts)  # type: ignore[arg-type]
        except ValueError as error:
            raise FileError(self.path, REASONS[sqlite3.SQLITE_CORRUPT]) from error

    def add(self, record: BatchRecord, there: Collection[str | None] = ()) -> None:
        """Record what a clip became. Of its earlier records only those remain of which a result is still there, by the
        hashes of the files in the places of its results.

        Raises:
            FileError: the database cannot be written; then nothing has changed.
        """
        parts = packed(record)
        with self.transaction():
            self._do("PRAGMA user_version = 0")
            for number, old in self._numbered(record["output"]):
                results = results_of(old)
                is_needed = results != results_of(record) and not {*results.values()}.isdisjoint(there)
                if old["output"] == record["output"] and not is_needed:
                    self._do("DELETE FROM clips WHERE place = ? AND number = ?", _place(old["output"]), number)
            for text in parts[:2]:
                self._do("INSERT OR IGNORE INTO texts (text) VALUES (?)", text)
            self._do(INSERT, _place(record["output"]), *parts)

    @contextmanager
    def untold(self) -> Iterator[bool]:
        """Whether anything was added since the block was last left without an error, in a transaction."""
        with self.transaction():
            ((is_told,),) = self._do("PRAGMA user_version")
            yield not is_told
            if not is_told:
                self._do("PRAGMA user_version = 1")

    def confirm(self, record: BatchRecord) -> None:
        """Make a record the newest of its output, if another is."""
        output, results = record["output"], results_of(record)
        newest = next((each for each in self.records(output) if each["output"] == output), None)
        if newest is None or results_of(newest) != results:
            self.add(record, results_of(newest).values() if newest else ())


def _bytes(name: str) -> bytes:
    return name.encode("utf-8", "surrogatepass")


def _place(output: str) -> bytes:
    """The path of a result without its suffix, which all kinds of results of a clip have."""
    return _bytes(output.rpartition(".")[0])
