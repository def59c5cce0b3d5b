"""The manifest of a folder of results: a line of JSON for each clip, written just before its output is put in place.

An output with the hash in its line is whole, and a batch made it. If it is missing, the run was interrupted between
the two, and the clip is retargeted again.
"""

from __future__ import annotations

import fnmatch
import hashlib
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from operator import itemgetter
from pathlib import Path
from typing import Any, TypedDict, cast

from filelock import FileLock, Timeout

from distretarget.batch.plan import MANIFEST, Clip
from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.errors import FileError, counted
from distretarget.io.files import check_inside, check_writable, make_folder, reason_of
from distretarget.io.map_json import MapFile
from distretarget.measure.metrics import Metric, Variant, metrics_at
from distretarget.pipeline.options import Options
from distretarget.report.index_page import ClipRecord

VERSION = version("distretarget")
LOCK_INTERVAL = 0.005  # time between two attempts to lock the folder [s]
FAILURES = 20  # most failures listed
WORST = 3  # most clips listed as the worst by a metric
MOST = sys.float_info.max  # of a number in a record; JSON may have larger ones
LEAST = 1e-6  # clips with a metric up to this are not listed among the worst
made_from = itemgetter("input_hash", "target_hash", "options", "version")  # what determines an output


class _OfDone(TypedDict, total=False):
    """What the line of a clip that is done has as well.

    Attributes:
        alignment: of the two bodies, as `alignment_text` has it.
        others: the hashes of the other results, by their paths in the folder of results.
        verdict: on the result, in a sentence.
        left_out: why its results were not written, of a clip that fails the condition of `--keep`.
    """

    alignment: str
    others: dict[str, str]
    verdict: str
    left_out: str


class ManifestRecord(ClipRecord, _OfDone):
    """A line of a manifest. Hashes of files are "sha256:" and hexadecimal digits.

    Attributes:
        input_hash: of the clip's file; None if it could not be read.
        output_hash: of the output; None if there is none.
        target_hash: of the target's file.
        options: the fields of `Options`, and `map`: source joints by target joints, None for no map.
        notes: joints of the target without a counterpart, in a line, and which readers refuse the result.
        version: of the program.
    """

    input_hash: str | None
    output_hash: str | None
    target_hash: str
    options: dict[str, Any]
    notes: list[str]
    version: str


KINDS: dict[Any, tuple[str, ...]] = {  # the keys of a record by the kind of their values
    str: ("input", "output", "target", "target_hash", "version"),
    str | None: ("input_hash", "output_hash", "error"),
    int: ("frames",),
    int | float: ("seconds",),
    dict: ("options", "metrics"),
    list: ("notes", "warnings"),
}


def new_record(clip: Clip, options: Mapping[str, object]) -> ManifestRecord:
    """Return the line of a clip that is not done: failed, without a reason; `options` decide its output."""
    return {
        "input": str(clip.path),
        "input_hash": None,
        "output": clip.place.as_posix(),
        "output_hash": None,
        "target": str(clip.target.path),
        "target_hash": clip.target.file.hash if clip.target.file else "",
        "options": dict(options),
        "version": VERSION,
        "frames": 0,
        "seconds": 0.0,
        "metrics": {},
        "notes": [],
        "warnings": [],
        "status": "failed",
        "error": None,
    }


def options_of(options: Options, map_file: MapFile, builds: Builds = OWN_BUILDS) -> dict[str, object]:
    """Return options of retargeting, what a map file says and hashes of builds, as a record has them."""
    pairs: dict[str, object] = {"map": dict(map_file.pairs) or None}
    sides = {"source_build": builds.source, "target_build": builds.target}
    hashes = {side: build.hash for side, build in sides.items() if build is not None}
    return asdict(options) | pairs | hashes | ({"rest": dict(map_file.rest.rotations)} if map_file.rest else {})


