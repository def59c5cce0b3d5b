"""The manifest of a folder of results: a line of JSON for each clip, written before its output is put in place.

So an output that is there and has the hash of its line is whole and is known to be made here; a line whose output is
missing was cut short, and its clip is converted again.
"""

from __future__ import annotations

import contextlib
import fnmatch
import hashlib
import io
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from distretarget.batch.plan import MANIFEST, Work
from distretarget.conversion import Options
from distretarget.errors import FileError
from distretarget.io.files import check_writable, hash_of_file, reason_of
from distretarget.io.map_json import MapFile

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

Record = dict[str, Any]


@dataclass(frozen=True)
class Recipe:
    """What decides an output besides the clip and the target: options, map, and the version of the program."""

    options: Options
    map: MapFile
    version: str

    def as_json(self) -> Record:
        """The options as a line of the manifest has them."""
        return {**asdict(self.options), "map": dict(self.map.pairs) or None}


class Past:
    """What the manifest in a folder of results tells of earlier runs."""

    def __init__(self, folder: Path) -> None:
        """Read the manifest of a folder, if there is one.

        Raises:
            FileError: it is something else, or cannot be read.
        """
        self.path = folder / MANIFEST
        self._last: dict[str, tuple[bytes, str]] = {}
        self._makers: dict[str, dict[str, tuple[str, str]]] = {}
        try:
            _check_ours(self.path)
            for record in read_records(self.path):
                self._learn(record)
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error

    def is_done(self, work: Work, input_hash: str, recipe: Recipe, folder: Path) -> bool:
        """Whether the output of a clip is there, as it was made from the same files in the same way."""
        known = self._last.get(work.place.as_posix())
        return known is not None and known == (
            _digest_of(input_hash, work.target.hash, recipe.as_json(), recipe.version),
            hash_of_file(folder / work.place),
        )

    def check_replaceable(self, work: Work, path: Path, standing: str | None) -> None:
        """Whether what stands at `path`, the place of a clip's output, was made here of the same files; `standing` is
        its hash, None where nothing does or it cannot be read.

        Raises: FileError: it was not, and so is not to be replaced unasked.
        """
        maker = self._makers.get(work.place.as_posix(), {}).get(standing or "")
        if maker is None:
            if path.exists():
                check_writable(path)
        elif _is_other(maker[0], work.clip.path) or _is_other(maker[1], work.target.path):
            raise FileError(path, f"is the result of {maker[0]} onto {maker[1]}; --overwrite replaces it")

    def latest(self, works: Iterable[Work]) -> list[Record]:
        """The last line of each of the clips that has one, with the newest last."""
        wanted = {work.place.as_posix() for work in works}
        found: dict[str, Record] = {}
        for record in read_records(self.path):
            if record["output"] in wanted:
                found.pop(record["output"], None)
                found[record["output"]] = record
        return list(found.values())

    def _learn(self, record: Record) -> None:
        place = record["output"]
        self._last.pop(place, None)
        if record["status"] == "done":
            digest = _digest_of(*(record[name] for name in ("input_hash", "target_hash", "options", "version")))
            self._last[place] = (digest, record["output_hash"])
            files = record["input"], sys.intern(record["target"])
            self._makers.setdefault(place, {})[record["output_hash"]] = files


