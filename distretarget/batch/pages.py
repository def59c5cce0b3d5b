"""What is made of a batch as a whole: the page over all clips, reports on single ones, and tables."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from distretarget.batch.plan import METRICS, PlannedClip, check_page
from distretarget.batch.record import VERSION, BatchRecord
from distretarget.batch.results import Results
from distretarget.batch.summary import worst
from distretarget.batch.table import PARQUET_MARK, PARQUET_TAIL, TABLE_HEAD, TABLES, check_table, is_parquet, table
from distretarget.errors import DistretargetError, FileError
from distretarget.io.files import Content, check_inside, check_writable, is_folder, make_folder, write_whole
from distretarget.io.input_file import load_file
from distretarget.measure.metrics import METRICS as OF_CLIPS
from distretarget.report.diff_document import About
from distretarget.report.page import index_page
from distretarget.report.stage import small_stage

MARK = '<meta name="generator" content="distretarget">'
OF = '<meta name="output" content="{}">'  # the hash of the output that a report is on
PLAYED = 24  # clips that the page over all clips plays
HEAD = 4096  # characters at the beginning of a page that may have MARK and OF


@dataclass(frozen=True)
class Pages:
    """The pages and the table of a batch."""

    about: Callable[[PurePath, PurePath], About]  # what a report says of a clip, from its path and that of its result
    index: Path | None = None  # the page over all clips; None for no pages
    reports: int | None = None  # how many clips get a report beside it, the worst first; None for all
    table: Path | None = None  # of all clips, .csv or .parquet
    problems: dict[Path, FileError] = field(default_factory=dict)  # why a report could not be written, by its path

    def check(self, clips: Sequence[PlannedClip], results: Results, map_path: str | Path) -> None:
        """Raise a BatchError or FileError if page or table cannot be written, or would replace a file of the batch."""
        if self.table:
            check_table(self.table)
        for path in filter(None, (self.index, self.table)):
            check_page(path, clips, results.folder, map_path)
        for path in filter(None, (results.folder / METRICS, self.index, self.table)):
            above = next(each for each in (path, *path.absolute().parents) if os.path.lexists(each))
            if above == path:
                check_writable(path, results.overwrite or self._is_own(path))
            elif not is_folder(above) or not os.access(above, os.W_OK | os.X_OK):
                raise FileError(path, f"nothing can be written to {str(above)!r}")

    def about_at_once(self, clip: PlannedClip) -> About | None:
        """What the report on a clip says, if all clips get one; they are made as clips are retargeted."""
        return self.about(clip.path, PurePath(clip.output)) if self.index and self.reports is None else None

    def without_report(self, records: Sequence[BatchRecord]) -> Iterator[str]:
        """Yield the outputs that are to get a report, and have none on their present content."""
        for record in _worst_done(records)[: self.reports] if self.index else ():
            if not self._has_report(record) and self._report_path(record["output"]) not in self.problems:
                yield record["output"]

    def write_report(self, record: BatchRecord, report: str, results: Results) -> None:
        """Write the report on a clip, if any, or remember why that failed."""
        path = self._report_path(record["output"])
        try:
            if report and self.index:
                check_inside(path, self.index.parent)
                self._write(path, report.replace(MARK, MARK + OF.format(record["output_hash"]), 1), results)
        except FileError as error:
            self.problems[path] = error

    def write(self, records: Sequence[BatchRecord], results: Results) -> None:
        """Write the table of all clips in the folder of results, and of the clips with these records, which are sorted,
        a table and the page; a FileError if that fails.
        """
        metrics = results.folder / METRICS
        check_inside(metrics, results.folder)
        with results.database.untold() as has_news:  # no other run, which has seen less, writes its table later
            if has_news or not metrics.exists():
                self._write(metrics, table(metrics, results.database.latest()), results)
        if self.table:
            self._write(self.table, table(self.table, records), results)
        if self.index:
            paths = {one["output"]: self._report_path(one["output"]) for one in records if self._has_report(one)}
            links = {name: Path(os.path.relpath(path, self.index.parent)).as_posix() for name, path in paths.items()}
            title = f"{len(records)} clips in {results.folder.resolve().name}"
            page = index_page(records, links, title, VERSION, dict(_stages(records, results.folder)))
            self._write(self.index, page, results)

    def _write(self, path: Path, content: Content, results: Results) -> None:
        make_folder(path.parent)
        with results.database.transaction():  # the later of two runs replaces the page of the other
            write_whole(path, content, results.overwrite or self._is_own(path))

    def _is_own(self, path: Path) -> bool:
        """Whether this program wrote a file."""
        if path.suffix.lower() in TABLES:
            return PARQUET_MARK in _tail(path) if is_parquet(path) else _head(path).startswith(TABLE_HEAD)
        return MARK in _head(path)

    def _report_path(self, output: str) -> Path:
        index = self.index or Path()
        return index.parent / f"{index.stem}_reports" / PurePath(output).with_suffix(".html")

    def _has_report(self, record: BatchRecord) -> bool:
        """Whether a clip has a report on its present output, not on an earlier one."""
        return OF.format(record["output_hash"]) in _head(self._report_path(record["output"]))


def _worst_done(records: Iterable[BatchRecord]) -> list[BatchRecord]:
    """The records of clips that are done, the worst first."""
    return worst((record for record in records if record["status"] == "done"), OF_CLIPS[0])


def _stages(records: Sequence[BatchRecord], folder: Path) -> Iterator[tuple[str, object]]:
    """Yield what the page plays, by output: the worst clips, first those with warnings, whose files can be read."""
    for record in sorted(_worst_done(records), key=lambda record: not record["warnings"])[:PLAYED]:
        with suppress(DistretargetError):
            files = load_file(record["input"]), load_file(folder / record["output"])
            yield record["output"], small_stage(files[0], record["options"].get("clip"), files[1])


def _head(path: Path) -> str:
    """The beginning of a text file; empty if it cannot be read, which writing it will report."""
    with suppress(OSError):
        if path.is_file():
            with path.open(encoding="utf-8", errors="replace") as file:
                return file.read(HEAD)
    return ""


def _tail(path: Path) -> bytes:
    """The end of a file, where Parquet has its metadata; empty if it cannot be read."""
    with suppress(OSError), path.open("rb") as file:
        file.seek(max(path.stat().st_size - PARQUET_TAIL, 0))
        return file.read()
    return b""
