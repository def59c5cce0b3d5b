"""`distretarget retarget`: one clip."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import get_args

import click
from tqdm import tqdm

from distretarget.bvh import read_bvh, write_bvh
from distretarget.cli.figures import Figures
from distretarget.cli.matching_table import headline, unused, without_driver
from distretarget.cli.outputs import about, check_outputs, needs_map, say
from distretarget.cli.parameters import positive
from distretarget.diff import Diff, turned_note
from distretarget.errors import DistretargetError, FileError, MatchingError, quoted
from distretarget.files import write_whole
from distretarget.joint_map import joint_map
from distretarget.matching import Matching
from distretarget.report.document import document
from distretarget.report.page import page
from distretarget.retarget import OBJECTIVES, Objective, RetargetResult, retarget
from distretarget.skeleton_json import load_target
from distretarget.world import AXES, RootOffset

LISTED = 12  # joints in a line of --verbose, at most


@click.command("retarget")
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="The BVH file to write.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced.")
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help='A JSON file with {"target joint": "source joint"}, null for joints that nothing drives. Its pairs count '
    "before those in the target's file; joints in neither are matched by names or shape.",
)
@click.option(
    "--root-scale",
    type=positive,
    metavar="FACTOR",
    help="Target units per source unit of the root's path. Default: the ratio of leg lengths.",
)
@click.option("--source-up", type=click.Choice(AXES), help="The axis that points up in SOURCE. Default: found.")
@click.option(
    "--target-up",
    type=click.Choice(AXES),
    help="The axis that points up in TARGET and in the output. Default: what the target's file says; else found.",
)
@click.option(
    "--root-offset",
    type=click.Choice(get_args(RootOffset)),
    help="Whether the position of the source's root replaces its OFFSET or is added to it. Default: whichever puts the "
    "feet on the floor.",
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
@click.option(
    "--report",
    type=click.Path(path_type=Path),
    help="Write an HTML report to this file: the result, and the rotation copy, measured against the source.",
)
@click.option(
    "-v", "--verbose", is_flag=True, help="Tell what was recognised and matched, and how the source's world was taken."
)
def retarget_command(
    source: Path,
    target: Path,
    output: Path,
    overwrite: bool,
    map_path: Path | None,
    root_scale: float | None,
    source_up: str | None,
    target_up: str | None,
    root_offset: RootOffset | None,
    objective: Objective,
    feet: str | None,
    figures: Path | None,
    report: Path | None,
    verbose: bool,
) -> None:
    """Carry the motion of SOURCE, a BVH file, over to the body of TARGET.

    TARGET is a skeleton file (.json) or any BVH file with the body wanted. Its joints may have other names, another
    rest pose and other axes than those of SOURCE; 'distretarget skeleton match' shows which joint drives which.

    \b
    distretarget walk.bvh child.json -o walk_child.bvh
    distretarget walk.bvh hero.bvh -o walk_hero.bvh --json walk_hero.figures.json
    distretarget walk.bvh hero.bvh -o walk_hero.bvh --report walk_hero.html
    distretarget walk.bvh robot.bvh -o walk_robot.bvh --map walk_robot.map.json -v
    """  # noqa: D301
    if feet == "hold" and objective == "paper":
        raise click.UsageError("--feet hold: the paper's objective knows no feet; use --objective contact.")
    check_outputs([output, figures, report], [source, target, map_path], overwrite)
    started = time.perf_counter()
    motion = read_bvh(source)
    goal = load_target(target, motion.rigid_skeleton)
    pairs = joint_map(motion.rigid_skeleton, goal, target, map_path)
    with tqdm(total=len(motion), unit=" frames", desc=source.name, disable=None, leave=False) as bar:
        try:
            result = retarget(
                motion,
                goal.skeleton,
                objective=objective,
                hold_feet=feet != "free",
                joint_map=pairs,
                root_scale=root_scale,
                source_up=source_up,
                target_up=target_up,
                root_offset=root_offset,
                target_motion=goal.motion,
                progress=bar.update,
            )
        except MatchingError as error:
            raise needs_map(error, source, target) from error
        except DistretargetError as error:
            raise FileError(source, str(error)) from error
    write_bvh(output, result.motion, overwrite=overwrite)
    seconds = time.perf_counter() - started
    run = Figures(result)
    if figures:
        write_whole(figures, run.json(), overwrite=overwrite)
    if report:
        write_whole(report, _report(run, source, output), overwrite=overwrite)
    for line in _account(result) if verbose else _unmatched(result.matching):
        say(line, err=True)
    for warning in run.warnings():
        click.echo(f"warning: {warning}", err=True)
    click.echo(run.line(seconds))


def _report(run: Figures, source: Path, output: Path) -> str:
    """The page of the result and the rotation copy against the source."""
    result, up = run.result, run.result.world.up_vector
    notes = turned_note(result.world)
    diff = Diff(result.source, result.motion, result.matching, up, result.written_stress, run.reached, notes)
    named = replace(about(source, output), copy=run.copied, copy_stress=result.copy_stress)
    return page(diff, document(diff, named))


def _unmatched(matching: Matching) -> Iterator[str]:
    """A warning of joints that follow their parents, if there are any."""
    if joints := _followers(matching):
        many = f"{len(joints)} joints of the target have no counterpart and follow their parents"
        one = "1 joint of the target has no counterpart and follows its parent"
        yield f"warning: {one if len(joints) == 1 else many}: {quoted(joints)}; see -v"


def _followers(matching: Matching) -> list[str]:
    """The joints without a counterpart below the root, which has no parent to follow."""
    return [key for key in without_driver(matching) if key != matching.target.keys[0]]


def _account(result: RetargetResult) -> Iterator[str]:
    """What was recognised and matched, and how the source's world was taken."""
    yield from headline(result.matching)
    for what, joints in (
        ("joints of the target that follow their parents", _followers(result.matching)),
        ("joints of the source not used", unused(result.matching)),
    ):
        yield f"{what}: {quoted(joints, LISTED) or 'none'}"
    world = result.world
    turned = (
        "the same in the target" if world.up == world.source_up else f"{world.up} in the target: the world is turned"
    )
    yield f"up: {world.source_up} in the source, {turned}"
    yield _root_offset(result)
    yield f"root scale: {result.root_scale:.6g} target units per source unit"


def _root_offset(result: RetargetResult) -> str:
    """What the root's OFFSET does."""
    offset = result.source.skeleton.offsets[0]
    if not offset.any():
        return "the source's root has OFFSET 0: replaced or added to, it is the same"
    other = next(choice for choice in get_args(RootOffset) if choice != result.world.root_offset)
    does = {"replaced": "replaces it", "added": "is added to it"}[result.world.root_offset]
    numbers = " ".join(f"{number:.6g}" for number in offset)
    return f"the source's root has OFFSET {numbers}: its position {does}; --root-offset {other} for the other reading"
