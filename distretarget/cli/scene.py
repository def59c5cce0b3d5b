"""`distretarget scene`: retarget performers who share a world."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import click

from distretarget.batch.compile_ahead import warm
from distretarget.cli.outputs import check_outputs, quiet, say
from distretarget.cli.parameters import positive
from distretarget.errors import FileError, MotionError
from distretarget.io.bvh import read_bvh
from distretarget.io.bvh_writer import format_bvh
from distretarget.io.files import write_whole
from distretarget.io.target_file import load_target
from distretarget.measure.across import Across
from distretarget.motion import Motion
from distretarget.performer import Held
from distretarget.run_summary import summary_line
from distretarget.scene import SceneResult, retarget_scene
from distretarget.solve.resting_joints import Scene


@click.command("scene")
@click.argument("sources", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-t",
    "--target",
    "targets",
    multiple=True,
    required=True,
    type=click.Path(path_type=Path),
    help="The body of a performer, a skeleton file or any BVH file: once for all, or once for each, in their order.",
)
@click.option(
    "-o", "--output", required=True, type=click.Path(path_type=Path), help="The folder to write to, a file for each."
)
@click.option("--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced.")
@click.option("--cut", is_flag=True, help="Cut all clips to the frames of the shortest.")
@click.option(
    "--world-scale",
    type=positive,
    metavar="NUMBER",
    help="Target units per source unit along the floor. Default: the mean of the performers' ratios of leg lengths.",
)
@click.option(
    "--supports",
    type=click.Choice(get_args(Held)),
    default="hold",
    show_default=True,
    help="What stays at rest on the world: everything that rests (hold), feet alone (feet), or nothing (free).",
)
@click.option(
    "--scene",
    type=click.Choice(get_args(Scene)),
    default="body",
    show_default=True,
    help="Where what stands still belongs, apart from the floor, as for 'distretarget retarget'.",
)
@quiet
def scene_command(
    sources: tuple[Path, ...],
    targets: tuple[Path, ...],
    output: Path,
    overwrite: bool,
    cut: bool,
    world_scale: float | None,
    supports: Held,
    scene: Scene,
) -> None:
    """Retarget performers who share a world.

    SOURCES are their BVH files, which belong together frame for frame. Each performer gets a body; hands that hold each
    other do so on the other bodies, too. The results have the names of the sources.

    \b
    distretarget scene lead.bvh follow.bvh -t hero.json -t child.json -o duet
    """  # noqa: D301
    outputs = [output / f"{source.stem}.bvh" for source in sources]
    if len(targets) not in (1, len(sources)):
        raise click.UsageError(
            f"{len(targets)} targets for {len(sources)} performers; give one for all, or one for each, in their order."
        )
    _make_folder(output)
    check_outputs(outputs, [*sources, *targets], overwrite)
    warm("contact")
    began = time.perf_counter()
    motions = _motions(sources, cut)
    bodies = [load_target(target) for target in (targets * len(sources) if len(targets) == 1 else targets)]
    try:
        result = retarget_scene(motions, bodies, world_scale=world_scale, supports=supports, scene=scene)
    except MotionError as error:
        raise error.in_file(sources[0]) from None
    texts = [format_bvh(one.motion) for one in result.results]
    seconds = time.perf_counter() - began
    for path, text in zip(outputs, texts, strict=True):
        write_whole(path, text, overwrite=overwrite)
    for source, one in zip(sources, result.results, strict=True):
        for warning in one.warnings:
            say(f"warning: {source.name}: {warning}", err=True)
        say(f"{source.name}: {summary_line(one, seconds)}")
    for line in _together(result, sources):
        say(line)


def _motions(sources: Sequence[Path], cut: bool) -> list[Motion]:
    motions = [read_bvh(source) for source in sources]
    if not cut:
        return motions
    frames = min(len(motion) for motion in motions)
    return [replace(m, translations=m.translations[:frames], rotations=m.rotations[:frames]) for m in motions]


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made: {error.strerror}; name a folder that can be written to") from None


def _together(result: SceneResult, sources: Sequence[Path]) -> Iterator[str]:
    """A line for each two performers: how near what touches is, in the source, copied, and in the result."""
    for (i, j), across in result.across.items():
        names = f"{sources[i].name} and {sources[j].name}"
        yield f"{names}: {_gaps(across, result)}"


def _gaps(across: Across, result: SceneResult) -> str:
    if not across.frames:
        return "nothing touches between them in the source"
    leg = result.results[0].matching.leg_lengths[0] or 1.0
    source, copy, now = (100 * gap / leg for gap in (across.source, across.rotation_copy, across.result))
    return (
        f"what touches between them in {across.frames} frames is {now:.1f} % of a leg apart "
        f"({source:.1f} in the source, {copy:.1f} in copied rotations)"
    )
