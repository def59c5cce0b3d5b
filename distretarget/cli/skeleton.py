"""`distretarget skeleton`: look at skeletons and turn them into files to edit."""

from __future__ import annotations

from pathlib import Path

import click

from distretarget.body import find_legs, height, leg_length
from distretarget.errors import FileError
from distretarget.files import check_writable, write_whole
from distretarget.skeleton import Skeleton
from distretarget.skeleton_json import load_skeleton, skeleton_to_json


@click.group("skeleton")
def skeleton_group() -> None:
    """Look at skeletons and write skeleton files."""


@skeleton_group.command("show")
@click.argument("file", type=click.Path(path_type=Path))
def show_command(file: Path) -> None:
    r"""Print the tree of FILE, a BVH or skeleton file, with its bone lengths.

    \b
    distretarget skeleton show walk.bvh
    """
    skeleton = load_skeleton(file)
    click.echo(_headline(skeleton))
    for line in _tree(skeleton):
        click.echo(line.encode("utf-8", "backslashreplace").decode())


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
    r"""Write the skeleton of FILE as a target skeleton file, to edit and retarget to.

    \b
    distretarget skeleton export hero.bvh -o hero.json
    """
    if output:
        if output.resolve() == file.resolve():
            raise FileError(output, "is the input as well; give the output another name")
        check_writable(output, overwrite=overwrite)
    text = skeleton_to_json(load_skeleton(file), file.stem)
    if output:
        write_whole(output, text, overwrite=overwrite)
    else:
        click.echo(text, nl=False)


def _headline(skeleton: Skeleton) -> str:
    unit = f" {skeleton.units}" if skeleton.units else ""
    ends = int(skeleton.end_sites.sum())
    legs = find_legs(skeleton)
    leg = f", legs {leg_length(skeleton, legs):.6g}{unit}" if legs else ""
    return f"{len(skeleton) - ends} joints, {ends} End Sites; height {height(skeleton):.6g}{unit}{leg}"


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
