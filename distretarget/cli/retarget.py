"""`distretarget retarget`: one clip."""

from __future__ import annotations

import time
from pathlib import Path

import click
from tqdm import tqdm

from distretarget.bvh import read_bvh, write_bvh
from distretarget.cli.figures import Figures
from distretarget.errors import DistretargetError, FileError, MatchingError
from distretarget.files import check_writable, write_whole
from distretarget.retarget import OBJECTIVES, Objective, retarget
from distretarget.skeleton_json import load_target


@click.command("retarget")
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="The BVH file to write.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced.")
@click.option(
    "--root-scale",
    type=click.FloatRange(min=0, min_open=True),
    metavar="FACTOR",
    help="Target units per source unit of the root's path. Default: the ratio of leg lengths.",
)
@click.option(
    "--objective",
    type=click.Choice(OBJECTIVES),
    default=OBJECTIVES[0],
    show_default=True,
    help="contact: what is near stays near, the rest as it was. paper: the distances and priorities of the paper.",
)
@click.option(
    "--feet",
    type=click.Choice(["hold", "free"]),
    help="hold: feet at rest keep their place and height; the contact objective does unless told otherwise. "
    "free: feet follow the legs, as they do with the paper's objective.",
)
@click.option(
    "--json", "figures", type=click.Path(path_type=Path), help="Write the figures of each frame to this file."
)
def retarget_command(
    source: Path,
    target: Path,
    output: Path,
    overwrite: bool,
    root_scale: float | None,
    objective: Objective,
    feet: str | None,
    figures: Path | None,
) -> None:
    r"""Carry the motion of SOURCE, a BVH file, over to the body of TARGET.

    TARGET is a skeleton file (.json) or any BVH file with the body wanted.

    \b
    distretarget walk.bvh child.json -o walk_child.bvh
    distretarget walk.bvh hero.bvh -o walk_hero.bvh --json walk_hero.figures.json
    """
    if feet == "hold" and objective == "paper":
        raise click.UsageError("--feet hold: the paper's objective knows no feet; use --objective contact.")
    outputs = [path for path in (output, figures) if path]
    _check_outputs(outputs, [source, target], overwrite)
    started = time.perf_counter()
    motion = read_bvh(source)
    goal = load_target(target, motion.rigid_skeleton)
    with tqdm(total=len(motion), unit=" frames", desc=source.name, disable=None, leave=False) as bar:
        try:
            result = retarget(
                motion,
                goal.skeleton,
                objective=objective,
                hold_feet=feet != "free",
                joint_map=goal.map,
                root_scale=root_scale,
                progress=bar.update,
            )
        except MatchingError as error:
            raise FileError(target, str(error)) from error
        except DistretargetError as error:
            raise FileError(source, str(error)) from error
    write_bvh(output, result.motion, overwrite=overwrite)
    seconds = time.perf_counter() - started
    run = Figures(result)
    if figures:
        write_whole(figures, run.json(), overwrite=overwrite)
    for warning in run.warnings():
        click.echo(f"warning: {warning}", err=True)
    click.echo(run.line(seconds))


def _check_outputs(outputs: list[Path], inputs: list[Path], overwrite: bool) -> None:
    """Refuse, before any work, outputs that cannot be written or are inputs or each other."""
    for number, path in enumerate(outputs):
        for other, what in [
            *((i, "an input") for i in inputs),
            *((o, "another output") for o in outputs[:number]),
        ]:
            if path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other)):
                raise FileError(path, f"is {what} as well; give the output another name")
        check_writable(path, overwrite=overwrite)
