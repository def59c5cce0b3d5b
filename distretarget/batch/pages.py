"""Write the tables of a batch, CSV or Parquet, the page about all clips, and the reports on single ones."""

from __future__ import annotations

import io
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from distretarget.batch.plan import METRICS, PlannedClip, check_page
from distretarget.batch.results import BatchRecord, Results
from distretarget.errors import DistretargetError, FileError, MissingPackageError
from distretarget.io.files import Content, check_inside, check_writable, is_folder, make_folder, write_whole
from distretarget.io.input_file import load_file
from distretarget.measure.metrics import COLUMNS, as_data
from distretarget.measure.metrics import METRICS as OF_CLIPS
from distretarget.report.diff_document import About, csv_lines
from distretarget.report.page import VERSION, html_page
from distretarget.report.stage import small_stage

TABLES = (".csv", ".parquet")
TEXTS = ("output", "status", "input", "target", "verdict", "warnings", "error")
HASHES = ("input_hash", "target_hash", "output_hash", "version")
TABLE = (*TEXTS, "frames", *HASHES, "notes", *COLUMNS)  # the columns
TABLE_HEAD = ",".join(TEXTS).encode()  # the beginning of a CSV file that a batch wrote
PARQUET_MARK = b"distretarget_version"  # key in the metadata of a Parquet file that a batch wrote
PARQUET_TAIL = 1 << 18  # size of the end of a Parquet file, in which its metadata is [bytes]
SEPARATOR = " | "  # between the warnings, or notes, of a clip
MARK = '<meta name="generator" content="distretarget">'
OUTPUT_MARK = '<meta name="output" content="{}">'  # with the hash of the output that a report is about
PLAYED = 24  # clips in the player of the page about all clips
HEAD = 4096  # size of the beginning of a page, in which MARK and OUTPUT_MARK are looked for [bytes]
ABSOLUTE = re.compile(r"^(?:/|[A-Za-z]:[/\\]|\\\\).*?([^/\\]*[/\\])$", re.DOTALL)  # a folder, and its name
METRIC_COLUMNS = tuple(name for name, (_, one) in COLUMNS.items() if "page over clips" in one.places)
FIELDS = ("clip", "link", "stage", "target", "done", "frames", "seconds", "warnings", "error", *METRIC_COLUMNS)


def check_table(path: Path) -> None:
    """Raise an error if no table can be written to a file of this name."""
    if path.suffix.lower() not in TABLES:
        raise FileError(path, f"the ending says what to write, expected one of {', '.join(TABLES)}")
    if path.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise MissingPackageError(
            "Parquet needs the package pyarrow; install it with `pip install pyarrow`, or write .csv", path
        )


def table(path: Path, records: Iterable[BatchRecord]) -> bytes | Iterator[str]:
    """Return the content of a table with a row for each record; CSV in parts."""
    rows = map(_row, records)
    return _parquet(rows) if path.suffix.lower() == ".parquet" else csv_lines(TABLE, rows)


def _row(record: BatchRecord) -> dict[str, Any]:
    """The row of a clip by column; None for missing values."""
    texts = {name: record.get(name) or None for name in (*TEXTS, *HASHES)}
    lists = {name: SEPARATOR.join(record[name]) or None for name in ("warnings", "notes")}
    metrics = {name: number if number is None else float(f"{number:.7g}") for name, number in record["metrics"].items()}
    return {**texts, "frames": record["frames"], **lists, **metrics}


def _parquet(rows: Iterable[dict[str, Any]]) -> bytes:
    """The rows as Parquet; bytes of texts that are not UTF-8, as in paths, are replaced."""
    import pyarrow
    from pyarrow import parquet

    kinds = {"frames": pyarrow.int64(), **dict.fromkeys(COLUMNS, pyarrow.float64())}
    schema = pyarrow.schema([(name, kinds.get(name, pyarrow.string())) for name in TABLE], {PARQUET_MARK: VERSION})
    valid = [
        {
            name: each.encode("utf-8", "replace").decode() if isinstance(each, str) else each
            for name, each in row.items()
        }
        for row in rows
    ]
    content = io.BytesIO()
    parquet.write_table(pyarrow.Table.from_pylist(valid, schema), content)
    return content.getvalue()


