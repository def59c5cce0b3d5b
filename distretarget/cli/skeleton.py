"""`distretarget skeleton`: look at skeletons, change and match them, and turn them into files to edit."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path

import click
import numpy as np

from distretarget.body.body import Body
from distretarget.cli.matching_table import headline, recognised, rows, unused
from distretarget.cli.outputs import check_outputs, say
from distretarget.cli.parameters import of_bone, positive
from distretarget.errors import FileError, closest
from distretarget.io.bvh import read_bvh
from distretarget.io.files import read_text, write_whole
from distretarget.io.map_json import joint_map, load_map, map_to_json
from distretarget.io.skeleton_json import (
    SkeletonEdit,
    is_json,
    load_full_target,
    load_target,
    skeleton_to_json,
)
from distretarget.matching.matching import find_matching, refusal
from distretarget.skeleton import Skeleton


@click.group("skeleton")
def skeleton_group() -> None:
    """Look at skeletons, match them, and write skeleton files."""


@skeleton_group.command("show")
@click.argument("file", type=click.Path(path_type=Path))
def show_command(file: Path) -> None:
    """Print the tree of FILE, a BVH or skeleton file, with its bone lengths.

    \b
    distretarget skeleton show walk.bvh
    """  # noqa: D301
    skeleton = load_full_target(file).skeleton
    for line in (_headline(skeleton), *_tree(skeleton)):
        say(line)


@skeleton_group.command("export")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="The skeleton file to write; else standard output.",
)
@click.option("--overwrite", is_flag=True, help="Replace the output if it exists.")
def export_command(file: Path, output: Path | None, overwrite: bool) -> None:
    """Write the skeleton of FILE as a target skeleton file, to edit and retarget to.

    \b
    distretarget skeleton export hero.bvh -o hero.json
    """  # noqa: D301
    check_outputs([output], [file], overwrite)
    body = load_full_target(file)
    text = skeleton_to_json(body.skeleton, body.name or file.stem, body.map)
    if output:
        write_whole(output, text, overwrite=overwrite)
    else:
        click.echo(text, nl=False)


@skeleton_group.command("edit")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--scale", type=positive, metavar="FACTOR", help="What all bones and the root's offset are multiplied by."
)
@click.option(
    "--length",
    "lengths",
    type=of_bone,
    multiple=True,
    metavar="BONE=LENGTH",
    help="The final length of a bone, in the file's units, whatever the scale. May be given several times.",
)
@click.option(
    "--factor",
    "factors",
    type=of_bone,
    multiple=True,
    metavar="BONE=FACTOR",
    help="What a bone is multiplied by, besides the scale. May be given several times.",
)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="The skeleton file to write.")
@click.option("--overwrite", is_flag=True, help="Replace the output if it exists.")
def edit_command(
    file: Path,
    scale: float | None,
    lengths: tuple[tuple[str, float], ...],
    factors: tuple[tuple[str, float], ...],
    output: Path,
    overwrite: bool,
) -> None:
    """Write the skeleton of FILE with other bone lengths as a target skeleton file.

    A BONE is named by its lower joint, or several by a pattern with * and ?: 'Left*' is every bone whose name begins
    with Left and that has a length. Each bone may be named once.

    \b
    distretarget skeleton edit hero.bvh --scale 1.1 -o tall_hero.json
    distretarget skeleton edit hero.bvh --length LeftLeg=42 --factor '*ForeArm=1.5' -o other_hero.json
    """  # noqa: D301
    if scale is None and not lengths and not factors:
        raise click.UsageError("nothing to change; give --scale, --length or --factor.")
    check_outputs([output], [file], overwrite)
    body = load_full_target(file)
    options = [
        *(("--length", name, number) for name, number in lengths),
        *(("--factor", name, number) for name, number in factors),
    ]
    chosen = _bones(file, body.skeleton, options)
    per_option = {
        option: {key: number for key, (by, _, number) in chosen.items() if by == option}
        for option in ("--length", "--factor")
    }
    edit = SkeletonEdit(1.0 if scale is None else scale, per_option["--length"], per_option["--factor"], file)
    edited = edit.apply(body.skeleton)
    write_whole(output, skeleton_to_json(edited, body.name or file.stem, body.map), overwrite=overwrite)
    changed = int(np.sum(edited.lengths != body.skeleton.lengths))
    unit = f" {edited.units}" if edited.units else ""
    bones = "1 bone" if changed == 1 else f"{changed} bones"
    click.echo(f"{bones} changed; height {Body.of(body.skeleton).height:.6g} -> {Body.of(edited).height:.6g}{unit}")


@skeleton_group.command("match")
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="A map file whose pairs count before all others.",
)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="The map file to write.")
@click.option("--overwrite", is_flag=True, help="Replace the output if it exists.")
def match_command(source: Path, target: Path, map_path: Path | None, output: Path | None, overwrite: bool) -> None:
    """Print which joint of SOURCE drives which joint of TARGET, and write it as a map to edit.

    Both are BVH or skeleton files. A joint is found by a map, an equal name, names of parts of the body, its shape, or
    as the tip of a matched joint. Joints of a spine or neck that has more or fewer joints in the other body turn
    between two of its joints.

    A map is given to 'distretarget retarget' with --map; it has null for joints that nothing drives.

    \b
    distretarget skeleton match walk.bvh robot.bvh
    distretarget skeleton match walk.bvh robot.bvh -o walk_robot.map.json
    """  # noqa: D301
    check_outputs([output], [source, target, map_path], overwrite)
    body = _load_body(source)
    goal = load_target(target).for_source(body.skeleton)
    pairs = joint_map(body.skeleton, goal, target, load_map(map_path))
    matching = find_matching(body, Body.of(goal.skeleton, goal.motion), pairs)
    lines = [
        *headline(matching),
        "",
        *rows(matching),
        "",
        f"joints of the target without a counterpart: {', '.join(matching.without_driver) or 'none'}",
        f"joints of the source not used: {', '.join(unused(matching)) or 'none'}",
    ]
    for line in lines:
        say(line)
    if output:
        write_whole(output, map_to_json(matching), overwrite=overwrite)
    if reason := refusal(matching):
        raise FileError(target, f"{reason}; fill in {_the_map(output)} and give it with --map")


def _the_map(output: Path | None) -> str:
    return str(output) if output else "a map, which -o MAP.json writes,"


def _load_body(path: Path) -> Body:
    """The body in a BVH or skeleton file."""
    return Body.of(load_full_target(path).skeleton) if is_json(read_text(path)) else Body.of_motion(read_bvh(path))


def _bones(
    file: Path, skeleton: Skeleton, options: Iterable[tuple[str, str, float]]
) -> dict[str, tuple[str, str, float]]:
    """Per bone the option that names it: (option, name or pattern, number).

    Raises:
        FileError: an option names no bone, or two name the same.
    """
    chosen: dict[str, tuple[str, str, float]] = {}
    for option, name, number in options:
        bones = [key for key, length in zip(skeleton.keys, skeleton.lengths, strict=True) if length > 0]
        named = [name] if name in skeleton.keys else [key for key in bones if fnmatchcase(key, name)]
        if not named:
            raise FileError(file, f"{option} {name}: no such bone; {closest(name, bones)}")
        for key in named:
            if key in chosen:
                other, pattern, _ = chosen[key]
                both = f"{other} {pattern} and {option} {name}"
                raise FileError(file, f"{both} are both for the bone {key!r}; each bone may be named once")
            chosen[key] = option, name, number
    return chosen


def _headline(skeleton: Skeleton) -> str:
    unit = f" {skeleton.units}" if skeleton.units else ""
    ends = int(skeleton.end_sites.sum())
    body = Body.of(skeleton)
    legs = f", legs {body.leg_length:.6g}{unit}" if body.legs else ""
    size = f"height {body.height:.6g}{unit}{legs}"
    return f"{len(skeleton) - ends} joints, {ends} End Sites; {size}; {recognised(body)}"


def _tree(skeleton: Skeleton) -> list[str]:
    """One line per joint: branches, name, length of its bone."""
    lines = [(skeleton.names[0], "")]
    _branches(skeleton, lines)
    width = max(len(name) for name, _ in lines) + 2
    return [f"{name:<{width}}{length}".rstrip() for name, length in lines]


def _branches(skeleton: Skeleton, lines: list[tuple[str, str]]) -> None:
    indents = {0: ""}
    for joint in skeleton.depth_first[1:]:
        parent = int(skeleton.parents[joint])
        last = joint == skeleton.children[parent][-1]
        lines.append(
            (
                indents[parent] + ("└─ " if last else "├─ ") + skeleton.names[joint],
                f"{skeleton.lengths[joint]:10.4f}{'  End Site' if skeleton.end_sites[joint] else ''}",
            )
        )
        indents[joint] = indents[parent] + ("   " if last else "│  ")
