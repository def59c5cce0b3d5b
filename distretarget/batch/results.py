"""The folder of results: its database, which results in it are done, and how they are written or merged into one file.

The outcome of a clip is recorded just before its result is written. So a result whose hash is recorded is complete, and
a batch made it; if the result is missing, the run was interrupted between the two, and the clip is retargeted again.
Several runs may share the database, one SQLite file.
"""

from __future__ import annotations

import fnmatch
import json
import os
import secrets
import shutil
import sqlite3
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain, groupby
from operator import itemgetter
from pathlib import Path, PurePath
from typing import Any, Literal, NoReturn, TypedDict, cast

import numpy as np

from distretarget.batch.plan import DATABASE, METRICS, PlannedClip
from distretarget.errors import FileError
from distretarget.io.files import check_inside, check_writable, hash_of, hash_of_file, make_folder, write_whole
from distretarget.io.gltf_writer import Parts
from distretarget.io.input_file import load_file
from distretarget.io.motion_writer import OutputSettings, character_animation, with_animations
from distretarget.io.reading import TargetFile, parse_motion
from distretarget.measure.metrics import COLUMNS
from distretarget.report.page import VERSION

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
LONGEST_WAIT = 300.0  # for another run's transaction; the longest ones write a table of all clips [s]
REASONS = {
    sqlite3.SQLITE_BUSY: f"another run has been writing for more than {LONGEST_WAIT:g} s; run this again",
    sqlite3.SQLITE_FULL: "the disk is full",
    sqlite3.SQLITE_READONLY: "permission denied to write",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened: is the folder writable?",
    sqlite3.SQLITE_CORRUPT: "is damaged; delete it, and give --overwrite to replace the results",
}

made_from = itemgetter("input_hash", "target_hash", "options", "version")  # the values that determine a result
# Keys and defaults of the parts of a packed record.
SETTINGS: dict[str, Any] = {"target": "", "target_hash": "", "options": {}, "version": ""}
RIG: dict[str, Any] = {"notes": [], "alignment": ""}
CLIP: dict[str, Any] = dict.fromkeys(("input", "output", "status", "error", "input_hash", "output_hash", "verdict"), "")
CLIP |= {"frames": 0, "seconds": 0.0, "others": {}, "warnings": []}
MOST_BYTES = 1 << 24  # of an unpacked part; a longer one is damaged
MOST = 1e15  # frames, or seconds
WORDS = (  # the preset dictionary of the compression: texts that most parts contain
    b'"error":"others":{"warnings":["feet skate no more than in the source; "seconds":0.0,"frames":"verdict":"'
    b"There are no self-contacts to keep; feet do not skate; hips height kept within 0.1 % of a leg; largest direction "
    b'error: Left, 0. degrees at frame "input":"output":".bvh","status":"done","input_hash":"sha256:","output_hash":"'
    b"sha256:"
)

Packed = tuple[str, str, bytes, bytes]


class BatchRecord(TypedDict):
    """The outcome of a clip. Hashes of files are "sha256:" and hexadecimal digits.

    Attributes:
        input: path of the clip.
        output: path of the result, relative to the folder of results, with slashes.
        target: path of the target's file.
        frames: number of retargeted frames.
        seconds: time of retargeting [s].
        metrics: by `measure.metrics.COLUMNS`; None where nothing was measured; empty if it failed.
        warnings: a line each.
        status: "done" or "failed".
        error: why it failed; empty if it did not.
        input_hash: of the clip's file; empty if it could not be read.
        output_hash: of the result; empty if there is none.
        others: the hashes of the other results by their paths in the folder of results.
        target_hash: of the target's file.
        options: all settings that influence the result, see `Recipe.settings`.
        version: of the program.
        verdict: on the result, a sentence.
        notes: joints of the target without a source, and which programs cannot read the result, a line each.
        alignment: of the two bodies, see `alignment_text`.
    """

    input: str
    output: str
    target: str
    frames: int
    seconds: float
    metrics: Mapping[str, float | None]
    warnings: list[str]
    status: Literal["done", "failed"]
    error: str
    input_hash: str
    output_hash: str
    others: dict[str, str]
    target_hash: str
    options: dict[str, Any]
    version: str
    verdict: str
    notes: list[str]
    alignment: str