def parse_record(line: bytes) -> ManifestRecord | None:
    """Return the record in a line of a manifest; None if it is not a whole record."""
    record = _parsed(line)
    if any(not isinstance(record.get(key, ...), kind) for kind, keys in KINDS.items() for key in keys):
        return None
    sides, others = record["metrics"].values(), record.get("others", {})
    sound = (
        record.get("status") in ("done", "failed")
        and all(isinstance(text, str) for text in (*record["notes"], *record["warnings"]))
        and all(isinstance(record.get(key, ""), str) for key in ("alignment", "verdict", "left_out"))
        and isinstance(others, dict)
        and all(isinstance(text, str) for text in others.values())
        and all(isinstance(side, dict) for side in sides)
        and all(isinstance(number, int | float | None) for side in sides for number in side.values())
        and all(abs(number or 0) <= MOST for side in sides for number in side.values())
        and 0 <= record["frames"] <= MOST
    )
    return cast(ManifestRecord, record) if sound else None


def _parsed(line: bytes) -> dict[str, Any]:
    """The JSON object in a line; empty if there is none."""
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


class Manifest:
    """The manifest in a folder of results, to which several runs may add at the same time.

    Only the places of its lines are kept in memory, so a folder may have many thousand clips.

    Attributes:
        path: of the manifest.
        broken: the numbers of its lines, from 1, that are not records and are ignored.
    """

    def __init__(self, folder: Path, read_only: bool = False) -> None:
        """Read the manifest of a folder. Unless `read_only`, create both if they do not exist, and remove temporary
        files that killed runs have left. Raise a FileError if that fails, or if the file is not a manifest.
        """
        self.path, self.broken = folder / MANIFEST, list[int]()
        lock = FileLock(f"{self.path}.lock", poll_interval=LOCK_INTERVAL)
        self._lock: nullcontext[None] | FileLock = nullcontext() if read_only else lock
        self._size = self._lines = 0  # how much of the file has been read [bytes], [lines]
        self._ends_whole = True
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

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs from writing to the folder; raise a FileError if it cannot be locked."""
        with self._named_errors(), self._lock:
            yield

    def claim(self, output: str) -> bool:
        """Say that this run is at work on an output; return whether no other run is. The claim ends with the run."""
        name = hashlib.sha256(output.encode("utf-8", "surrogatepass")).hexdigest()[:16]
        lock = FileLock(self.path.with_name(f".distretarget-{name}.lock"))
        try:
            lock.acquire(timeout=0)
        except (Timeout, OSError):  # OSError: another user's run is
            return False
        self._claims[output] = lock
        return True

    def release(self, *outputs: str) -> None:
        """Give up the claims to some outputs, or all claims."""
        for output in outputs or tuple(self._claims):
            if lock := self._claims.pop(output, None):
                lock.release()
                with suppress(OSError):
                    Path(lock.lock_file).unlink()

    def is_done(
        self, record: ManifestRecord, output_hash: str | None, others: Mapping[str, str | None] | None = None
    ) -> bool:
        """Return whether the output with this hash was made from the same files in the same way as `record` says, and
        with it the `others`, hashes by paths in the folder of results.
        """
        return self.made(record, output_hash, others or {}) is not None

    def made(
        self, record: ManifestRecord, output_hash: str | None, others: Mapping[str, str | None]
    ) -> ManifestRecord | None:
        """Return the line of an output that is done, as `is_done`; None if it is not."""
        made = self._record_of(record["output"], output_hash)
        if made is None or made_from(made) != made_from(record):
            return None
        of_others = made.get("others", {})
        return made if all(each and of_others.get(name) == each for name, each in others.items()) else None

    def left_out(self, record: ManifestRecord) -> ManifestRecord | None:
        """Return the last line of an output if it was left out, and would be made in the same way; else None."""
        self._catch_up()
        start = self._last.get(record["output"])
        last = None if start is None else next(self._records_at([start]), None)
        return last if last and "left_out" in last and made_from(last) == made_from(record) else None

    def has_made(self, name: str, output_hash: str | None) -> bool:
        """Return whether a batch wrote a file with this hash to this path in the folder of results."""
        self._catch_up()
        return (name, output_hash or "") in self._made

    def check_replaceable(
        self, record: ManifestRecord, path: Path, output_hash: str | None, name: str | None = None
    ) -> None:
        """Raise a FileError if an output may replace the file at `path`, which has this hash, only with --overwrite: no
        batch made it, or one from another clip or target. `name` is its path in the folder of results, if it is not
        that of `record`.
        """
        made = self._record_of(name or record["output"], output_hash)
        if made is None:
            if path.exists():
                check_writable(path)
        elif _is_other(made["input"], record["input"]) or _is_other(made["target"], record["target"]):
            raise FileError(path, f"is the result of {made['input']} onto {made['target']}; --overwrite replaces it")

    def latest(self, clips: Iterable[Clip]) -> Iterator[ManifestRecord]:
        """Yield the last record of each clip, if any, the newest last."""
        self._catch_up()
        places = (clip.place.as_posix() for clip in clips)
        yield from self._records_at(sorted(self._last[place] for place in places if place in self._last))

    def add(self, record: ManifestRecord) -> None:
        """Add a line and flush it to the disk; if that fails, raise a FileError and leave the file as before."""
        line = json.dumps(record, allow_nan=False).encode() + b"\n"
        with self.locked():
            self._catch_up()
            with self.path.open("ab", buffering=0) as file:
                try:
                    line = line if self._ends_whole else b"\n" + line
                    while line:
                        line = line[file.write(line) :]
                    os.fsync(file.fileno())
                except OSError:
                    file.truncate(self._size)
                    raise
            self._catch_up()

    def confirm(self, output: str, output_hash: str) -> None:
        """Repeat the line of an output that is done, if a later line is about a failure or another result."""
        start = self._made[output, output_hash]
        if start != self._last[output]:
            for record in self._records_at([start]):
                self.add(record)

    def _record_of(self, output: str, output_hash: str | None) -> ManifestRecord | None:
        """The last record of the output with this hash, if a batch made it."""
        self._catch_up()
        start = self._made.get((output, output_hash or ""))
        return None if start is None else next(self._records_at([start]), None)

    def _records_at(self, starts: Iterable[int]) -> Iterator[ManifestRecord]:
        with self._named_errors(), self.path.open("rb") as file:
            for start in starts:
                file.seek(start)
                if record := parse_record(file.readline()):
                    yield record

    def _catch_up(self) -> None:
        """Read the lines that this run and others have added since the last call."""
        with self._named_errors():
            if not self.path.exists() or self.path.stat().st_size == self._size:
                return
            with self.locked(), self.path.open("rb") as file:
                file.seek(self._size)
                for line in file:
                    self._note(line)

    def _note(self, line: bytes) -> None:
        self._lines += 1
        if record := parse_record(line):
            self._last[record["output"]] = self._size
            if record["output_hash"]:
                self._made[record["output"], record["output_hash"]] = self._size
                for name, output_hash in record.get("others", {}).items():
                    self._made[name, output_hash] = self._size
        elif line.strip():
            self.broken.append(self._lines)
        self._size += len(line)
        self._ends_whole = line.endswith(b"\n")

    def _check_first_line(self) -> None:
        """Check that the file is a manifest; its first line may be incomplete or have invalid values."""
        if not self.path.is_file():
            raise FileError(self.path, "is not a regular file")
        with self.path.open("rb") as file:
            first = file.readline()
        if first.endswith(b"\n") and first.strip() and not _parsed(first).keys() >= ManifestRecord.__required_keys__:
            raise FileError(self.path, "is not the manifest of a batch; choose another folder for the results")

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Raise an error of the operating system as one of the manifest."""
        try:
            yield
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error


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


