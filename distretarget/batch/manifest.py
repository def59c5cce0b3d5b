"""The manifest of a folder of results: a line of JSON for each clip, written just before its output is put in place.

An output that has the hash of its line is whole and was made by a batch. If the output of a line is missing, the run
was interrupted between the two, and the clip is converted again.
"""

from __future__ import annotations

import contextlib
import fnmatch
import hashlib
import io
import json
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from distretarget.batch.plan import MANIFEST, Work
from distretarget.batch.record import ManifestRecord, Recipe, RecordedOptions, is_of_manifest, read_records
from distretarget.errors import FileError
from distretarget.io.files import check_inside, check_writable, hash_of_file, make_folder, reason_of

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


class History:
    """The earlier runs into a folder of results, read from its manifest.

    Attributes:
        path: the path of the manifest.
        broken: the numbers of its lines, from 1, that are not records. They are not used: the clips that they are about
            count as not converted.
    """

    def __init__(self, folder: Path) -> None:
        """Read the manifest of a folder, if there is one.

        Raises:
            FileError: the file is not a manifest, or cannot be read.
        """
        self.path = folder / MANIFEST
        self.broken: list[int] = []
        self._last: dict[str, tuple[bytes, str]] = {}
        self._makers: dict[str, dict[str, tuple[str, str]]] = {}
        self._failed: set[str] = set()
        try:
            _check_is_manifest(self.path)
            self._size = self.path.stat().st_size if self.path.exists() else 0  # how much has been read [bytes]
            for record in read_records(self.path, self.broken.append):
                self._remember(record)
            self._hidden = self._done_before_failing()
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error

    def is_done(self, work: Work, input_hash: str, recipe: Recipe, folder: Path) -> bool:
        """Return whether the output of a clip exists as a batch made it from the same files in the same way."""
        last = self._last.get(work.place.as_posix())
        return last is not None and last == (
            _digest_of(input_hash, work.target.hash, recipe.recorded(), recipe.version),
            hash_of_file(folder / work.place),
        )

    def check_replaceable(self, work: Work, path: Path, existing_hash: str | None) -> None:
        """Check that the file at `path`, if there is one, may be replaced by a clip's output without --overwrite.

        It may if a batch made it from the same clip and target. `existing_hash` is the hash of the file, None where it
        does not exist or cannot be read.

        Raises:
            FileError: the file must not be replaced.
        """
        maker = self._makers.get(work.place.as_posix(), {}).get(existing_hash or "")
        if maker is None:
            if path.exists():
                check_writable(path)
        elif _is_other(maker[0], work.clip.path) or _is_other(maker[1], work.target.path):
            raise FileError(path, f"is the result of {maker[0]} onto {maker[1]}; --overwrite replaces it")

    def latest(self, works: Iterable[Work]) -> list[ManifestRecord]:
        """Return the last record of each clip that has one, the newest last."""
        wanted = {work.place.as_posix() for work in works}
        records: dict[str, ManifestRecord] = {}
        for record in read_records(self.path):
            if record["output"] in wanted:
                records.pop(record["output"], None)
                records[record["output"]] = record
        return list(records.values())

    def _remember(self, record: ManifestRecord) -> None:
        """Keep what decides whether a clip is done and whether its output may be replaced."""
        place = record["output"]
        self._failed.add(place)
        if record["status"] == "done" and (output_hash := record["output_hash"]):
            made_from = record["input_hash"], record["target_hash"], record["options"], record["version"]
            self._failed.discard(place)
            self._last[place] = (_digest_of(*made_from), output_hash)
            files = record["input"], sys.intern(record["target"])
            self._makers.setdefault(place, {})[output_hash] = files

    def _done_before_failing(self) -> dict[str, ManifestRecord]:
        """By output, the last record of a conversion, for the clips that failed in a later run."""
        failed = self._failed & self._last.keys()
        records = read_records(self.path) if failed else ()
        return {record["output"]: record for record in records if record["output"] in failed and record["output_hash"]}