@dataclass(frozen=True)
class Pages:
    """The pages and the table of a batch."""

    results: Results
    about: Callable[[PurePath, PurePath], About]  # for the report on a clip, from its path and its result's
    index: Path | None = None  # the page about all clips; None for no pages
    reports: int | None = None  # how many clips, the worst first, get a report beside it; None for all
    table: Path | None = None  # of all clips, .csv or .parquet
    problems: dict[Path, FileError] = field(default_factory=dict)  # errors of reports that were not written, by path

    def check(self, clips: Sequence[PlannedClip], map_path: str | Path) -> None:
        """Raise a BatchError or FileError if page or table cannot be written, or would replace a file of the batch."""
        if self.table:
            check_table(self.table)
        for path in filter(None, (self.index, self.table)):
            check_page(path, clips, self.results.folder, map_path)
        for path in filter(None, (self.results.folder / METRICS, self.index, self.table)):
            existing = next(each for each in (path, *path.absolute().parents) if os.path.lexists(each))
            if existing == path:
                check_writable(path, self.results.overwrite or self._is_own(path))
            elif not is_folder(existing) or not os.access(existing, os.W_OK | os.X_OK):
                raise FileError(path, f"nothing can be written to {str(existing)!r}")

    def without_report(self, records: Sequence[BatchRecord]) -> Iterator[str]:
        """Yield the outputs that should have a report, but have none on their present content."""
        for record in _worst_done(records)[: self.reports] if self.index else ():
            if not self._has_report(record) and self._report_path(record["output"]) not in self.problems:
                yield record["output"]

    def write_report(self, record: BatchRecord, report: str) -> None:
        """Write the report on a clip, if not empty; an error goes to `problems`."""
        path = self._report_path(record["output"])
        try:
            if report and self.index:
                check_inside(path, self.index.parent)
                self._write(path, report.replace(MARK, MARK + OUTPUT_MARK.format(record["output_hash"]), 1))
        except FileError as error:
            self.problems[path] = error

    def write(self, records: Sequence[BatchRecord]) -> None:
        """Write the table of all clips in the folder, and table and page about the clips with these records."""
        metrics, database = self.results.folder / METRICS, self.results.database
        check_inside(metrics, self.results.folder)
        with database.tabulating() as has_news:  # locks out other runs, whose table might have fewer records
            if has_news or not metrics.exists():
                self._write(metrics, table(metrics, database.latest()))
        if self.table:
            self._write(self.table, table(self.table, records))
        if self.index:
            paths = {one["output"]: self._report_path(one["output"]) for one in records if self._has_report(one)}
            links = {name: Path(os.path.relpath(path, self.index.parent)).as_posix() for name, path in paths.items()}
            title = f"{len(records)} clips in {self.results.folder.resolve().name}"
            page = index_page(records, links, title, dict(_stages(records, self.results.folder)))
            self._write(self.index, page)

    def _write(self, path: Path, content: Content) -> None:
        make_folder(path.parent)
        with self.results.database.transaction():  # of two runs, the later one replaces the page of the other
            write_whole(path, content, self.results.overwrite or self._is_own(path))

    def _is_own(self, path: Path) -> bool:
        """Whether this program wrote a file."""
        match path.suffix.lower():
            case ".csv":
                return _part(path, HEAD).startswith(TABLE_HEAD)
            case ".parquet":
                return PARQUET_MARK in _part(path, -PARQUET_TAIL)
        return MARK.encode() in _part(path, HEAD)

    def _report_path(self, output: str) -> Path:
        index = self.index or Path()
        return index.parent / f"{index.stem}_reports" / PurePath(output).with_suffix(".html")

    def _has_report(self, record: BatchRecord) -> bool:
        """Whether a clip has a report on its present output, not on an earlier one."""
        return OUTPUT_MARK.format(record["output_hash"]).encode() in _part(self._report_path(record["output"]), HEAD)


