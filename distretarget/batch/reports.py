"""The pages of a batch: one over all clips, and beside it reports on some or all of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from distretarget.batch.plan import Work
from distretarget.batch.record import ManifestRecord
from distretarget.batch.run import Run, reports
from distretarget.batch.summary import worst
from distretarget.batch.task import Outcome
from distretarget.errors import FileError
from distretarget.io.files import check_writable, is_folder, make_folder, reason_of, write_whole
from distretarget.measure.figures import FIGURES
from distretarget.report.diff_document import About
from distretarget.report.index_page import index_page

FOLDER = "_reports"  # the folder of the reports on clips is named as the page over all clips, and this
MARK = '<meta name="generator" content="distretarget">'
OF = '<meta name="output" content="{}">'  # the hash of the output that a report is on
HEAD = 4096  # characters at the beginning of a page, in which MARK and OF are looked for


@dataclass(frozen=True, kw_only=True)
class Pages:
    """Where the pages of a batch go.

    Attributes:
        index: the page over all clips.
        most: how many clips get a report, the worst first; None for all.
        overwrite: whether to replace files that this program did not write.
        about: the file names and the command line that the report on a clip shows.
        problems: why a report could not be written, by its path.
    """

    index: Path
    most: int | None
    overwrite: bool
    about: Callable[[Work], About]
    problems: dict[Path, FileError] = field(default_factory=dict)

    def check(self) -> None:
        """Check, before any work, that the page over all clips can be written.

        Raises: FileError: another file is in its place, or its folder cannot be written to.
        """
        try:
            if self.index.exists():
                check_writable(self.index, self._replaceable(self.index))
                return
        except OSError as error:
            raise FileError(self.index, reason_of(error)) from error
        above = next(folder for folder in self.index.absolute().parents if os.path.lexists(folder))
        if not is_folder(above) or not os.access(above, os.W_OK | os.X_OK):
            raise FileError(self.index, f"nothing can be written to {str(above)!r}")

    def path(self, work: Work) -> Path:
        """The path of the report on a clip."""
        return self.index.parent / f"{self.index.stem}{FOLDER}" / work.place.with_suffix(".html")

    def add(self, work: Work, outcome: Outcome) -> None:
        """Write the report on a clip, or remember why that failed."""
        html = outcome.report.replace(MARK, MARK + OF.format(outcome.bvh_hash), 1)
        try:
            self._write(self.path(work), html)
        except FileError as error:
            self.problems[self.path(work)] = error

    def finish(self, run: Run, works: Sequence[Work], records: Iterable[ManifestRecord]) -> None:
        """Make the reports that are missing, and write the page over all clips.

        `records` are the last lines of the manifest for each clip.
        """
        lines = {record["output"]: record for record in records}
        for work, outcome in reports(self._missing(works, lines), run.recipe, self.about, run.pool):
            self.add(work, outcome)
        links = {work.place.as_posix(): self._link(work) for work in works if self._is_there(work, lines)}
        title = f"{len(lines)} clips in {run.folder.resolve().name}"
        self._write(self.index, index_page(list(lines.values()), links, title, run.recipe.version))

    def _missing(self, works: Sequence[Work], lines: dict[str, ManifestRecord]) -> Iterator[Work]:
        """The clips that should have a report and have none."""
        done = [record for record in lines.values() if record["status"] == "done"]
        chosen = {record["output"] for record in worst(done, FIGURES[0])[: self.most]}
        for work in works:
            tried = self.path(work) in self.problems
            if work.place.as_posix() in chosen and not tried and not self._is_there(work, lines):
                yield work

    def _is_there(self, work: Work, lines: Mapping[str, ManifestRecord]) -> bool:
        """Whether there is a report on the output that a clip has now, rather than on an earlier one."""
        record = lines.get(work.place.as_posix())
        try:
            return record is not None and OF.format(record["output_hash"]) in _head(self.path(work))
        except OSError:
            return False  # if the file cannot be read, writing it will fail with the reason

    def _link(self, work: Work) -> str:
        return Path(os.path.relpath(self.path(work), self.index.parent)).as_posix()

    def _write(self, path: Path, html: str) -> None:
        make_folder(path.parent)
        try:
            replaceable = self._replaceable(path)
        except OSError as error:
            raise FileError(path, reason_of(error)) from error
        write_whole(path, html, replaceable)

    def _replaceable(self, path: Path) -> bool:
        """Whether the file there may be replaced: it is a page of this program, or `overwrite` is set."""
        return self.overwrite or MARK in _head(path)


def _head(path: Path) -> str:
    """The beginning of a page; empty if there is no file."""
    if not path.is_file():
        return ""
    with path.open(encoding="utf-8", errors="replace") as file:
        return file.read(HEAD)