def new_record(clip: PlannedClip, options: Mapping[str, Any], input_hash: str = "") -> BatchRecord:
    """Return the record of a clip before it is done, with the status "failed" and no error."""
    paths = {"input": str(clip.path), "output": clip.output, "target": str(clip.target.path), "input_hash": input_hash}
    target_hash = clip.target.file.hash if clip.target.file else ""
    made_by = {"target_hash": target_hash, "options": dict(options), "version": VERSION}
    empty = deepcopy(SETTINGS | RIG | CLIP)  # records must not share lists
    return cast(BatchRecord, empty | {"metrics": {}, "status": "failed"} | paths | made_by)


def results_of(record: BatchRecord) -> dict[str, str]:
    """Return the hashes of all results of a clip by their paths in the folder of results."""
    return {record["output"]: record["output_hash"], **record["others"]}


def packed(record: BatchRecord) -> Packed:
    """Pack a record: settings, and values of the rig, as JSON that clips share; others and metrics, compressed."""
    values = cast(dict[str, Any], record)
    settings = json.dumps({**{key: values[key] for key in SETTINGS}, "columns": [*COLUMNS]})
    rig = json.dumps({key: values[key] for key in RIG})
    clip = json.dumps({key: values[key] for key in CLIP if values[key]}, separators=(",", ":"))
    measured = record["metrics"]
    numbers = [np.nan if measured.get(name) is None else measured[name] for name in COLUMNS if measured]
    return settings, rig, packed_part(clip.encode()), packed_part(np.array(numbers, "<f4").tobytes())


def unpacked(settings: str, rig: str, clip: bytes, metrics: bytes) -> BatchRecord:
    """Return the record that was packed in these parts; a ValueError if they are damaged."""
    try:
        shared, own = {**_shared(settings, rig)}, _checked(json.loads(_inflated(clip)), CLIP)
        columns = shared.pop("columns")
        numbers = [each if abs(each) < MOST else None for each in np.frombuffer(_inflated(metrics), "<f4").tolist()]
        found = dict(zip(columns if numbers else (), numbers, strict=True))
        return cast(BatchRecord, {**shared, **own, "metrics": found})
    except (TypeError, RecursionError, zlib.error) as error:
        raise ValueError from error


@lru_cache(maxsize=256)
def _shared(settings: str, rig: str) -> Mapping[str, Any]:
    return _checked(json.loads(settings), SETTINGS | {"columns": []}) | _checked(json.loads(rig), RIG)


