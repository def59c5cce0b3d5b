"""The manifest of a folder of results: a line of JSON for each clip, written just before its output is put in place.

An output with the hash in its line is whole, and a batch made it. If it is missing, the run was interrupted between
the two, and the clip is retargeted again.
"""

from __future__ import annotations

import fnmatch
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from distretarget.batch.journal import Journal, MetricRows
from distretarget.batch.plan import MANIFEST
from distretarget.batch.record import ManifestRecord, clip_line, made_from, parse_line, settings_line, whole_record
from distretarget.errors import FileError
from distretarget.io.files import check_inside, check_writable, make_folder
from distretarget.numerics.interrupts import interrupts_held

LOCK_INTERVAL = 0.005  # time between two attempts to lock the folder [s]


class Manifest(Journal):
    """The manifest in a folder of results, to which several runs may add at the same time."""

    def __init__(self, folder: Path, read_only: bool = False) -> None:
        """Read the manifest of a folder. Unless `read_only`, create both if they do not exist, and remove temporary
        files that killed runs have left. Raise a FileError if that fails, or if the file is not a manifest.
        """
        own = FileLock(f"{folder / MANIFEST}.lock", poll_interval=LOCK_INTERVAL)
        super().__init__(folder / MANIFEST, nullcontext() if read_only else own)
        self._rows = MetricRows(folder, self._lock)
        self._settings: dict[str, dict[str, Any]] = {}  # by their names
        self._made: dict[tuple[str, str], int] = {}  # where the line begins [bytes] of each output with each hash
        self._last: dict[str, int] = {}  # where the last line of each output begins [bytes]
        self._claims: dict[str, FileLock] = {}  # of the outputs that this run is at work on
        if not read_only:
            make_folder(folder)
            check_inside(self.path, folder)
        with self._named_errors():
            if self.path.exists():
                self._check_first_line()
        with self.locked():
            self._catch_up()
            if not read_only:
                self.path.touch()
                _remove_temporary_files(folder)

    def claim(self, output: str) -> bool:
        """Say that this run is at work on an output; return whether no other run is. The claim ends with the run."""
        name = hashlib.sha256(output.encode("utf-8", "surrogatepass")).hexdigest()[:16]
        lock = FileLock(self.path.with_name(f".distretarget-{name}.lock"))
        with interrupts_held():  # or the file of a claim that is not noted would stay
            try:
                lock.acquire(timeout=0)
            except (Timeout, OSError):  # OSError: another user's run is
                return False
            self._claims[output] = lock
        return True

    def release(self, *outputs: str) -> None:
        """Give up the claims to some outputs, or all claims."""
        for output in outputs or tuple(self._claims):
            with interrupts_held():
                if lock := self._claims.pop(output, None):
                    lock.release()
                    with suppress(OSError):
                        Path(lock.lock_file).unlink()

    def made(self, record: ManifestRecord, hashes: Mapping[str, str | None]) -> ManifestRecord | None:
        """Return the record of results that are there: made from the same files in the same way as `record` says, with
        these `hashes`, by their paths in the folder of results; None if they are not.
        """
        found = self._record_of(record["output"], hashes[record["output"]])
        if found is None or made_from(found) != made_from(record):
            return None
        known = {found["output"]: found["output_hash"], **found["others"]}
        return found if all(each and known.get(name) == each for name, each in hashes.items()) else None

    def left_out(self, record: ManifestRecord) -> ManifestRecord | None:
        """Return the last record of an output if it was left out, and would be made in the same way; else None."""
        self._catch_up()
        last = self._record_at(self._last.get(record["output"]))
        return last if last and last["left_out"] and made_from(last) == made_from(record) else None

    def has_made(self, name: str, output_hash: str | None) -> bool:
        """Return whether a batch wrote a file with this hash to this path in the folder of results."""
        self._catch_up()
        return (name, output_hash or "") in self._made

    def check_replaceable(self, record: ManifestRecord, name: str, output_hash: str | None) -> None:
        """Raise a FileError if a result may replace the file at a path in the folder of results, which has this hash,
        only with --overwrite: no batch made it, or one from another clip or target.
        """
        path, made = self.path.parent / name, self._record_of(name, output_hash)
        if made is None:
            if path.exists():
                check_writable(path)
        elif _is_other(made["input"], record["input"]) or _is_other(made["target"], record["target"]):
            raise FileError(path, f"is the result of {made['input']} onto {made['target']}; --overwrite replaces it")

    def latest(self, outputs: Iterable[str]) -> Iterator[ManifestRecord]:
        """Yield the last record of each output, if any, the newest last."""
        self._catch_up()
        yield from self._records_at(sorted(self._last[output] for output in outputs if output in self._last))

    def add(self, record: ManifestRecord) -> None:
        """Add what a clip has become, and flush it to the disk; if that fails, raise a FileError and change nothing."""
        with self.locked():
            row = self._rows.add(record["output"], record) if record["metrics"] else ""
            self._catch_up()
            name, settings = settings_line(record)
            self._append(*([] if name in self._settings else [settings]), clip_line(record, name, row))

    def sort_metrics(self) -> None:
        """Order the rows of metrics by output; raise a FileError if that fails."""
        with self.locked():
            self._rows.sort()

    def confirm(self, output: str, output_hash: str) -> None:
        """Repeat the line of an output that is done, if a later line is about a failure or another result."""
        if self._made[output, output_hash] != self._last[output] and (record := self._record_of(output, output_hash)):
            self.add(record)

    def _record_of(self, output: str, output_hash: str | None) -> ManifestRecord | None:
        """The last record of the output with this hash, if a batch made it."""
        self._catch_up()
        return self._record_at(self._made.get((output, output_hash or "")))

    def _record_at(self, start: int | None) -> ManifestRecord | None:
        return None if start is None else next(self._records_at([start]), None)

    def _records_at(self, starts: Iterable[int]) -> Iterator[ManifestRecord]:
        """The records whose lines begin at these places, except those whose row of metrics is damaged or lost."""
        for line in self._lines_at(starts):
            clip = parse_line(line)
            row = clip.get("row") if clip else None
            measured = self._rows.find(row) if row else None
            if clip and bool(row) == bool(measured):
                yield whole_record(clip, self._settings[clip["settings"]], measured)

    def _note(self, line: bytes, start: int) -> bool:
        found = parse_line(line)
        if found and "options" in found:
            self._settings[found["settings"]] = found
        elif found and found["settings"] in self._settings:
            self._last[found["output"]] = start
            for name, output_hash in {found["output"]: found.get("output_hash"), **found.get("others", {})}.items():
                if output_hash:
                    self._made[name, output_hash] = start
        else:
            return False
        return True

    def _check_first_line(self) -> None:
        """Check that the file is a manifest; its first line may be incomplete or have invalid values."""
        if not self.path.is_file():
            raise FileError(self.path, "is not a regular file")
        with self.path.open("rb") as file:
            first = file.readline()
        if first.endswith(b"\n") and first.strip() and not first.startswith(b'{"settings": '):
            raise FileError(self.path, "is not the manifest of a batch; choose another folder for the results")


def _remove_temporary_files(folder: Path) -> None:
    """Remove temporary files, but not in folders of results inside this one: these have their own locks."""
    for inside, folders, files in os.walk(folder):
        if Path(inside) != folder and MANIFEST in files:
            folders.clear()
            continue
        for name in fnmatch.filter(files, ".distretarget-*.tmp"):
            with suppress(OSError):
                Path(inside, name).unlink()


def _is_other(recorded: str, path: str) -> bool:
    """Whether a path in the manifest leads to another file than `path`; False if that file no longer exists."""
    try:
        return recorded != path and not Path(recorded).samefile(path)
    except (OSError, ValueError):
        return False