@dataclass(kw_only=True)
class Tally:
    """Count the clips of a run by outcome, and remember the worst and the failures.

    Attributes:
        clips: clips in the run.
        done: clips retargeted.
        skipped: clips that an earlier run retargeted.
        failed: clips that could not be retargeted.
        left_out: clips that fail the condition on what is kept.
        warned: clips that are done and need a look.
        frames: frames retargeted.
        workers: processes that did so.
        seconds: the time that took, without the start of the processes [s].
        alignments: what is to be said of the alignments of clips of one rig, a line each.
    """

    clips: int
    done: int = 0
    skipped: int = 0
    failed: int = 0
    left_out: int = 0
    warned: int = 0
    frames: int = 0
    workers: int = 1
    seconds: float = 0.0
    alignments: Sequence[str] = ()
    _worst: dict[Metric, list[ManifestRecord]] = field(default_factory=dict)
    _failures: list[str] = field(default_factory=list)
    _left_out: list[str] = field(default_factory=list)

    def add(self, record: ManifestRecord | None) -> None:
        """Count a clip by its line of the manifest, or None if it was done before."""
        if record is None:
            self.skipped += 1
        elif "left_out" in record:
            self.left_out += 1
            if self.left_out <= FAILURES:
                self._left_out.append(f"  {record['input']}: {record['left_out']}")
        elif record["status"] == "done":
            self.done += 1
            self.frames += record["frames"]
            self.warned += bool(record["warnings"])
            for metric in metrics_at("worst clips"):
                self._worst[metric] = worst([*self._worst.get(metric, ()), record], metric)[:WORST]
        else:
            self.failed += 1
            if self.failed <= FAILURES:
                clip, error = record["input"], record["error"] or "no reason given"
                self._failures.append(f"  {error}" if error.startswith(clip) else f"  {clip}: {error}")

    @property
    def lines(self) -> list[str]:
        """The summary of the run."""
        counts = [f"{self.done} converted", f"{self.skipped} done before", f"{self.failed} failed"]
        if self.left_out:
            counts.append(f"{self.left_out} left out")
        if left := self.clips - self.done - self.skipped - self.failed - self.left_out:
            counts.append(f"{left} left")
        lines = [f"{counted(self.clips, 'clip')}: {', '.join(counts)}"]
        if self.frames:
            frames = "1 frame" if self.frames == 1 else f"{self.frames:,} frames"
            rate = f"{self.frames / self.seconds:,.0f} frames/s with {counted(self.workers, 'job')}"
            lines.append(f"{frames} in {self.seconds:.1f} s, {rate}")
        if self.warned:
            lines.append(f"{self.warned} of {self.done} need a look; the manifest has their warnings")
        for metric, records in self._worst.items():
            bad = [
                f"{one['output']} ({value(one, metric):.3g}, rotation copy {value(one, metric, 'rotation_copy'):.3g})"
                for one in records
                if value(one, metric) > LEAST
            ]
            if bad:
                lines.append(f"worst {metric.label}: {', '.join(bad)}")
        left_out = _listing("left out:", self._left_out, self.left_out)
        return [*lines, *self.alignments, *left_out, *self.failures]

    @property
    def failures(self) -> list[str]:
        """Which clips failed, and why."""
        return _listing("failed:", self._failures, self.failed)


def _listing(title: str, lines: list[str], count: int) -> list[str]:
    """The first lines of `count`, below a title; nothing if there are none."""
    more = count - len(lines)
    return [*([title] if count else []), *lines, *([f"  and {more} more; the manifest has them all"] if more else [])]


def worst(records: Iterable[ManifestRecord], metric: Metric) -> list[ManifestRecord]:
    """Return the lines of clips, those with the largest metric first."""
    return sorted(records, key=lambda record: -value(record, metric))


def value(record: ManifestRecord, metric: Metric, of: Variant = "result") -> float:
    """Return a metric of a clip, 0 where nothing was to be measured."""
    return record["metrics"].get(of, {}).get(metric.key) or 0.0