def _checked(found: object, empty: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a part, completed by defaults; a ValueError if one has the wrong type or is out of bounds."""
    values = {**empty, **found} if isinstance(found, dict) else {}
    for key, default in empty.items():
        value: Any = values.get(key)
        if isinstance(default, int | float):
            is_valid = isinstance(value, int | float) and 0 <= value <= MOST
        else:
            texts = [*value.values()] if key == "others" and isinstance(value, dict) else value
            is_text = not isinstance(texts, list) or all(isinstance(each, str) for each in texts)
            is_valid = type(value) is type(default) and is_text
        if not is_valid:
            raise ValueError(f"{key} cannot be {value!r}")
    return values


def packed_part(content: bytes) -> bytes:
    """Return the content of a part, compressed."""
    pack = zlib.compressobj(9, wbits=-zlib.MAX_WBITS, zdict=WORDS)  # raw: saves a header of six bytes
    return pack.compress(content) + pack.flush()


def _inflated(content: bytes) -> bytes:
    unpack = zlib.decompressobj(-zlib.MAX_WBITS, zdict=WORDS)
    found = unpack.decompress(content, MOST_BYTES)
    if not unpack.eof:
        raise ValueError("is not whole")
    return found


class Database:
    """The database in a folder of results, in which the newest record of a clip is the valid one."""

    def __init__(self, folder: Path, read_only: bool = False) -> None:
        """Open a folder's database; unless `read_only`, make both. A FileError if the file is no batch's database."""
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
            self._do("PRAGMA synchronous = NORMAL")  # records that a power cut loses are made again

    @property
    def _schema(self) -> list[str]:
        return [sql for (sql,) in self._do("SELECT sql FROM sqlite_master WHERE sql NOT NULL ORDER BY rowid")]

    def _refuse(self) -> NoReturn:
        raise FileError(self.path, "is not the database of a batch; choose another folder for the results")

    def _do(self, sql: str, *values: object) -> sqlite3.Cursor:
        return self._connection.execute(sql, values)

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Turn errors of SQLite into FileErrors."""
        try:
            yield
        except sqlite3.Error as error:
            code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF  # the primary result code
            if code == sqlite3.SQLITE_NOTADB:
                self._refuse()
            raise FileError(self.path, REASONS.get(code, str(error))) from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Keep other runs from writing, and commit the block's changes; none of them if it raises an error."""
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
        """Claim an output for this run; return False if another run, alive or killed, has already claimed it."""
        with self._named_errors():
            return self._do("INSERT OR IGNORE INTO claims VALUES (?, ?)", _bytes(output), self._run).rowcount > 0

    def release(self, output: str) -> None:
        """Give up the claim on an output, whichever run made it."""
        with self._named_errors():
            self._do("DELETE FROM claims WHERE output = ?", _bytes(output))

    def records(self, output: str) -> list[BatchRecord]:
        """Return the records of outputs with this path, except for the suffix, the newest first."""
        return [record for _, record in self._numbered(output)]

    def _numbered(self, output: str) -> list[tuple[int, BatchRecord]]:
        with self._named_errors():
            rows = self._do(f"{SELECT} WHERE place = ? ORDER BY number DESC", _place(output))
            return [(number, self._unpacked(*parts)) for _, number, *parts in rows]

    def latest(self) -> Iterator[BatchRecord]:
        """Yield the newest record of each clip, of all runs, sorted by path."""
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
        """Add the record of a clip and delete its earlier ones, but those of results that still exist, by `there`."""
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
    def tabulating(self) -> Iterator[bool]:
        """A transaction in which a table of all records is written; True if records were added since the last one."""
        with self.transaction():
            ((is_current,),) = self._do("PRAGMA user_version")
            yield not is_current
            if not is_current:
                self._do("PRAGMA user_version = 1")

    def confirm(self, record: BatchRecord) -> None:
        """Make a record the newest of its output, unless it is."""
        output, results = record["output"], results_of(record)
        newest = next((each for each in self.records(output) if each["output"] == output), None)
        if newest is None or results_of(newest) != results:
            self.add(record, results_of(newest).values() if newest else ())


def _bytes(name: str) -> bytes:
    return name.encode("utf-8", "surrogatepass")


def _place(output: str) -> bytes:
    """The path of a result without its suffix, which all results of a clip share."""
    return _bytes(output.rpartition(".")[0])


@dataclass(frozen=True)
class Results:
    """A folder of results."""

    folder: Path
    overwrite: bool = False  # whether to make all results again, and to replace files that no batch made
    read_only: bool = False  # whether to write nothing, not even a database

    @cached_property
    def database(self) -> Database:
        """The database; unless `read_only`, the first use makes folder and database."""
        database = Database(self.folder, self.read_only)
        if not self.read_only:
            with database.transaction():  # no other run is writing a file now
                _remove_temporary_files(self.folder)
        return database

    def known(self, record: BatchRecord, outputs: Sequence[str]) -> BatchRecord | None:
        """Return the record of the results if they exist and were made as `record` says, as the newest; else None."""
        hashes = [(name, hash_of_file(self.folder / name)) for name in outputs] if not self.overwrite else []
        if not hashes or not all(each for _, each in hashes):
            return None
        for older, found in enumerate(self.database.records(outputs[0])):
            made = results_of(found)
            if made_from(found) == made_from(record) and all(made.get(name) == each for name, each in hashes):
                if older and not self.read_only:
                    self.database.confirm(found)
                return found
        return None

    def check_replaceable(self, record: BatchRecord, name: str) -> None:
        """Raise a FileError if replacing a result needs --overwrite: no batch made it, or from other files."""
        path = self.folder / name
        if self.overwrite or not os.path.lexists(path):
            return
        there = hash_of_file(path)
        records = chain(*map(self.database.records, (record["output"], name) if there else ()))
        made = next((each for each in records if results_of(each).get(name) == there), None)
        if made is None:
            check_writable(path)
        elif _is_other(made["input"], record["input"]) or _is_other(made["target"], record["target"]):
            raise FileError(path, f"is the result of {made['input']} onto {made['target']}; --overwrite replaces it")

    def add(self, record: BatchRecord, outputs: Sequence[str]) -> None:
        """Add the record of a clip whose results belong to these paths; a FileError if that fails."""
        self.database.add(record, {hash_of_file(self.folder / name) for name in outputs} - {None})

    def put(self, record: BatchRecord, contents: Mapping[str, Parts]) -> BatchRecord:
        """Write a clip's results by path, the first last; return its record. A FileError leaves the first as it was."""
        first, *others = contents
        hashes = {name: hash_of(*parts) for name, parts in contents.items()}
        record = {**record, "output_hash": hashes[first], "others": {name: hashes[name] for name in others}}
        for name in contents:
            check_inside(self.folder / name, self.folder)
        make_folder((self.folder / first).parent)
        self.add(record, [*contents])  # before writing: if this run is killed, the next one recognises the results
        with self.database.transaction():
            for name in (*others, first):
                if hash_of_file(self.folder / name) != hashes[name]:  # else another run was faster
                    self.check_replaceable(record, name)
                    write_whole(self.folder / name, contents[name], overwrite=True)
            self.database.confirm(record)
        return record


def _remove_temporary_files(folder: Path) -> None:
    """Remove temporary files, but not in nested folders of results, which other runs may be writing to."""
    for inside, folders, files in os.walk(folder):
        if Path(inside) != folder and DATABASE in files:
            folders.clear()
            continue
        for name in fnmatch.filter(files, ".distretarget-*.tmp"):
            with suppress(OSError):
                Path(inside, name).unlink()


def _is_other(recorded: str, path: str) -> bool:
    """Whether a recorded path leads to another file than `path`; False if that file no longer exists."""
    try:
        return recorded != path and not Path(recorded).samefile(path)
    except (OSError, ValueError):
        return False


def clips_folder(path: Path) -> Path:
    """Return the folder beside a merged file with its clips as BVH until it is written, to continue if interrupted."""
    return path.with_name(f"{path.name}.clips")


def write_merged(
    path: Path, target: TargetFile, clips: Sequence[PlannedClip], settings: OutputSettings, overwrite: bool
) -> int:
    """Write a character file with an animation for each clip that is done, by name; return their number. If all are
    done, the folder of clips is deleted, and the table of metrics moved beside the file. A DistretargetError if that
    fails.
    """
    folder = clips_folder(path)
    done = [PurePath(clip.output) for clip in clips if (folder / clip.output).is_file()]
    animations = []
    for place in sorted(done, key=lambda place: place.with_suffix("")):
        motion, _ = parse_motion(load_file(folder / place))
        animations.append(character_animation(target, settings.clip(motion, place.with_suffix("").as_posix())))
    write_whole(path, with_animations(path, target, animations, settings.animations), overwrite)
    if len(done) == len(clips):
        with suppress(OSError):
            (folder / METRICS).replace(path.with_name(f"{path.name}.{METRICS}"))
        shutil.rmtree(folder, ignore_errors=True)
    return len(animations)
