"""The pictures of docs/paper.md: postures beside the original, as in the paper's figures, and a walk."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from draw import VIEWS, Camera, Cell, body_height, draw_strip, write_picture
from numpy.typing import NDArray
from paper_case import GROUPS, PERCENT, POSTURE, case, on_table_one
from scipy.spatial.transform import Rotation

from distretarget import Skeleton

Array = NDArray[np.float64]

DOTS = 100  # per inch
SPINE = "spine +60 %"
WALK = "arms +60 %, legs -30 %"
STEPS = (31, 61, 92, 123)  # frames of the walk, half a step apart


def draw_pictures(folder: Path) -> None:
    """Draw every picture into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_edits(folder / "paper_edits.png")
    draw_spine(folder / "paper_spine.png")
    draw_walk(folder / "paper_walk.png")


def draw_edits(path: Path) -> None:
    """Draw a row for each group of bones: the original, and the paper's points for each percentage."""
    source = on_table_one("walk")
    scenes = [[figure(source.skeleton, source.positions[POSTURE]), *edited_figures(group)] for group in GROUPS]
    labels = ["original", *(f"{percent:+d} %" for percent in PERCENT)]
    write_picture(scenes, list(GROUPS), [labels] * len(scenes), path, camera=Camera(*VIEWS["side"]), dpi=DOTS)


def edited_figures(group: str) -> Iterator[Cell]:
    """The paper's points for each percentage."""
    for percent in PERCENT:
        one = case(f"{group} {percent:+d} %")
        yield figure(one.target, one.paper.postures.positions[POSTURE])


def draw_spine(path: Path) -> None:
    """Draw the posture on the long spine by every method, from the side and from the front."""
    one = case(SPINE)
    postures = {"original": one.source.positions, **one.postures()}
    scenes = [
        [figure(one.target, points[POSTURE], turn) for points in postures.values()]
        for turn in (Rotation.identity(), Rotation.from_euler("Y", -90, degrees=True))
    ]
    write_picture(
        scenes,
        [f"{SPINE}, from the side", "from the front"],
        [list(postures)] * 2,
        path,
        camera=Camera(*VIEWS["side"]),
        dpi=DOTS,
    )


def draw_walk(path: Path) -> None:
    """Draw frames of the walk by every method."""
    one = case(WALK)
    rows = [
        ("original", one.source),
        (f"rotation copy, {WALK}", one.paper.rotation_copy),
        ("paper, exact bones", one.paper.motion),
        ("contact", one.contact.motion),
    ]
    draw_strip(rows, list(STEPS), path, view="side", same_scale=True)


def figure(skeleton: Skeleton, points: Array, turn: Rotation | None = None) -> Cell:
    """A posture, (joints, 3), with its hips above the origin and its lowest joint on the floor, at the original's
    scale; turned about the vertical.
    """
    points = (turn or Rotation.identity()).apply(points)
    size = body_height(on_table_one("walk").skeleton)
    ground = np.array([points[0, 0], points[:, 1].min(), points[0, 2]])
    return Cell(skeleton, (points - ground) / size, np.zeros(3), 1.0)
