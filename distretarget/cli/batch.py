"""`distretarget batch`: retarget many clips."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from importlib.metadata import version
from pathlib import Path
from types import TracebackType

import click
from tqdm import tqdm

from distretarget.batch.batch import Batch
from distretarget.batch.clips import FoundClips, find_clips
from distretarget.batch.manifest import History, Manifest
from distretarget.batch.plan import Work, check_page, plan
from distretarget.batch.pools import Cluster, Pool, Processes
from distretarget.batch.record import ManifestRecord, Recipe
from distretarget.batch.reports import Pages
from distretarget.batch.summary import Tally
from distretarget.cli.options import of_reports, retargeting
from distretarget.cli.outputs import STANDARD, about, complain, is_quiet, quiet, say
from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.files import Text, hash_of, hash_of_file, is_folder, load_text, read_bytes
from distretarget.io.map_json import load_map
from distretarget.io.target_file import parse_target
from distretarget.measure.figures import FIGURES
from distretarget.numerics.parallel import cores
from distretarget.pipeline.options import Options

INTERRUPTED = 130  # exit status


@click.command("batch")
@click.argument("sources", nargs=-1, metavar="SOURCES... TARGET", type=click.Path(path_type=Path))
@click.option("-o", "--output", "folder", required=True, type=click.Path(path_type=Path), help="The folder of results.")
@click.option(
    "--target",
    "targets",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A target; all arguments are sources then. Several targets may be given; each gets its own folder of results.",
)
@click.option(
    "--include",
    multiple=True,
    metavar="GLOB",
    help="Convert only files whose name or path in the folder matches; with a / at the end, files in such folders.",
)
@click.option(
    "--exclude",
    multiple=True,
    metavar="GLOB",
    help="Leave out files whose name or path in the folder matches; with a / at the end, files in such folders.",
)
@click.option(
    "--input-list",
    type=click.File(encoding="utf-8-sig", errors="surrogateescape"),
    metavar="FILE",
    help="Read the paths of clips from this file, one per line; - is standard input.",
)
@retargeting
@click.option(
    "--jobs",
    type=click.IntRange(1),
    metavar="N",
    help="The number of processes that convert. Default: one for each core that may be used.",
)
@click.option("--dask", metavar="ADDRESS", help="Convert on the Dask cluster with this scheduler: tcp://HOST:PORT.")
@click.option("--overwrite", is_flag=True, help="Convert everything again, and replace files that no batch made.")
@click.option("--fail-fast", is_flag=True, help="Stop at the first clip that fails.")
@click.option(
    "--report",
    "index",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write an HTML page on all clips to this file; reports on single clips go to a folder beside it.",
)
@click.option(
    "--reports",
    type=of_reports,
    default="worst:10",
    show_default=True,
    metavar="WHICH",
    help="With --report, the clips that get a report of their own: worst:N for the N with the largest "
    f"{FIGURES[0].label}, all or none.",
)
@click.option("--dry-run", is_flag=True, help="Print what would be done, and do nothing.")
@quiet
def batch_command(
    sources: tuple[Path, ...],
    folder: Path,
    targets: tuple[Path, ...],
    include: tuple[str, ...],
    exclude: tuple[str, ...],
    input_list: Iterator[str] | None,
    map_path: Path | None,
    options: Options,
    jobs: int | None,
    dask: str | None,
    overwrite: bool,
    fail_fast: bool,
    index: Path | None,
    reports: int | None,
    dry_run: bool,
) -> None:
    """Convert many clips to one or several targets.

    SOURCES are BVH files and folders; results keep the tree of each folder. Clips that are done and unchanged are
    skipped, so an interrupted run continues where it stopped; clips that failed are tried again. manifest.jsonl in the
    folder of results has a line for each clip.

    \b
    distretarget batch mocap hero.json -o mocap_hero
    distretarget batch mocap --target hero.json --target child.json -o converted
    find mocap -name '*walk*.bvh' | distretarget batch hero.json -o walks --input-list -
    """  # noqa: D301
    target_texts, sources = _targets(sources, tuple(dict.fromkeys(targets)))
    lines = dict.fromkeys(line.rstrip("\r\n") for line in input_list or () if line.strip())
    listed = [Path(line) for line in lines]
    if not sources and input_list is None:
        raise click.UsageError("no sources; expected files, folders or --input-list.")
    if jobs and dask is not None:
        raise click.UsageError("--jobs sets the processes of this machine; give either --jobs or --dask.")
    if STANDARD in sources:
        raise click.UsageError("results are named after their sources, and standard input has no name; give a file.")
    if missing := [source for source in sources if not os.path.lexists(source)]:
        raise click.UsageError(f"{missing[0]}: there is no such file or folder.")
    found = find_clips(sources, listed, include, exclude)
    recipe = Recipe(options, load_map(map_path), version("distretarget"))
    works = _planned(found, target_texts, folder, sources)
    if dry_run:
        _print_plan(works, folder, recipe, overwrite)
        _print_unread(found)
        return
    if not works:
        _print_unread(found)
        raise BatchError("there are no clips to convert")
    pages = (
        Pages(index=index, most=reports, overwrite=overwrite, about=lambda work: about(work.clip.path, work.place))
        if index
        else None
    )
    if pages:
        check_page(pages.index, works, folder, map_path)
        pages.check()
    batch = Batch(works=works, folder=folder, recipe=recipe, pages=pages, overwrite=overwrite, fail_fast=fail_fast)
    pool: Pool = Cluster(dask) if dask is not None else Processes(jobs or cores(), options.objective)
    with closing(pool), closing(Manifest(folder)) as manifest, Progress(len(works)) as progress:
        _print_broken(manifest)
        stopped, status = _convert(batch, manifest, pool, progress)
    for line in progress.tally.lines(len(works), progress.seconds - pool.start_seconds, pool.workers):
        say(line)
    for line in progress.tally.failure_lines() if is_quiet() else ():
        complain(line)
    _print_unread(found)
    problems = pages.problems if pages else {}
    for problem in problems.values():
        complain(f"no report: {problem}")
    if stopped:
        complain(f"distretarget: {stopped}")
    sys.exit(status or int(bool(progress.tally.failed or found.unread or problems)))


def _targets(sources: tuple[Path, ...], targets: tuple[Path, ...]) -> tuple[list[Text], tuple[Path, ...]]:
    """Read the targets, and return them with the remaining arguments, the sources."""
    if not targets:
        if not sources:
            raise click.UsageError("expected SOURCES... TARGET.")
        targets, sources = sources[-1:], sources[:-1]
        if is_folder(targets[0]):
            raise click.UsageError(f"{targets[0]} is a folder; the last argument is the target, or give --target.")
    target_texts = [load_text(target) for target in targets]
    for target in target_texts:
        parse_target(target.text, target.path)
    return target_texts, tuple(dict.fromkeys(sources))


def _planned(found: FoundClips, targets: Sequence[Text], folder: Path, sources: Sequence[Path]) -> list[Work]:
    try:
        return plan(found.clips, targets, folder, sources)
    except BatchError as error:
        raise click.UsageError(str(error)) from error


def _convert(batch: Batch, manifest: Manifest, pool: Pool, progress: Progress) -> tuple[str, int]:
    """Convert the clips; return why the batch was stopped and the exit status for that; empty and 0 if it was not."""
    try:
        batch.convert(manifest, pool, progress.tally, progress.show, _say_waiting)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the summary is left to print
        return "interrupted; run this again to go on", INTERRUPTED
    except (BatchError, FileError) as error:
        return str(error), 1
    return "", 0


def _say_waiting(reason: str) -> None:
    """Print why no results come."""
    say(f"waiting: {reason}", err=True)


class Progress:
    """The progress of a batch: bars for clips and frames on a terminal, beside the tally."""

    def __init__(self, clips: int) -> None:
        self.tally = Tally()
        self._started = time.perf_counter()
        self._clips = tqdm(total=clips, unit=" clips", disable=is_quiet() or None, leave=False)
        self._frames = tqdm(unit=" frames", unit_scale=True, disable=is_quiet() or None, leave=False, position=1)

    @property
    def seconds(self) -> float:
        """The time since the beginning [s]."""
        return time.perf_counter() - self._started

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._frames.close()
        self._clips.close()

    def show(self, record: ManifestRecord | None) -> None:
        """Show that a clip is done or has failed."""
        self._frames.update(record["frames"] if record else 0)
        self._clips.set_postfix(failed=self.tally.failed, refresh=False)
        self._clips.update()


def _print_plan(works: Sequence[Work], folder: Path, recipe: Recipe, overwrite: bool) -> None:
    """Print what would be done with each clip."""
    history = History(folder)
    _print_broken(history)
    for work in works:
        try:
            done = history.is_done(work, hash_of(read_bytes(work.clip.path)), recipe, folder)
            if not done and not overwrite:
                path = folder / work.place
                history.check_replaceable(work, path, hash_of_file(path))
        except DistretargetError as error:
            say(f"fail     {error}")
        else:
            say(f"{'skip   ' if done and not overwrite else 'convert'}  {work.clip.path} -> {folder / work.place}")


def _print_broken(history: History) -> None:
    """Print which lines of a manifest cannot be used."""
    if history.broken:
        first, *others = history.broken
        more = f", nor are {len(others)} more lines" if others else ""
        say(f"warning: {history.path}:{first}: is not a record of a clip{more}; what it says is not used", err=True)


def _print_unread(found: FoundClips) -> None:
    """Print the errors of files and folders that could not be searched."""
    for error in found.unread:
        complain(f"not searched: {error}")
