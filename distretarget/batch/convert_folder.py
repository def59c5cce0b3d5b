"""A batch from Python: `convert_folder`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from types import NoneType

from distretarget.batch.batch import Batch
from distretarget.batch.job import TIME_LIMITS, Recipe
from distretarget.batch.keep import Condition
from distretarget.batch.pages import Pages
from distretarget.batch.plan import find_clips, plan
from distretarget.batch.results import Results
from distretarget.batch.tally import Tally
from distretarget.batch.workers import Processes
from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.checks import check_choice, check_kind, check_number, check_path
from distretarget.io.input_file import load_file
from distretarget.io.map_json import load_map
from distretarget.io.motion_writer import DEFAULT_OUTPUT, FORMATS, OutputSettings
from distretarget.io.target_file import TargetFile
from distretarget.numerics.parallel import cores
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.report.diff_document import About


def convert_folder(
    sources: str | Path | Sequence[str | Path],
    targets: str | Path | Sequence[str | Path],
    folder: str | Path,
    *,
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    map_file: str | Path | None = None,
    rest: str | Path | None = None,
    clip: str | None = None,
    fps: float | None = None,
    formats: Sequence[str] = (),
    writing: OutputSettings = DEFAULT_OUTPUT,
    options: Options = DEFAULT_OPTIONS,
    builds: Builds = OWN_BUILDS,
    contacts: str | Path | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    fail_fast: bool = False,
    time_limit: float | None = None,
    report: str | Path | None = None,
    reports: int | None = 10,
    table: str | Path | None = None,
    keep: str | None = None,
    joints: str | Path | None = None,
) -> Tally:
    """Retarget motion files and folders of them to one target or several, as `distretarget batch` does.

    Clips that are done and unchanged are skipped, so an interrupted call continues where it stopped. A script that
    calls this needs `if __name__ == "__main__":`, since worker processes may import it.

    Args:
        sources: BVH, glTF, VRM animation and FBX files, and folders.
        targets: characters, skeleton files or BVH files; with several targets each gets its own folder in `folder`.
        folder: the folder of results, which has the same tree as the sources.
        include: shell patterns for names or paths of files in folders, of which one must match.
        exclude: shell patterns for files to leave out.
        map_file: a map file, as `--map` takes it.
        rest: a file of the clips' rig whose first frame is a standing pose, as `--rest` takes it.
        clip: the animation to read of files that have several.
        fps: the frame rate to sample animations at [frames/s]; their own keys by default.
        formats: of the results, such as ("bvh", "npz"): files of each clip, named alike; by default, and for "own",
            that of the target if it is glTF, else "bvh".
        writing: how motions are put into the files of characters.
        options: how to retarget.
        builds: how thick the bodies are, if other files say it than their own.
        contacts: a contact file for all clips; or "beside", for the file beside each clip that has one, such as
            `walk.contacts.json`.
        jobs: the number of processes; one for each core if not given.
        overwrite: whether to retarget everything again, and to replace files that no batch made.
        fail_fast: whether to stop at the first clip that fails.
        time_limit: the longest time for a clip [s]; one that takes longer fails, and the next call tries it again.
        report: an HTML page on all clips to write.
        reports: how many clips get a report beside it, the worst first; None for all.
        table: a table to write with a row for each clip, .csv or .parquet.
        keep: a condition on metrics, as `--keep` takes it; clips that fail it are left out.
        joints: the skeleton for clips that are arrays, which folders are searched for then; see `read_motion`.

    Returns:
        The numbers of clips converted, skipped, failed and left out, and `lines` to print.

    Raises:
        BatchError: there are no clips, results would replace clips, or `fail_fast` stopped the batch.
        DistretargetError: a target, the map or the folder of results cannot be used.
        SettingsError: an argument has the wrong type, or is out of bounds.
    """
    check_kind("options", options, Options)
    check_kind("builds", builds, Builds)
    check_kind("include", include, Sequence)
    check_kind("exclude", exclude, Sequence)
    check_kind("keep", keep, str, NoneType)
    check_kind("formats", formats, Sequence)
    for each in [formats] if isinstance(formats, str) else formats:
        check_choice("formats", each, FORMATS)
    for name, number, least in (("jobs", jobs, 1), ("reports", reports, 0)):
        check_kind(name, number, int, NoneType)
        check_number(name, least if number is None else number, least, sys.maxsize)
    if time_limit is not None:
        check_number("time_limit", time_limit, *TIME_LIMITS)
    check_path("folder", folder)
    paths = _listed("sources", sources)
    found, unread = find_clips(paths, (), include, exclude, arrays=joints is not None)
    if unread:
        raise unread[0]
    files = [TargetFile.of(load_file(path)) for path in _listed("targets", targets)]
    clips = plan(found, files, Path(folder), paths, formats, clip)
    batch = Batch(
        clips,
        Results(Path(folder), overwrite, Condition(keep) if keep else None),
        Recipe(options, load_map(map_file, rest), clip, fps, writing, builds),
        Pages(
            lambda clip, result: About(a=clip.name, b=result.name),
            Path(report) if report else None,
            reports,
            Path(table) if table else None,
        ),
        None if contacts is None else Path(contacts),
        load_file(joints) if joints else None,
        time_limit,
        fail_fast,
    )
    batch.check()
    tally = Tally(clips=len(clips))
    with closing(Processes(jobs or cores(), options.objective)) as workers:
        batch.convert(workers, tally)
    return tally


def _listed(name: str, paths: str | Path | Sequence[str | Path]) -> list[Path]:
    """The paths in an argument of one path or several."""
    several = paths if isinstance(paths, Sequence) and not isinstance(paths, str) else [paths]
    for path in several:
        check_path(name, path)
    return [Path(path) for path in several]
