"""`distretarget batch`: retarget many clips."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path, PurePath
from typing import TextIO

import click
from tqdm import tqdm

from distretarget.batch.batch import Batch
from distretarget.batch.pages import Pages
from distretarget.batch.plan import find_clips, plan
from distretarget.batch.results import BatchRecord, Results, clips_folder, write_merged
from distretarget.batch.summary import Tally
from distretarget.batch.workers import TIME_LIMITS, Cluster, Processes, Workers
from distretarget.cli.options import (
    PATH,
    RecipeFiles,
    contacts_option,
    conversion_options,
    file_option,
    parse_formats,
    parse_reports,
    quiet,
)
from distretarget.cli.outputs import STANDARD, about, check_outputs, complain, is_quiet, say
from distretarget.errors import BatchError, DistretargetError, FileError, counted
from distretarget.io.files import hash_of, is_folder, read_bytes
from distretarget.io.input_file import OUTPUT_FORMATS, OUTPUTS, load_file
from distretarget.io.motion_writer import DEFAULT_OUTPUT, output_kind
from distretarget.io.reading import TargetFile
from distretarget.measure.metrics import METRICS
from distretarget.numerics.parallel import cores

INTERRUPTED = 130  # exit status
LONGEST_PATH = 40_000  # more than any system allows [characters]


@click.command("batch")
@click.argument("sources", nargs=-1, metavar="SOURCES... TARGET", type=PATH)
@click.option("-o", "--output", "folder", required=True, type=PATH, help="The folder for the results.")
@click.option(
    "--target",
    "targets",
    multiple=True,
    type=PATH,
    help="A target, in place of TARGET. May be given several times; each target gets its own folder of results.",
)
@click.option(
    "--include",
    multiple=True,
    metavar="GLOB",
    help="Retarget only files whose name or path in the folder matches. A pattern that ends in / matches folders.",
)
@click.option("--exclude", multiple=True, metavar="GLOB", help="Leave out files that match, or folders.")
@click.option(
    "--input-list",
    type=click.File(encoding="utf-8-sig", errors="surrogateescape"),
    metavar="FILE",
    help="Read the paths of clips from this file, one per line; - is standard input.",
)
@conversion_options(
    contacts_option(
        help="Contacts to drop, add or change, in all clips; or 'beside', for files such as walk.contacts.json beside "
        "walk.bvh."
    ),
    click.option(
        "--format",
        "kinds",
        type=parse_formats,
        metavar="KIND[,KIND...]",
        help=f"The formats of results, one file each: {', '.join(OUTPUT_FORMATS)}. Default: own, the format of "
        "TARGET if it is glTF or VRM, else bvh. npz has arrays: positions, rotations, and labels of frames.",
    ),
    click.option("--npz", is_flag=True, help="Write arrays beside each result, like --format own,npz."),
)
@click.option(
    "--merge",
    is_flag=True,
    help="Write a single file to -o, .glb, .gltf or .vrm: TARGET with each result as an animation.",
)
@click.option(
    "--jobs", type=click.IntRange(1), metavar="N", help="The number of processes. Default: one for each available core."
)
@click.option("--dask", metavar="ADDRESS", help="Use the Dask cluster with this scheduler: tcp://HOST:PORT.")
@click.option("--overwrite", is_flag=True, help="Retarget all clips again, and replace files that no batch made.")
@click.option(
    "--time-limit",
    type=click.FloatRange(*TIME_LIMITS),
    metavar="SECONDS",
    help="A clip that takes longer fails, and the next run tries it again. Default: none.",
)
@click.option("--fail-fast", is_flag=True, help="Stop at the first clip that fails.")
@file_option(
    "--report",
    "index",
    help="Write an HTML page about all clips to this file; reports of single clips go to a folder beside it.",
)
@click.option(
    "--reports",
    type=parse_reports,
    default="worst:10",
    show_default=True,
    metavar="WHICH",
    help="With --report, which clips get a report of their own: worst:N for the N with the largest "
    f"{METRICS[0].label}, all or none.",
)
@file_option(
    "--table",
    help="Write a table, .csv or .parquet, with a row for each clip: its metrics, verdict, warnings, and hashes.",
)
@click.option("--dry-run", is_flag=True, help="Print what would be done, and do nothing.")
@quiet
def batch_command(
    sources: tuple[Path, ...],
    folder: Path,
    targets: tuple[Path, ...],
    include: tuple[str, ...],
    exclude: tuple[str, ...],
    input_list: TextIO | None,
    recipe_files: RecipeFiles,
    kinds: tuple[str, ...] | None,
    npz: bool,
    merge: bool,
    contacts_path: Path | None,
    jobs: int | None,
    dask: str | None,
    overwrite: bool,
    time_limit: float | None,
    fail_fast: bool,
    index: Path | None,
    reports: int | None,
    table: Path | None,
    dry_run: bool,
) -> None:
    """Retarget many clips to one or several targets.

    SOURCES are motion files (BVH, glTF, VRM animations, FBX) and folders; results keep the tree of each folder. Clips
    that are done and unchanged are skipped, so an interrupted run continues where it stopped; clips that failed are
    tried again. metrics.csv in the folder of results has a row for each clip.

    \b
    distretarget batch mocap hero.json -o mocap_hero
    distretarget batch mocap hero.vrm -o hero_all.vrm --merge
    distretarget batch mocap --target hero.json --target child.json -o converted
    find mocap -name '*walk*.bvh' | distretarget batch hero.json -o walks --input-list -
    """  # noqa: D301
    sources, files = _sources_and_targets(sources, targets)
    listed = [*dict.fromkeys(_listed(input_list))] if input_list else []
    if not sources and input_list is None:
        raise click.UsageError("no sources; expected files, folders or --input-list.")
    if jobs and dask is not None:
        raise click.UsageError("--jobs sets the processes of this machine; give either --jobs or --dask.")
    if time_limit and dask is not None:
        raise click.UsageError("--time-limit ends processes of this machine; give either --time-limit or --dask.")
    if STANDARD in sources:
        raise click.UsageError("results are named after their sources, and standard input has no name; give a file.")
    if missing := [source for source in sources if not os.path.lexists(source)]:
        raise click.UsageError(f"{missing[0]}: there is no such file or folder.")
    found, unread = find_clips(sources, listed, include, exclude, arrays=recipe_files.skeleton_path is not None)
    if not merge and folder.suffix.lower() in OUTPUTS and not is_folder(folder):
        raise click.UsageError(f"{folder}: results go into a folder; with --merge, -o names a file for all of them.")
    results = folder
    if merge:
        if kinds or npz:
            raise click.UsageError("--merge writes what the name of -o says; leave out --format and --npz.")
        results, kinds = _for_merge(folder, files, overwrite, dry_run), ("bvh",)
    elif npz:
        kinds = (*(kinds or ("own",)), "npz")
    recipe = recipe_files.read()
    try:
        clips = plan(found, files, results, sources, kinds or (), recipe.clip)
    except BatchError as error:
        raise click.UsageError(str(error)) from error
    batch = Batch(
        clips,
        Pages(Results(results, overwrite and not merge, read_only=dry_run), about, index, reports, table),
        replace(recipe, writing=DEFAULT_OUTPUT) if merge else recipe,
        contacts_path,
        load_file(recipe_files.skeleton_path) if recipe_files.skeleton_path else None,
        time_limit,
        fail_fast,
    )
    complain(*(f"not searched: {each}" for each in unread))
    if dry_run:
        _print_plan(batch)
        return
    tally, status = _converted(batch, dask, jobs)
    if merge and not status:
        count = write_merged(folder, files[0], batch.clips, recipe.writing, overwrite)
        say(f"{folder}: {counted(count, 'animation')}")
    sys.exit(status or int(bool(tally.failed or unread or batch.pages.problems)))


def _sources_and_targets(sources: Sequence[Path], targets: Sequence[Path]) -> tuple[tuple[Path, ...], list[TargetFile]]:
    """The sources and the targets; without --target, the last source is the target."""
    if not targets:
        if not sources:
            raise click.UsageError("expected SOURCES... TARGET.")
        sources, targets = sources[:-1], sources[-1:]
        if is_folder(targets[0]):
            raise click.UsageError(f"{targets[0]} is a folder; the last argument is the target, or give --target.")
    return tuple(dict.fromkeys(sources)), [TargetFile.of(load_file(path)) for path in dict.fromkeys(targets)]


def _listed(lines: TextIO) -> Iterator[Path]:
    """The paths in a list, one per line; an error if a line is too long for a path, as from an endless device."""
    while line := lines.readline(LONGEST_PATH):
        if len(line) == LONGEST_PATH:
            raise click.UsageError("--input-list: a line is longer than any path; expected one path per line.")
        if line.strip():
            yield Path(line.rstrip("\r\n"))


def _for_merge(file: Path, targets: Sequence[TargetFile], overwrite: bool, dry_run: bool) -> Path:
    """The folder for the single results of --merge, after a check that the merged file can be written."""
    if len(targets) != 1:
        raise click.UsageError("--merge writes one file, for one target.")
    if output_kind(file, targets[0].file) != "character":
        raise FileError(file, "--merge puts all results into the target's file; expected .glb, .gltf or .vrm")
    check_outputs([file], [Path(targets[0].path)], overwrite or dry_run)
    return clips_folder(file)


def _converted(batch: Batch, dask: str | None, jobs: int | None) -> tuple[Tally, int]:
    """Retarget the clips and print a summary; return the counts, and the exit status, 0 unless the batch stopped."""
    batch.check()
    tally = Tally(clips=len(batch.clips))
    if dask is None:
        workers: Workers = Processes(jobs or cores())
    else:
        workers = Cluster(dask, lambda reason: say(f"waiting: {reason}", err=True))
    silent = is_quiet() or None  # None: bars on a terminal only
    stopped, status = "", 0
    with (
        closing(workers),
        tqdm(total=tally.clips, unit=" clips", disable=silent, leave=False) as clips,
        tqdm(unit=" frames", unit_scale=True, disable=silent, leave=False, position=1) as frames,
    ):

        def show(record: BatchRecord | None) -> None:
            frames.update(record["frames"] if record else 0)
            clips.set_postfix(failed=tally.failed, refresh=False)
            clips.update()

        try:
            batch.convert(workers, tally, show)
        except KeyboardInterrupt:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # do not interrupt the summary
            stopped, status = "interrupted; run this again to go on", INTERRUPTED
        except (BatchError, FileError) as error:
            stopped, status = str(error), 1
    say(*tally.lines)
    complain(*(tally.failures if is_quiet() else ()))
    complain(*(f"no report: {problem}" for problem in batch.pages.problems.values()))
    if stopped:
        complain(f"distretarget: {stopped}")
    return tally, status


def _print_plan(batch: Batch) -> None:
    results = batch.results
    for clip in batch.clips:
        try:
            record = batch.record_of(clip, hash_of(read_bytes(clip.path)))
            skip = results.known(record, clip.outputs)
            if not skip:
                for name in clip.outputs:
                    results.check_replaceable(record, name)
        except DistretargetError as error:
            say(f"fail     {error}")
        else:
            beside = (PurePath(output).suffix for output in clip.outputs[1:])
            made = ", ".join([str(results.folder / clip.output), *beside])
            say(f"{'skip   ' if skip else 'convert'}  {clip.path} -> {made}")
