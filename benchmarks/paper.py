"""Repeat the paper's experiment: write the tables of docs/paper.md and draw its pictures.

    python benchmarks/paper.py

The pictures show postures beside the original, as in the paper's metrics, and a walk. Takes half a minute. Needs
matplotlib (the extra `docs`).
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from clips import ROOT
from draw import VIEWS, Cell, body_height, cells, tallest, write_picture
from numpy.typing import NDArray
from paper_case import GROUPS, PERCENT, POSTURE, case, on_table_one
from paper_tables import LONG_SPINE, tables
from scipy.spatial.transform import Rotation
from tables import publish

from distretarget import Skeleton

DPI = 100
WALK = "arms +60 %, legs -30 %"
STEPS = (31, 61, 92, 123)  # frames of the walk, half a step apart


def draw_edits(path: Path) -> None:
    """Draw a row for each group of bones: the original, and the paper's points for each percentage."""
    source = on_table_one("walk")
    scenes = []
    for group in GROUPS:
        edits = [case(f"{group} {percent:+d} %") for percent in PERCENT]
        points = [metric(one.target, one.paper.postures.positions[POSTURE]) for one in edits]
        scenes.append([metric(source.skeleton, source.positions[POSTURE]), *points])
    labels = ["original", *(f"{percent:+d} %" for percent in PERCENT)]
    write_picture(path, scenes, list(GROUPS), [labels] * len(scenes), VIEWS["side"], DPI)


def draw_spine(path: Path) -> None:
    """Draw the posture on the long spine by every method, from the side and from the front."""
    one = case(LONG_SPINE)
    postures = {"original": one.source.positions, **one.postures()}
    turns = Rotation.identity(), Rotation.from_euler("Y", -90, degrees=True)
    scenes = [[metric(one.target, turn.apply(points[POSTURE])) for points in postures.values()] for turn in turns]
    titles = [f"{LONG_SPINE}, from the side", "from the front"]
    write_picture(path, scenes, titles, [list(postures)] * 2, VIEWS["side"], DPI)


def draw_walk(path: Path) -> None:
    """Draw frames of the walk by every method, all in the same scale."""
    one = case(WALK)
    rows = {"original": one.source, f"rotation copy, {WALK}": one.paper.rotation_copy}
    rows |= {"paper, exact bones": one.paper.motion, "contact": one.contact.motion}
    scenes = [cells(motion, STEPS, tallest(rows.values())) for motion in rows.values()]
    write_picture(path, scenes, list(rows), [[f"frame {frame}" for frame in STEPS]] * len(rows), VIEWS["side"])


def metric(skeleton: Skeleton, points: NDArray[np.float64]) -> Cell:
    """A posture, (joints, 3), at the original's scale, its hips above the origin and its lowest joint on the floor."""
    size = body_height(on_table_one("walk").skeleton)
    ground = np.array([points[0, 0], points[:, 1].min(), points[0, 2]])
    return Cell(skeleton, (points - ground) / size, np.zeros(3))


@click.command(help=__doc__)
def main() -> None:
    """Write the page's tables, and draw its pictures."""
    publish(tables(), ROOT / "docs" / "paper.md")
    for name, draw in (("edits", draw_edits), ("spine", draw_spine), ("walk", draw_walk)):
        draw(ROOT / "docs" / "pictures" / f"paper_{name}.png")


if __name__ == "__main__":
    main()