class Manifest(History):
    """The manifest in a folder of results, open for adding lines. Several runs may add to it at the same time."""

    def __init__(self, folder: Path) -> None:
        """Open the manifest of a folder; create both if they do not exist.

        Raises:
            FileError: the file is not a manifest, or one of the two cannot be created or opened.
        """
        make_folder(folder)
        check_inside(folder / MANIFEST, folder)
        super().__init__(folder)
        existed = self.path.exists()
        try:
            self._file = self.path.open("ab", buffering=0)
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error
        self._register(folder, clean_up=existed)

    def close(self) -> None:
        """Close the file, which also ends the registration of this run."""
        self._file.close()

    def catch_up(self) -> None:
        """Take note of what other runs have added to the manifest.

        Raises:
            FileError: the file cannot be read.
        """
        with self._locked():
            size = self._file.seek(0, io.SEEK_END)
        try:
            for record in read_records(self.path, start=self._size) if size > self._size else ():
                self._remember(record)
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error
        self._size = size

    def add(self, record: ManifestRecord) -> None:
        """Add a line and flush it to the disk.

        Raises:
            FileError: the line cannot be written, if the disk is full for example; then the file is as before.
        """
        line = json.dumps(record, allow_nan=False).encode() + b"\n"
        with self._locked():
            size = self._file.seek(0, io.SEEK_END)
            try:
                self._append(line if self._ends_whole(size) else b"\n" + line)
            except OSError as error:
                with contextlib.suppress(OSError):
                    self._file.truncate(size)
                raise FileError(self.path, reason_of(error)) from error
        self._remember(record)

    def confirm(self, work: Work) -> None:
        """Let the last line of a clip that is done be that of its output, after a failure in between.

        Raises:
            FileError: the line cannot be written.
        """
        if record := self._hidden.pop(work.place.as_posix(), None):
            self.add(record)

    def _append(self, line: bytes) -> None:
        while line:
            line = line[self._file.write(line) :]
        os.fsync(self._file.fileno())

    def _ends_whole(self, size: int) -> bool:
        """Whether the last line of a manifest of `size` bytes is complete."""
        if not size:
            return True
        with self.path.open("rb") as file:
            file.seek(size - 1)
            return file.read(1) == b"\n"

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """Lock the file against other runs that add lines."""
        if fcntl is None:
            yield
            return
        with contextlib.suppress(OSError):  # not all file systems have locks
            fcntl.lockf(self._file, fcntl.LOCK_EX)
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                fcntl.lockf(self._file, fcntl.LOCK_UN)

    def _register(self, folder: Path, clean_up: bool) -> None:
        """Show other runs that this one uses the folder; if no other does, remove temporary files of killed runs."""
        if fcntl is None:
            return
        with contextlib.suppress(OSError):
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for place, folders, files in os.walk(folder) if clean_up else ():
                if Path(place) != folder and MANIFEST in files:
                    folders.clear()  # a folder of results inside this one, which belongs to other runs
                    continue
                for name in fnmatch.filter(files, ".distretarget-*.tmp"):
                    Path(place, name).unlink()
        with contextlib.suppress(OSError):
            fcntl.flock(self._file, fcntl.LOCK_SH)


def _check_is_manifest(path: Path) -> None:
    """Check that a file with the manifest's name, if there is one, is a manifest; an incomplete first line may be."""
    if path.exists():
        with path.open("rb") as file:
            first = file.readline()
        if first.endswith(b"\n") and first.strip() and not is_of_manifest(first):
            raise FileError(path, "is not the manifest of a batch; choose another folder for the results")


def _is_other(recorded: str, path: str | Path) -> bool:
    """Whether a path in the manifest leads to another file than `path`; False if the recorded file no longer exists."""
    try:
        return recorded != str(path) and not Path(recorded).samefile(path)
    except (OSError, ValueError):
        return False


def _digest_of(input_hash: str | None, target_hash: str, options: RecordedOptions, version: str) -> bytes:
    """A hash of everything that determines an output, 16 bytes."""
    text = json.dumps([input_hash, target_hash, options, version], sort_keys=True)
    return hashlib.sha256(text.encode()).digest()[:16]