class Manifest(Past):
    """The manifest in a folder of results, open for adding lines. Several runs may add to it at the same time."""

    def __init__(self, folder: Path) -> None:
        """Open the manifest of a folder, which is made if it is not there.

        Raises:
            FileError: it cannot be, or is something else.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError) as error:
            raise FileError(folder, "is a file or inside one, expected a folder for the results") from error
        except OSError as error:
            raise FileError(folder, reason_of(error)) from error
        super().__init__(folder)
        begun = self.path.exists()
        try:
            self._file = self.path.open("ab", buffering=0)
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error
        self._enter(folder, sweep=begun)

    def close(self) -> None:
        """Close the file, and let go of the folder."""
        self._file.close()

    def add(self, record: Record) -> None:
        """Add a line, at once and for good.

        Raises:
            FileError: there is no room for it; then the file is as before.
        """
        line = json.dumps(record, allow_nan=False).encode() + b"\n"
        with self._alone():
            size = self._file.seek(0, io.SEEK_END)
            try:
                self._append(line if self._ends_whole(size) else b"\n" + line)
            except OSError as error:
                with contextlib.suppress(OSError):
                    self._file.truncate(size)
                raise FileError(self.path, reason_of(error)) from error
        self._learn(record)

    def _append(self, line: bytes) -> None:
        while line:
            line = line[self._file.write(line) :]
        os.fsync(self._file.fileno())

    def _ends_whole(self, size: int) -> bool:
        """Whether the last line was not cut short."""
        if not size:
            return True
        with self.path.open("rb") as file:
            file.seek(size - 1)
            return file.read(1) == b"\n"

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold other runs off the end of the file."""
        if fcntl is None:
            yield
            return
        with contextlib.suppress(OSError):  # not all file systems can
            fcntl.lockf(self._file, fcntl.LOCK_EX)
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                fcntl.lockf(self._file, fcntl.LOCK_UN)

    def _enter(self, folder: Path, sweep: bool) -> None:
        """Show other runs that one is at work in the folder; if none was, remove what one that was killed left."""
        if fcntl is None:
            return
        with contextlib.suppress(OSError):
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for place, folders, files in os.walk(folder) if sweep else ():
                if Path(place) != folder and MANIFEST in files:
                    folders.clear()  # the results of other runs
                    continue
                for name in fnmatch.filter(files, ".distretarget-*.tmp"):
                    Path(place, name).unlink()
        with contextlib.suppress(OSError):
            fcntl.flock(self._file, fcntl.LOCK_SH)


def _check_ours(path: Path) -> None:
    """Leave alone a file of this name that somebody else wrote; a first line that was cut short is none."""
    if path.exists():
        with path.open("rb") as file:
            first = file.readline()
        if first.endswith(b"\n") and first.strip() and _record(first) is None:
            raise FileError(path, "is no manifest of a batch; give the results another folder")


def _is_other(known: str, path: str | Path) -> bool:
    """Whether a path that the manifest has leads to another file than one of now; not if it leads nowhere any more."""
    try:
        return known != str(path) and not Path(known).samefile(path)
    except (OSError, ValueError):
        return False


def _record(line: bytes) -> Record | None:
    """The record in a line, if it is whole."""
    try:
        record = json.loads(line)
    except ValueError:
        return None
    return record if isinstance(record, dict) and record.keys() >= KEYS else None


def read_records(path: Path) -> Iterator[Record]:
    """The lines of a manifest that are whole, in order; none where there is no manifest."""
    if not path.exists():
        return
    with path.open("rb") as file:
        for line in file:
            if (record := _record(line)) is not None:
                yield record


KEYS = {
    "input",
    "input_hash",
    "output",
    "output_hash",
    "target",
    "target_hash",
    "options",
    "version",
    "frames",
    "seconds",
    "figures",
    "warnings",
    "status",
    "error",
}


def record_of(work: Work, input_hash: str | None, recipe: Recipe, **outcome: Any) -> Record:
    """The line for a clip; `outcome` has what came of it."""
    return {
        "input": str(work.clip.path),
        "input_hash": input_hash,
        "output": work.place.as_posix(),
        "output_hash": None,
        "target": str(work.target.path),
        "target_hash": work.target.hash,
        "options": recipe.as_json(),
        "version": recipe.version,
        "frames": 0,
        "seconds": 0.0,
        "figures": {},
        "warnings": [],
        "status": "failed",
        "error": None,
        **outcome,
    }


def _digest_of(input_hash: str, target_hash: str, options: Mapping[str, Any], version: str) -> bytes:
    """What decides an output, in few bytes."""
    text = json.dumps([input_hash, target_hash, options, version], sort_keys=True)
    return hashlib.sha256(text.encode()).digest()[:16]
