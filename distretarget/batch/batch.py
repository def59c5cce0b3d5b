"""A batch from beginning to end: clips are planned, converted and counted, and the pages on them written."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import NoneType
from typing import Any

from distretarget.batch.clips import find_clips
from distretarget.batch.manifest import Manifest
from distretarget.batch.plan import Work, check_page, plan
from distretarget.batch.pools import Pool, Processes
from distretarget.batch.record import ManifestRecord, Recipe
from distretarget.batch.reports import Pages
from distretarget.batch.run import Run
from distretarget.batch.summary import Tally
from distretarget.batch.task import Outcome
from distretarget.checks import check_kind, check_number, check_path
from distretarget.errors import BatchError
from distretarget.io.files import load_text
from distretarget.io.map_json import load_map
from distretarget.io.target_file import parse_target
from distretarget.numerics.parallel import cores
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.report.document import About

Paths = str | Path | Sequence[str | Path]
Waiting = Callable[[str], Any]
Progress = Callable[[ManifestRecord | None], Any]


def _ignore(_record: ManifestRecord | None) -> None:
    """Show no progress."""


def _wait(_reason: str) -> None:
    """Wait without a word."""


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Clips to convert, and how.

    Attributes:
        works: the clips, each with its target and the place of its output.
        folder: the folder of results.
        recipe: what determines an output besides clip and target.
        pages: the pages to write; None for none.
        overwrite: whether to convert again what is done, and to replace files that no batch made.
        fail_fast: whether the first failure ends the batch.
    """

    works: Sequence[Work]
    folder: Path
    recipe: Recipe
    pages: Pages | None = None
    overwrite: bool = False
    fail_fast: bool = False

    def convert(
        self, manifest: Manifest, pool: Pool, tally: Tally, progress: Progress = _ignore, waiting: Waiting = _wait
    ) -> None:
        """Convert the clips with the workers of `pool`, count them in `tally`, and write the pages.

        `manifest` is that of the folder, `progress` is called with the manifest's line of each clip, or None for a clip
        that was done before, and `waiting` now and then, with the reason, while no results come.

        Raises:
            BatchError: the workers are gone, or a clip failed and `fail_fast` is set.
            FileError: the manifest or the page over all clips cannot be written.
        """
        pages = self.pages
        every_clip = pages.about if pages and pages.most is None else None
        watcher = _Counted(tally, pages, progress, waiting)
        run = Run(
            folder=self.folder,
            recipe=self.recipe,
            manifest=manifest,
            pool=pool,
            watcher=watcher,
            overwrite=self.overwrite,
            fail_fast=self.fail_fast,
            about=every_clip,
        )
        run.go(self.works, sum(work.clip.size for work in self.works))
        if pages:
            pages.finish(run, self.works, manifest.latest(self.works))


@dataclass(frozen=True)
class _Counted:
    """The watcher of a run: counts clips, and writes the reports on them."""

    tally: Tally
    pages: Pages | None
    progress: Progress
    waiting: Waiting

    def clip(self, record: ManifestRecord | None) -> None:
        self.tally.add(record)
        self.progress(record)

    def report(self, work: Work, outcome: Outcome) -> None:
        if self.pages:
            self.pages.add(work, outcome)


def convert_folder(
    sources: Paths,
    targets: Paths,
    folder: str | Path,
    *,
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    map_file: str | Path | None = None,
    options: Options = DEFAULT_OPTIONS,
    jobs: int | None = None,
    overwrite: bool = False,
    fail_fast: bool = False,
    report: str | Path | None = None,
    reports: int | None = 10,
) -> Tally:
    """Convert BVH files and folders of them to one target or several, as `distretarget batch` does.

    Clips that are done and unchanged are skipped, so an interrupted call continues where it stopped. A script that
    calls this needs `if __name__ == "__main__":`, since its processes may import it.

    Args:
        sources: BVH files and folders.
        targets: skeleton files or BVH files; with several targets each gets its own folder in `folder`.
        folder: the folder of results, which has the same tree as the sources.
        include: shell patterns for names or paths of files in folders, of which one must match.
        exclude: shell patterns for files to leave out.
        map_file: a map file, as `--map` takes it.
        options: how to retarget.
        jobs: the number of processes; one for each core if not given.
        overwrite: whether to convert everything again, and to replace files that no batch made.
        fail_fast: whether to stop at the first clip that fails.
        report: an HTML page on all clips to write.
        reports: how many clips get a report beside it, the worst first; None for all.

    Returns:
        The numbers of clips converted, skipped and failed, and `lines` to print.

    Raises:
        BatchError: there is nothing to convert, results would replace clips, or `fail_fast` stopped the batch.
        DistretargetError: a target, the map or the folder of results cannot be used.
        SettingsError: an argument is of another kind, or out of its bounds.
    """
    check_kind("options", options, Options)
    for name, patterns in (("include", include), ("exclude", exclude)):
        check_kind(name, patterns, Sequence)
    for name, number, least in (("jobs", jobs, 1), ("reports", reports, 0)):
        check_kind(name, number, int, NoneType)
        check_number(name, least if number is None else number, least, sys.maxsize)
    check_path("folder", folder)
    paths = _listed("sources", sources)
    found = find_clips(paths, (), include, exclude)
    if found.unread:
        raise found.unread[0]
    texts = [load_text(target) for target in _listed("targets", targets)]
    for text in texts:
        parse_target(text.text, text.path)
    works = plan(found.clips, texts, Path(folder), paths)
    if not works:
        raise BatchError("there are no clips to convert")
    recipe = Recipe(options, load_map(map_file), version("distretarget"))
    pages = Pages(index=Path(report), most=reports, overwrite=overwrite, about=_about) if report else None
    if pages:
        check_page(pages.index, works, Path(folder), Path(map_file) if map_file else None)
        pages.check()
    batch = Batch(
        works=works, folder=Path(folder), recipe=recipe, pages=pages, overwrite=overwrite, fail_fast=fail_fast
    )
    tally = Tally()
    with closing(Processes(jobs or cores(), options.objective)) as pool, closing(Manifest(batch.folder)) as manifest:
        batch.convert(manifest, pool, tally)
    return tally


def _listed(name: str, paths: Paths) -> list[Path]:
    """The paths in an argument that is one or several."""
    several = paths if isinstance(paths, Sequence) and not isinstance(paths, str) else [paths]
    for path in several:
        check_path(name, path)
    return [Path(path) for path in several]


def _about(work: Work) -> About:
    """What a report says of a clip where no command line made it."""
    return About(a=work.clip.path.name, b=work.place.name, command="", version=version("distretarget"))