def _worst_done(records: Iterable[BatchRecord]) -> list[BatchRecord]:
    """The records of clips that are done, the worst first."""
    done = [record for record in records if record["status"] == "done"]
    return sorted(done, key=lambda record: -(record["metrics"].get(OF_CLIPS[0].key) or 0.0))


def _stages(records: Sequence[BatchRecord], folder: Path) -> Iterator[tuple[str, object]]:
    """Yield outputs with the scene that the page plays: the worst clips that can be read, those with warnings first."""
    for record in sorted(_worst_done(records), key=lambda record: not record["warnings"])[:PLAYED]:
        with suppress(DistretargetError):
            files = load_file(record["input"]), load_file(folder / record["output"])
            yield record["output"], small_stage(files[0], record["options"].get("clip"), files[1])


def _part(path: Path, size: int) -> bytes:
    """The beginning of a file, of a negative size its end; empty if it cannot be read: writing it will report why."""
    with suppress(OSError):
        if path.is_file():
            with path.open("rb") as file:
                file.seek(max(path.stat().st_size + size, 0) if size < 0 else 0)
                return file.read(abs(size))
    return b""


def index_page(
    records: Sequence[BatchRecord], links: Mapping[str, str], title: str, stages: Mapping[str, object]
) -> str:
    """The HTML of the page over clips, from their records; `links` to reports, and player data, are by output."""
    table = _index_data(records, links, [*stages])
    data = {"batch": {**table, "version": VERSION}, "registry": as_data("the source", "the result")}
    return html_page("index", title, data | {f"stage-{k}": stage for k, stage in enumerate(stages.values())})


def _index_data(records: Sequence[BatchRecord], links: Mapping[str, str], played: Sequence[str]) -> dict[str, object]:
    """The records in few bytes: folders, targets and warnings once, and for each clip a row of `FIELDS`."""
    targets = list(dict.fromkeys(record["target"] for record in records))
    folder, target_folder = folder_of(record["input"] for record in records), folder_of(targets)
    warnings = list(dict.fromkeys(text for record in records for text in record["warnings"]))
    target_at, warning_at = ({text: k for k, text in enumerate(texts)} for texts in (targets, warnings))
    rows = [
        [
            record["input"][len(folder) :],
            _url(links.get(record["output"])),
            played.index(record["output"]) if record["output"] in played else None,
            target_at[record["target"]],
            *((1, record["frames"], _number(record["seconds"])) if record["status"] == "done" else (0, None, None)),
            [warning_at[text] for text in record["warnings"]],
            _reason(record),
            *(_number(record["metrics"].get(name)) for name in METRIC_COLUMNS),
        ]
        for record in records
    ]
    names = [target[len(target_folder) :] for target in targets]
    shown = ABSOLUTE.sub(r"\1", folder)
    return {"folder": shown, "targets": names, "warnings": warnings, "fields": FIELDS, "rows": rows}


def _number(value: object) -> float | None:
    """A number with six digits, unless it is whole; None for anything else."""
    if isinstance(value, int):
        return value
    return float(f"{value:.6g}") if isinstance(value, float) and math.isfinite(value) else None


def folder_of(paths: Iterable[str]) -> str:
    """Return the common prefix of all paths, up to and including its last slash or backslash."""
    common = os.path.commonprefix(list(paths))  # noqa: RUF071 (by letters, as paths may be of any system)
    return common[: max(common.rfind("/"), common.rfind("\\")) + 1]


def _reason(record: BatchRecord) -> str | None:
    """Why a clip failed, without the names of clip and target, which the page shows anyway."""
    if record["status"] == "done":
        return None
    error = str(record["error"] or "no reason given")
    if error.startswith(f"{record['input']}:"):
        error = re.sub(r"^:(\d+): ", r": line \1: ", error.removeprefix(record["input"])).removeprefix(": ")
    return error.removeprefix(f"{record['target']}: ")


def _url(path: str | None) -> str | None:
    """The relative URL of a path, from the bytes of its name in the file system."""
    if path is None:
        return None
    try:
        return quote(path, errors="surrogateescape")
    except UnicodeEncodeError:  # half characters that stand for no byte, as in names on Windows
        return quote(path, errors="surrogatepass")
