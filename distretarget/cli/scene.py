"""`distretarget scene`: retarget performers who share a world."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from distretarget.batch.plan import PlannedClip
from distretarget.batch.results import Results, new_record
from distretarget.cli.options import (
    ENVIRONMENT_OPTION,
    OVERWRITE_OPTION,
    PATH,
    SUPPORTS_OPTION,
    file_option,
    parse_skin,
    positive,
    quiet,
    scene_edit_options,
)
from distretarget.cli.outputs import check_outputs, complain, say
from distretarget.errors import DistretargetError, FileError, counted
from distretarget.io.bvh_writer import bvh_parts, refusals
from distretarget.io.files import (
    Content,
    check_inside,
    encoded_parts,
    hash_of,
    is_folder,
    make_folder,
    read_bytes,
    write_whole,
)
from distretarget.io.input_file import MOTION_SUFFIXES, OUTPUTS, load_file
from distretarget.io.motion_writer import DEFAULT_OUTPUT, as_written, content_of, suffix_of
from distretarget.io.reading import TargetFile
from distretarget.pipeline.edits import Edits
from distretarget.report.diff_document import summary_line
from distretarget.report.scene_page import scene_page
from distretarget.scene.retargeting import SceneResult
from distretarget.scene.scene_file import EDITS, SCENE_NAME, PerformerFiles, SceneSetup, load_scene

REPORTED_DEPTH = 0.5  # least overlap of two performers that is printed [% of height]
PER_PERFORMER = {  # fields of `PerformerFiles` that are given once for all or once for each, and their names in errors
    "target": "targets",
    "start": "starts",
    "skin": "skins",
    "source_skin": "source skins",
    "contacts": "contact files",
}


@click.command("scene")
@click.argument("sources", nargs=-1, required=True, type=PATH)
@click.option(
    "-t",
    "--target",
    multiple=True,
    type=PATH,
    help="A performer's body, a character or a skeleton file: once for all, or once for each performer in order.",
)
@click.option("-o", "--output", required=True, type=PATH, help="The folder to write to.")
@OVERWRITE_OPTION
@file_option(
    "--report",
    help="Write an HTML report to this file: all performers and props in one player. For a folder of scenes, one of "
    "this name beside the results of each.",
)
@click.option("--cut", is_flag=True, help="Cut all clips to the length of the shortest.")
@click.option("--resample", is_flag=True, help="Give all clips the frame time of the first.")
@click.option(
    "--start",
    multiple=True,
    type=click.FloatRange(min=0.0),
    metavar="SECONDS",
    help="The time to cut off at the beginning of a clip: once for all, or once for each clip in order. Default: 0.",
)
@scene_edit_options
@click.option(
    "--world-scale",
    type=positive,
    metavar="NUMBER",
    help="Target units per source unit along the floor. Default: the mean of the performers' ratios of leg lengths, "
    "or less, if the legs of one would be too short.",
)
@SUPPORTS_OPTION
@ENVIRONMENT_OPTION
@click.option(
    "--skin",
    multiple=True,
    type=parse_skin,
    metavar="[auto|average|BUILD|none|FILE]",
    help="The thickness of a target, as in retarget: once for all, or once for each performer in order. Default: auto.",
)
@click.option(
    "--source-skin",
    multiple=True,
    type=PATH,
    metavar="[BUILD|FILE]",
    help="The thickness of a source's performer, as in retarget: once for all, or once for each in order.",
)
@file_option(
    "--contacts",
    multiple=True,
    help="Contacts to drop, add or change, as in retarget: once for all performers, or once for each in order. Frames "
    "count from the start of the scene.",
)
@quiet
def scene_command(
    sources: tuple[Path, ...], output: Path, overwrite: bool, report: Path | None, **options: Any
) -> None:
    """Retarget performers who share a world.

    SOURCES are the motion files of the performers, with the same frames. Hands that hold each other still do so on the
    new bodies. Results have the names of the sources, with numbers if these are equal. SOURCES may also be a
    SCENE.json, which describes performers, targets, and props that the performers touch; or a folder: then every
    scene.json below it is retargeted, to the same subfolder of OUTPUT. Scenes that are done and unchanged are skipped.
    If a scene fails, the next ones still run.

    \b
    distretarget scene lead.bvh follow.bvh -t hero.json -t child.json -o duet
    distretarget scene staff.json -o staff
    distretarget scene sample_bvh/scenes -o scenes
    """  # noqa: D301
    if options["target"]:
        if scene := next((path for path in sources if path.suffix.lower() == ".json" or is_folder(path)), None):
            raise click.UsageError(f"{scene} is a scene or a folder of scenes, which name their targets; leave out -t.")
        setup = _setup(sources, options)
    elif is_folder(path := _scene_path(sources, options)):
        _retarget_folder(path, Results(output, overwrite), report)
        return
    else:
        setup = load_scene(path)

    def write(contents: Mapping[Path, Content]) -> None:
        for path, content in contents.items():
            write_whole(path, content, overwrite)

    _retarget_scene(setup, *_outputs(setup, output), report, overwrite, write)


def _scene_path(sources: Sequence[Path], options: dict[str, Any]) -> Path:
    """The path of the scene file, or of the folder of scenes, that the command line names."""
    path = sources[0]
    if len(sources) > 1 or path.suffix.lower() in MOTION_SUFFIXES:
        raise click.UsageError("Missing option '-t' / '--target', or name one SCENE.json.")
    context = click.get_current_context()
    for option in context.command.params:
        if option.name in options and context.get_parameter_source(option.name) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"{option.opts[0]} belongs in the scene file.")
    return path


def _names(files: Sequence[Path]) -> list[str]:
    """The names of files without their endings; equal ones get numbers, as `take_1` and `take_2`."""
    stems = [file.stem for file in files]
    return [
        stem if stems.count(stem) == 1 else f"{stem}_{1 + stems[:number].count(stem)}"
        for number, stem in enumerate(stems)
    ]


def _setup(sources: Sequence[Path], options: dict[str, Any]) -> SceneSetup:
    """The scene that the command line describes."""
    given = {field: values for field in PER_PERFORMER if (values := options.pop(field))}
    for field, values in given.items():
        if len(values) not in (1, len(sources)):
            raise click.UsageError(
                f"{len(values)} {PER_PERFORMER[field]} for {len(sources)} performers; give one for all, or one for "
                "each, in their order."
            )
    if "none" in given.get("skin", ()) and "source_skin" in given:
        raise click.UsageError("--skin none leaves out all thickness; leave out --source-skin.")
    performers = tuple(
        PerformerFiles(name=name, file=file, **dict(zip(given, each, strict=True)))
        for name, file, *each in zip(_names(sources), sources, *map(cycle, given.values()), strict=False)
    )
    edits = Edits(**{name: options.pop(name) for name in EDITS})
    return SceneSetup(performers=performers, **options, edits=edits)


def _retarget_folder(path: Path, results: Results, report: Path | None) -> None:
    """Retarget all scenes of a folder; failures do not stop the others, and scenes that are done are skipped."""
    files = sorted(path.rglob(SCENE_NAME))
    if not files:
        raise FileError(path, f"has no {SCENE_NAME} in it or below")
    skipped, failures = 0, 0
    with contextlib.closing(results.database):
        for file in files:
            try:
                folder = results.folder / file.parent.relative_to(path)
                check_inside(folder, results.folder)
                skipped += not _retarget_unless_done(file, folder, results, report)
            except DistretargetError as error:
                failures += 1
                complain(f"failed: {error}")
    converted = len(files) - skipped - failures
    say(f"{counted(len(files), 'scene')}: {converted} converted, {skipped} done before, {failures} failed")
    if failures:
        sys.exit(1)


def _retarget_unless_done(file: Path, folder: Path, results: Results, report: Path | None) -> bool:
    """Retarget the scene in a file into a folder below all results; return False if it was done before."""
    setup = load_scene(file)
    targets, outputs = _outputs(setup, folder)
    report = folder / report.name if report else None
    if report:
        check_inside(report, folder)
    names = [path.relative_to(results.folder).as_posix() for path in (*outputs, report) if path]
    inputs = hash_of(*(hash_of(read_bytes(path)).encode() for path in (file, *setup.inputs)))
    record = new_record(PlannedClip(file, targets[0], (names[0],), 0), {}, inputs)
    record["status"] = "done"
    if results.known(record, names):
        return False
    for name in names:
        results.check_replaceable(record, name)

    def write(contents: Mapping[Path, Content]) -> None:
        parts = ([*encoded_parts(content)] for content in contents.values())
        results.put(record, dict(zip(names, parts, strict=True)))

    _retarget_scene(setup, targets, outputs, report, True, write)
    return True


def _outputs(setup: SceneSetup, folder: Path) -> tuple[list[TargetFile], list[Path]]:
    """The targets of a scene, and the paths of the results of performers and props in a folder."""
    targets = [TargetFile.of(load_file(performer.target)) for performer in setup.performers]
    suffixes = [*map(suffix_of, targets), *[".bvh"] * len(setup.props)]
    outputs = [folder / f"{name}{suffix}" for name, suffix in zip(setup.names, suffixes, strict=True)]
    for path in outputs:
        check_inside(path, folder)
    return targets, outputs


def _retarget_scene(
    setup: SceneSetup,
    targets: Sequence[TargetFile],
    outputs: Sequence[Path],
    report: Path | None,
    overwrite: bool,
    write: Callable[[Mapping[Path, Content]], object],
) -> None:
    """Retarget a scene, `write` its files, and print a summary. A folder made for them is removed if it stays empty."""
    folder = outputs[0].parent
    existed = is_folder(folder)
    make_folder(folder)
    try:
        check_outputs([*outputs, report], setup.inputs, overwrite)
        began = time.perf_counter()
        result = setup.retargeted()
        clips = [DEFAULT_OUTPUT.clip(motion, name) for motion, name in zip(result.motions, setup.names, strict=False)]
        contents: dict[Path, Content] = {
            path: [*content_of(path, clip, target, DEFAULT_OUTPUT)]
            for path, clip, target in zip(outputs, clips, targets, strict=False)
        }
        props = zip(outputs[len(clips) :], result.props, strict=True)
        contents |= {path: [*bvh_parts(prop.motion)] for path, prop in props}
        written = [
            replace(one, motion=as_written(one.motion, OUTPUTS[path.suffix.lower()], target=target))
            for one, path, target in zip(result.results, outputs, targets, strict=False)
        ]
        result, seconds = replace(result, results=tuple(written)), time.perf_counter() - began
        write(contents | ({report: scene_page(result, setup.names)} if report else {}))
    finally:
        if not existed:
            with contextlib.suppress(OSError):  # it is not empty
                folder.rmdir()
    _print_summary(setup, outputs, result, seconds)


def _print_summary(setup: SceneSetup, outputs: Sequence[Path], result: SceneResult, seconds: float) -> None:
    """Print warnings and metrics of each performer, and of the contacts between performers."""
    for path, one in zip(outputs, result.results, strict=False):
        for warning in one.warnings:
            say(f"warning: {path.name}: {warning}", err=True)
        for line in refusals(one.motion.skeleton) if path.suffix == ".bvh" else ():
            say(f"{path.name}: {line}", err=True)
        say(f"{path.name}: {summary_line(one, seconds)}")
    for name, one, longest in zip(setup.names, result.results, result.longest_strides, strict=False):
        if (factor := result.world_scale / one.root_scale) > longest:
            say(
                f"warning: {name}: with a world scale of {result.world_scale:.3g} its strides are {factor:.2f} times "
                f"as long as its legs make them; these reach {longest:.2f} times: choose a smaller --world-scale",
                err=True,
            )
    for (i, j), gap in result.gaps.items():
        line, copy = "no contacts between them in the source", result.copy_gaps[i, j]
        if skin_gap := result.skin_gaps.get((i, j)):
            line = skin_gap.sentence
        elif gap and copy:
            line = (
                f"contacts in {counted(gap.frames, 'frame')}: joints {100 * gap.b:.1f} % of a leg apart on average, "
                f"more than {100 * gap.worst:.1f} in 1 % of the cases "
                f"({100 * gap.a:.1f} on average in the source, {100 * copy.b:.1f} in copied rotations)"
            )
        overlap = result.overlaps.get((i, j))
        if overlap and overlap.depth > REPORTED_DEPTH:
            line += f"; {overlap.sentence}"
        say(f"{setup.names[i]} and {setup.names[j]}: {line}")
    if any(gap and both not in result.skin_gaps for both, gap in result.gaps.items()):
        error = 100.0 * result.gap_error
        rounds = counted(result.sweeps, "sweep")
        say(f"{rounds} over all performers; contacts too near or too far by {error:.1f} % of a leg on average")
