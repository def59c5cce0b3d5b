"""`distretarget scene`: retarget performers who share a world."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from distretarget.batch.compile_ahead import warm
from distretarget.cli.options import ENVIRONMENT_OPTION, SUPPORTS_OPTION, positive
from distretarget.cli.outputs import OVERWRITE_OPTION, check_outputs, quiet, say
from distretarget.errors import FileError
from distretarget.io.bvh_writer import format_bvh
from distretarget.io.files import is_folder, make_folder, write_whole
from distretarget.measure.scene_gaps import Across
from distretarget.pipeline.summary import summary_line
from distretarget.report.scene_page import scene_page
from distretarget.scene.retargeting import SceneResult
from distretarget.scene.scene_file import SCENE_NAME, PerformerFiles, SceneSetup, load_scene


@click.command("scene")
@click.argument("sources", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-t",
    "--target",
    "targets",
    multiple=True,
    type=click.Path(path_type=Path),
    help="The body of a performer, a skeleton file or any BVH file: once for all, or once for each, in their order.",
)
@click.option(
    "-o", "--output", required=True, type=click.Path(path_type=Path), help="The folder to write to, a file for each."
)
@OVERWRITE_OPTION
@click.option(
    "--report",
    is_flag=True,
    help="Write report.html to the folder, too: all performers and props in one player, with lines between what "
    "touches.",
)
@click.option("--cut", is_flag=True, help="Cut all clips to the frames of the shortest.")
@click.option("--resample", is_flag=True, help="Give all clips the frame time of the first.")
@click.option(
    "--start",
    "starts",
    multiple=True,
    type=click.FloatRange(min=0.0),
    metavar="SECONDS",
    help="The time left out at the beginning of a clip: once for all, or once for each, in their order. Default: 0.",
)
@click.option(
    "--world-scale",
    type=positive,
    metavar="NUMBER",
    help="Target units per source unit along the floor. Default: the mean of the performers' ratios of leg lengths, "
    "or as much less as the legs of all can follow.",
)
@SUPPORTS_OPTION
@ENVIRONMENT_OPTION
@quiet
def scene_command(
    sources: tuple[Path, ...], targets: tuple[Path, ...], output: Path, overwrite: bool, report: bool, **options: Any
) -> None:
    """Retarget performers who share a world.

    SOURCES are their BVH files, which belong together frame for frame. Each performer gets a body; hands that hold each
    other do so on the other bodies, too. The results have the names of the sources. A single SCENE.json says all of
    that, and which props the performers touch; of a folder, every scene.json below it is converted, each to the folder
    of OUTPUT that it has there.

    \b
    distretarget scene lead.bvh follow.bvh -t hero.json -t child.json -o duet
    distretarget scene staff.json -o staff
    distretarget scene sample_bvh/scenes -o scenes
    """  # noqa: D301
    if not targets:
        _check_alone(sources, options)
        setups = list(_setups(sources[0], output))
    else:
        setups = [(_setup(sources, targets, options), output)]
    warm("contact")
    for setup, folder in setups:
        with _folder_of_results(folder):
            _convert(setup, folder, overwrite, report)


@contextlib.contextmanager
def _folder_of_results(folder: Path) -> Iterator[None]:
    """Make a folder, and remove it again if nothing was written to it."""
    existed = is_folder(folder)
    make_folder(folder)
    try:
        yield
    finally:
        if not existed:
            with contextlib.suppress(OSError):  # it is not empty
                folder.rmdir()


def _check_alone(sources: tuple[Path, ...], options: dict[str, Any]) -> None:
    """Check that what comes without targets is one scene file or folder, which has all options in it."""
    if len(sources) > 1 or sources[0].suffix.lower() == ".bvh":
        raise click.UsageError("Missing option '-t' / '--target', or name one SCENE.json.")
    context = click.get_current_context()
    given = [name for name in options if context.get_parameter_source(name) is ParameterSource.COMMANDLINE]
    if given:
        raise click.UsageError(f"--{given[0].rstrip('s').replace('_', '-')} belongs in the scene file.")


def _setups(path: Path, output: Path) -> Iterator[tuple[SceneSetup, Path]]:
    """The scene in a file, or all scenes in a folder, with the folders to write to."""
    if not is_folder(path):
        yield load_scene(path), output
        return
    found = sorted(path.rglob(SCENE_NAME))
    if not found:
        raise FileError(path, f"has no {SCENE_NAME} in it or below")
    for file in found:
        yield load_scene(file), output / file.parent.relative_to(path)


def _setup(sources: Sequence[Path], targets: Sequence[Path], options: dict[str, Any]) -> SceneSetup:
    """The scene that the command line describes."""
    starts = options["starts"] or (0.0,)
    for given, what in ((targets, "targets"), (starts, "starts")):
        if len(given) not in (1, len(sources)):
            raise click.UsageError(
                f"{len(given)} {what} for {len(sources)} performers; give one for all, or one for each, in their order."
            )
    bodies, times = (given * len(sources) if len(given) == 1 else given for given in (tuple(targets), starts))
    cast = tuple(
        PerformerFiles(name=source.stem, source=source, target=target, start=start)
        for source, target, start in zip(sources, bodies, times, strict=True)
    )
    return SceneSetup(
        performers=cast,
        world_scale=options["world_scale"],
        supports=options["supports"],
        environment=options["environment"],
        cut=options["cut"],
        resample=options["resample"],
    )


def _convert(setup: SceneSetup, folder: Path, overwrite: bool, report: bool) -> None:
    """Retarget a scene into a folder, and print what came of it."""
    outputs = [folder / f"{name}.bvh" for name in setup.names]
    page = folder / "report.html"
    check_outputs([*outputs, page if report else None], setup.inputs, overwrite)
    began = time.perf_counter()
    result = setup.retargeted()
    motions = [one.motion for one in result.results] + [prop.motion for prop in result.props]
    texts = [format_bvh(motion) for motion in motions]
    seconds = time.perf_counter() - began
    written = dict(zip(outputs, texts, strict=True)) | ({page: scene_page(result, setup.names)} if report else {})
    for path, text in written.items():
        write_whole(path, text, overwrite=overwrite)
    for path, one in zip(outputs, result.results, strict=False):
        for warning in one.warnings:
            say(f"warning: {path.name}: {warning}", err=True)
        say(f"{path.name}: {summary_line(one, seconds)}")
    for line in _too_long(result, setup.names):
        say(f"warning: {line}", err=True)
    for line in _together(result, setup.names):
        say(line)
    if any(across.frames for across in result.across.values()):
        off = 100.0 * result.off
        say(f"sweeps: {result.sweeps}; gaps between what touches are {off:.1f} % of a leg off on average")


def _together(result: SceneResult, names: Sequence[str]) -> Iterator[str]:
    """A line for each two that may touch: how near what touches is, in the source, copied, and in the result."""
    for (i, j), across in result.across.items():
        yield f"{names[i]} and {names[j]}: {_gaps(across)}"


def _too_long(result: SceneResult, names: Sequence[str]) -> Iterator[str]:
    """A line for each performer whose legs cannot follow in this world."""
    for name, strides in zip(names, result.strides, strict=False):
        if strides.factor > strides.longest:
            yield (
                f"{name}: with a world scale of {result.world_scale:.3g} its strides are {strides.factor:.2f} times as "
                f"long as its legs make them; these reach {strides.longest:.2f} times: choose a smaller --world-scale"
            )


def _gaps(across: Across) -> str:
    if not across.frames:
        return "nothing touches between them in the source"
    source, copy, now = (100 * gap / across.leg for gap in (across.source, across.rotation_copy, across.result))
    return (
        f"what touches between them in {across.frames} frames is {now:.1f} % of a leg apart "
        f"({source:.1f} in the source, {copy:.1f} in copied rotations)"
    )
