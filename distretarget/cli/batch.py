"""`distretarget batch`: many clips."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from importlib.metadata import version
from pathlib import Path
from types import FrameType, TracebackType

import click
from tqdm import tqdm

from distretarget.batch.clips import Found, find_clips
from distretarget.batch.manifest import Manifest, Past, Recipe, Record
from distretarget.batch.plan import Work, check_page, plan
from distretarget.batch.pools import Cluster, Pool, Processes, cores
from distretarget.batch.reports import Pages
from distretarget.batch.run import Run
from distretarget.batch.summary import Tally
from distretarget.batch.task import Outcome
from distretarget.cli.options import retargeting
from distretarget.cli.outputs import about, say
from distretarget.cli.parameters import of_reports
from distretarget.conversion import Options, Text, load_text
from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.files import hash_of, hash_of_file, is_folder, read_bytes
from distretarget.io.map_json import load_map
from distretarget.io.skeleton_json import parse_target
from distretarget.measure.figures import FIGURES

INTERRUPTED = 130


@click.command("batch")
@click.argument("sources", nargs=-1, metavar="SOURCES... TARGET", type=click.Path(path_type=Path))
@click.option("-o", "--output", "folder", required=True, type=click.Path(path_type=Path), help="The folder of results.")
@click.option(
    "--target",
    "targets",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A target; then all arguments are sources. Given several times, each target gets a folder of its own.",
)
@click.option(
    "--include",
    multiple=True,
    metavar="GLOB",
    help="Only files whose name or path in the folder is like this; with a / at the end, folders.",
)
@click.option(
    "--exclude",
    multiple=True,
    metavar="GLOB",
    help="No files whose name or path in the folder is like this; with a / at the end, folders.",
)
@click.option(
    "--input-list",
    type=click.File(encoding="utf-8-sig", errors="surrogateescape"),
    metavar="FILE",
    help="Read paths of clips from this file, one a line; - is standard input.",
)
@retargeting
@click.option(
    "--jobs",
    type=click.IntRange(1),
    metavar="N",
    help="How many processes convert. Default: one for each core that may be used.",
)
@click.option("--dask", metavar="ADDRESS", help="Convert on the Dask cluster with this scheduler, as tcp://host:8786.")
@click.option("--overwrite", is_flag=True, help="Convert all anew, and replace files that were not made by a batch.")
@click.option("--fail-fast", is_flag=True, help="Stop at the first clip that fails.")
@click.option(
    "--report",
    "index",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write an HTML page over all clips to this file; reports on clips go to a folder beside it.",
)
@click.option(
    "--reports",
    type=of_reports,
    default="worst:10",
    show_default=True,
    metavar="WHICH",
    help=f"The clips that get a report, with --report: worst:N by {FIGURES[0].label}, all or none.",
)
@click.option("--dry-run", is_flag=True, help="Print what would be done, and do nothing.")
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
    """Convert many clips: SOURCES are BVH files, and folders whose trees are mirrored in the folder of results.

    What is done and unchanged is skipped, so that a run that was stopped goes on where it was; what failed is tried
    again. manifest.jsonl in the folder of results has a line for each clip.

    \b
    distretarget batch mocap hero.json -o mocap_hero
    distretarget batch mocap --target hero.json --target child.json -o converted
    find mocap -name '*walk*.bvh' | distretarget batch hero.json -o walks --input-list -
    """  # noqa: D301
    goals, sources = _targets(sources, tuple(dict.fromkeys(targets)))
    lines = dict.fromkeys(line.rstrip("\r\n") for line in input_list or () if line.strip())
    listed = [Path(line) for line in lines]
    if not sources and input_list is None:
        raise click.UsageError("no sources; expected files, folders or --input-list.")
    if jobs and dask:
        raise click.UsageError("--jobs is for processes here; with --dask the cluster decides.")
    if gone := [source for source in sources if not os.path.lexists(source)]:
        raise click.UsageError(f"{gone[0]}: there is no such file or folder.")
    found = find_clips(sources, listed, include, exclude)
    recipe = Recipe(options, load_map(map_path), version("distretarget"))
    works = _planned(found, goals, folder, sources)
    if dry_run:
        _print_plan(works, folder, recipe, overwrite)
        _tell_unread(found)
        return
    if not works:
        _tell_unread(found)
        raise BatchError("there are no clips to convert")
    pages = Pages(index, reports, overwrite, lambda work: about(work.clip.path, work.place)) if index else None
    if pages:
        check_page(pages.index, works, folder, map_path)
        pages.check()
    pool: Pool = Cluster(dask) if dask else Processes(jobs or cores(), options.objective)
    with closing(pool), closing(Manifest(folder)) as manifest, Progress(works, pages) as progress:
        every = pages.about if pages and pages.most is None else None
        run = Run(folder, recipe, manifest, pool, progress, overwrite, fail_fast, every)
        stopped, status = _convert(run, works, pages)
    for line in progress.tally.lines(len(works), progress.seconds, pool.workers):
        say(line)
    _tell_unread(found)
    problems = pages.problems if pages else {}
    for problem in problems.values():
        say(f"no report: {problem}", err=True)
    if stopped:
        say(f"distretarget: {stopped}", err=True)
    sys.exit(status or int(bool(progress.tally.failed or found.unread or problems)))


def _targets(sources: tuple[Path, ...], targets: tuple[Path, ...]) -> tuple[list[Text], tuple[Path, ...]]:
    """The targets, read, and what is left of the arguments."""
    if not targets:
        if not sources:
            raise click.UsageError("expected SOURCES... TARGET.")
        targets, sources = sources[-1:], sources[:-1]
        if is_folder(targets[0]):
            raise click.UsageError(f"{targets[0]} is a folder; the last argument is the target, or give --target.")
    goals = [load_text(target) for target in targets]
    for goal in goals:
        parse_target(goal.text, goal.path)
    return goals, tuple(dict.fromkeys(sources))


def _planned(found: Found, targets: Sequence[Text], folder: Path, sources: Sequence[Path]) -> list[Work]:
    try:
        return plan(found.clips, targets, folder, sources)
    except BatchError as error:
        raise click.UsageError(str(error)) from error


def _convert(run: Run, works: Sequence[Work], pages: Pages | None) -> tuple[str, int]:
    """Convert the clips; return why the run was stopped, and the exit status for that, if it was."""
    with _interruptible():
        try:
            run.go(works, sum(work.clip.size for work in works))
            if pages:
                pages.finish(run, works, run.manifest.latest(works))
        except KeyboardInterrupt:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is left to do takes no time
            return "interrupted; run this again to go on", INTERRUPTED
        except (BatchError, FileError) as error:
            return str(error), 1
    return "", 0


class Progress:
    """Counts clips, and shows them and their frames go by on a terminal."""

    def __init__(self, works: Sequence[Work], pages: Pages | None) -> None:
        self._pages = pages
        self.tally = Tally()
        self._started = time.perf_counter()
        self._clips = tqdm(total=len(works), unit=" clips", disable=None, leave=False)
        self._frames = tqdm(unit=" frames", unit_scale=True, disable=None, leave=False, position=1)

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return time.perf_counter() - self._started

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._frames.close()
        self._clips.close()

    def clip(self, record: Record | None) -> None:
        """Count a clip."""
        self.tally.add(record)
        self._frames.update(record["frames"] if record else 0)
        self._clips.set_postfix(failed=self.tally.failed, refresh=False)
        self._clips.update()

    def report(self, work: Work, outcome: Outcome) -> None:
        """Write the report on a clip."""
        if self._pages:
            self._pages.add(work, outcome)


def _print_plan(works: Sequence[Work], folder: Path, recipe: Recipe, overwrite: bool) -> None:
    """What would be done with each clip."""
    past = Past(folder)
    for work in works:
        try:
            done = past.is_done(work, hash_of(read_bytes(work.clip.path)), recipe, folder)
            if not done and not overwrite:
                path = folder / work.place
                past.check_replaceable(work, path, hash_of_file(path))
        except DistretargetError as error:
            say(f"fail     {error}")
        else:
            say(f"{'skip   ' if done and not overwrite else 'convert'}  {work.clip.path} -> {folder / work.place}")


def _tell_unread(found: Found) -> None:
    for error in found.unread:
        say(f"not searched: {error}", err=True)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Being asked to end is as Ctrl-C."""

    def interrupt(_signal: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
