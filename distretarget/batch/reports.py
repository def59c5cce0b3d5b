"""The pages of a batch: one over all clips, and reports on some or all of them beside it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from distretarget.batch.manifest import Record
from distretarget.batch.plan import Work
from distretarget.batch.run import Run, reports
from distretarget.batch.summary import worst
from distretarget.errors import FileError
from distretarget.files import is_folder, reason_of, write_whole
from distretarget.report import About
from distretarget.report.index import index_page

FOLDER = "reports"  # beside the page over all clips
MARK = '<meta name="generator" content="distretarget">'
HEAD = 4096  # characters of a page in which it says what made it
RANKED = "contact_error"  # by which clips are worst


@dataclass(frozen=True)
class Pages:
    """Where the pages of a batch go.

    Attributes:
        index: the page over all clips.
        most: how many clips get a report, the worst first; None for all.
        overwrite: whether files that are no such pages are replaced.
        about: what the report on a clip says of it.
    """

    index: Path
    most: int | None
    overwrite: bool
    about: Callable[[Work], About]

    def check(self) -> None:
        """Find out, before any work, whether the page over all clips may be written.

        Raises: FileError: something else is there.
        """
        if is_folder(self.index):
            raise FileError(self.index, "is a folder, expected the name of a file")
        try:
            refused = self.index.exists() and not self._replaceable(self.index)
        except OSError as error:
            raise FileError(self.index, reason_of(error)) from error
        if refused:
            raise FileError(self.index, "exists already; --overwrite replaces it")

    def path(self, work: Work) -> Path:
        """Where the report on a clip goes."""
        return self.index.parent / FOLDER / work.place.with_suffix(".html")

    def add(self, work: Work, html: str) -> None:
        """Write the report on a clip.

        Raises: FileError: it cannot be written, or something else is there.
        """
        self._write(self.path(work), html)

    def finish(self, run: Run, works: Sequence[Work], records: Iterable[Record]) -> None:
        """Make the reports that are wanted and not there, and write the page over all clips.

        `records` has the last line of the manifest for each clip.
        """
        lines = {record["output"]: record for record in records}
        for work, html in reports(self._missing(works, lines), run.recipe, self.about, run.pool):
            self.add(work, html)
        links = {work.place.as_posix(): self._link(work) for work in works if self.path(work).exists()}
        title = f"{len(lines)} clips in {run.folder.resolve().name}"
        self._write(self.index, index_page(list(lines.values()), links, title, run.recipe.version))

    def _missing(self, works: Sequence[Work], lines: dict[str, Record]) -> Iterator[Work]:
        """The clips whose reports are to be made: of all, those without one; of the worst, all, as they may change."""
        done = [record for record in lines.values() if record["status"] == "done"]
        chosen = {record["output"] for record in worst(done, RANKED)[: self.most]}
        for work in works:
            if work.place.as_posix() in chosen and (self.most is not None or not self.path(work).exists()):
                yield work

    def _link(self, work: Work) -> str:
        return Path(os.path.relpath(self.path(work), self.index.parent)).as_posix()

    def _write(self, path: Path, html: str) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            replaceable = self._replaceable(path)
        except OSError as error:
            raise FileError(path, reason_of(error)) from error
        write_whole(path, html, replaceable)

    def _replaceable(self, path: Path) -> bool:
        """Whether what is there is such a page, or anything may be replaced."""
        if self.overwrite or not path.exists():
            return self.overwrite
        with path.open(encoding="utf-8", errors="replace") as file:
            return MARK in file.read(HEAD)
