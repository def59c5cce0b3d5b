"""Draw motions as stick figures in a row, with a floor and soft shadows.

    python tools/draw.py walk.bvh child_walk.bvh --frames 0,20,40 -o walk.png --view three-quarter

Each motion is a row, with its frames from left to right. With `--columns`, each frame is a row, with the motions side
by side.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray
from PIL import Image

from distretarget.io.bvh import read_bvh
from distretarget.motion import Motion
from distretarget.skeleton import Skeleton

VIEWS = {"front": (0.0, 10.0), "side": (90.0, 10.0), "three-quarter": (38.0, 16.0)}
COLOURS = {"left": "#2a7f9e", "right": "#e0793a", "trunk": "#3b4252"}
FLOOR, GRID, LABEL = "#f6f7f9", "#dfe3e8", "#3b4252"
# A shadow is drawn in three layers, each as (thickness in body heights, colour).
SHADOW = ((0.060, "#eceef1"), (0.044, "#e2e5e9"), (0.028, "#d8dce1"))
LIGHT = (0.10, -0.28)  # how far a shadow goes to the right and nearer, per height above the floor
INCHES_PER_HEIGHT = 2.3  # size of a body of height 1 in the picture
POINTS_PER_HEIGHT = 72 * INCHES_PER_HEIGHT
THICKNESS = 0.027  # of a bone [body heights]
DEPTH = 0.42  # of the strip of floor in front of the body, and behind it [body heights]
ON_THE_SPOT = 0.4  # a root that moves less than this is drawn where it is, not moved to the origin [body heights]
COLOURS_OF_A_PICTURE = 64  # a smaller file than with all
MARGIN = np.array([0.08, 0.15])  # around a figure, across and upward [body heights]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """An orthographic view; `azimuth` turns it from the front to the right side, in degrees."""

    azimuth: float
    elevation: float

    @property
    def slope(self) -> float:
        """How much of the floor's depth the camera sees: 1 from above, 0 from the side."""
        return float(np.sin(np.radians(self.elevation)))

    @property
    def right(self) -> Array:
        """(3,), the horizontal direction that points to the right on the screen."""
        a = np.radians(self.azimuth)
        return np.array([np.cos(a), 0.0, np.sin(a)])

    @property
    def near(self) -> Array:
        """(3,), the horizontal direction that points towards the camera."""
        a = np.radians(self.azimuth)
        return np.array([-np.sin(a), 0.0, np.cos(a)])

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Screen coordinates (..., 2) of points (..., 3), Y up, and how near they are to the camera (...)."""
        e = np.radians(self.elevation)
        height = points[..., 1]
        upward = height * np.cos(e) - points @ self.near * np.sin(e)
        nearness = height * np.sin(e) + points @ self.near * np.cos(e)
        return np.stack([points @ self.right, upward], axis=-1), nearness


@dataclass(frozen=True)
class Cell:
    """One stick figure.

    Attributes:
        skeleton: parents and names of the joints.
        points: (joints, 3), Y up, in body heights, the origin on the floor below the body.
        ground: (3,), where in the world the origin is [body heights].
        size: of the body, relative to the height that counts as 1.
    """

    skeleton: Skeleton
    points: Array
    ground: Array
    size: float


def _upright(points: Array, up: str) -> Array:
    """Points with the axis `up` ("Y", "-Z", ...) turned to Y."""
    axis, sign = "XYZ".index(up[-1]), -1.0 if up.startswith("-") else 1.0
    turn = np.zeros((3, 3))
    turn[1, axis] = sign
    first, second = {0: (1, 2), 1: (0, 2), 2: (0, 1)}[axis]
    turn[0, first] = 1.0
    turn[2, second] = 1.0
    turn[2] *= np.linalg.det(turn)
    return points @ turn.T


def cells(
    motion: Motion, frames: Sequence[int], up: str | None, size: float | None, floor: float | None = None
) -> list[Cell]:
    """The frames as figures, each moved to the origin; moved by one vector if the motion stays on the spot.

    Lengths are divided by `size`, by default the height of the body. `floor` is how high the floor is [file units], by
    default as high as the lowest joint of all frames.
    """
    points = _upright(motion.positions, up or motion.skeleton.up or "Y")
    height = body_height(motion.skeleton)
    size = size or height
    points = points / size
    points[..., 1] -= points[..., 1].min() if floor is None else floor / size
    grounds = points[frames, 0] * (1, 0, 1)
    if np.all(np.ptp(grounds, axis=0) < ON_THE_SPOT):
        grounds[:] = grounds.mean(axis=0)
    return [
        Cell(motion.skeleton, points[frame] - ground, ground, height / size)
        for frame, ground in zip(frames, grounds, strict=True)
    ]


def body_height(skeleton: Skeleton) -> float:
    """Approximate height of the standing body, whatever its rest pose [file units]."""
    return 0.7 * float(skeleton.path_lengths.max())


def _chains(skeleton: Skeleton) -> Iterator[list[int]]:
    """Chains of joints between the root, joints with several children, and the ends."""
    for joint in skeleton.depth_first[1:]:
        parent = int(skeleton.parents[joint])
        if parent and len(skeleton.children[parent]) == 1:
            continue
        chain = [parent, joint]
        while len(skeleton.children[chain[-1]]) == 1:
            chain.append(skeleton.children[chain[-1]][0])
        yield chain


def side_of(name: str) -> str:
    """The side of the body that a joint's name tells: left, right, or trunk if it tells none."""
    for side, letter in (("left", "l"), ("right", "r")):
        if side in name.lower() or re.search(rf"(^|[_.:]){letter}([_.]|$)", name.lower()):
            return side
    return "trunk"


def _draw_figure(ax: Axes, cell: Cell, camera: Camera, shift: float) -> None:
    """Draw a figure, moved by `shift` to the right."""
    screen, nearness = camera(cell.points)
    screen[:, 0] += shift
    width = THICKNESS * POINTS_PER_HEIGHT * cell.size
    _draw_shadow(ax, cell, camera, shift)
    chains = sorted(_chains(cell.skeleton), key=lambda chain: nearness[chain[1:]].mean())
    for order, chain in enumerate(chains, start=10):
        side = side_of(cell.skeleton.names[chain[-1]])
        line = {"solid_capstyle": "round", "solid_joinstyle": "round", "zorder": order}
        thick = width * (1.15 if side == "trunk" else 1.0)
        if _is_head(cell.skeleton, chain):
            _draw_head(ax, *screen[chain[-2:]], order)
            chain = chain[:-1]
        ax.plot(*screen[chain].T, color="white", linewidth=thick + 0.35 * width, **line)
        ax.plot(*screen[chain].T, color=COLOURS[side], linewidth=thick, **line)
        ax.plot(*screen[chain].T, "o", color="white", markersize=0.4 * width, markeredgewidth=0, zorder=order)


def _is_head(skeleton: Skeleton, chain: Sequence[int]) -> bool:
    neck, top = chain[-2:]
    return bool(skeleton.end_sites[top]) and "head" in skeleton.names[neck].lower()


def _draw_head(ax: Axes, neck: Array, top: Array, order: int) -> None:
    """Draw a disc in place of the head's bone."""
    centre = 0.42 * neck + 0.58 * top
    radius = 0.52 * float(np.hypot(*(top - neck)))
    ax.add_patch(Circle(tuple(centre), radius, facecolor=COLOURS["trunk"], edgecolor="white", zorder=order))


def _draw_shadow(ax: Axes, cell: Cell, camera: Camera, shift: float) -> None:
    shadow = cell.points * (1, 0, 1) + cell.points[:, 1:2] * (LIGHT[0] * camera.right + LIGHT[1] * camera.near)
    screen = camera(shadow)[0]
    screen[:, 0] += shift
    for level, (thickness, colour) in enumerate(SHADOW):
        for chain in _chains(cell.skeleton):
            ax.plot(
                *screen[chain].T,
                color=colour,
                linewidth=thickness * POINTS_PER_HEIGHT * cell.size,
                solid_capstyle="round",
                solid_joinstyle="round",
                zorder=3 + level,
            )


def _draw_floor(ax: Axes, camera: Camera, ground: Array) -> None:
    """Draw a strip of floor with the grid of the world, four lines per body height."""
    left, right = ax.get_xlim()
    depth = DEPTH * camera.slope
    strip = Rectangle((left, -depth), right - left, 2 * depth, facecolor=FLOOR, zorder=1)
    ax.add_patch(strip)
    reach = np.ceil(right - left) + 2
    for across, along in ((0, 2), (2, 0)):
        for tick in np.arange(-reach, reach, 0.25):
            ends = np.zeros((2, 3))
            ends[:, across], ends[:, along] = tick, (-reach, reach)
            screen = camera(ends - ground % 0.25)[0]
            (line,) = ax.plot(*screen.T, color=GRID, linewidth=0.7, zorder=2)
            line.set_clip_path(strip)


@dataclass(frozen=True)
class Stage:
    """What every cell of a picture shows: a part of the screen of a camera [body heights]."""

    camera: Camera
    left: float
    right: float
    low: float
    high: float

    @classmethod
    def around(cls, cells: Iterable[Cell], camera: Camera) -> Stage:
        """The smallest part of the screen with all figures, a margin and the floor."""
        screen = np.concatenate([camera(cell.points)[0] for cell in cells])
        left, low = screen.min(axis=0) - MARGIN
        right, high = screen.max(axis=0) + MARGIN
        return cls(camera, left, right, min(low, -DEPTH * camera.slope - MARGIN[0]), high)

    @property
    def pitch(self) -> float:
        """The width of a cell [body heights]."""
        return self.right - self.left

    def draw(self, ax: Axes, cells: Sequence[Cell], labels: Sequence[str]) -> None:
        """Draw figures from left to right on one floor, above the labels; equally many for each label."""
        ax.set(xlim=(self.left, self.left + self.pitch * len(labels)), ylim=(self.low, self.high))
        ax.axis("off")
        _draw_floor(ax, self.camera, cells[0].ground)
        for number, cell in enumerate(cells):
            _draw_figure(ax, cell, self.camera, number * len(labels) // len(cells) * self.pitch)
        for number, label in enumerate(labels):
            middle = self.left + (number + 0.5) * self.pitch
            ax.text(middle, self.low + 0.03, label, ha="center", color=LABEL, fontsize=8)


def _grid(
    rows: Sequence[tuple[str, Motion]], frames: Sequence[int], up: str | None, same_scale: bool
) -> list[list[Cell]]:
    """The cells of each motion.

    Raises:
        ValueError: a motion lacks one of the frames.
    """
    for label, motion in rows:
        if max(frames) >= len(motion):
            raise ValueError(f"{label} has frames 0 to {len(motion) - 1}, not {max(frames)}")
    size = max(body_height(motion.skeleton) for _, motion in rows) if same_scale else None
    return [cells(motion, frames, up, size) for _, motion in rows]


def draw_strip(
    rows: list[tuple[str, Motion]],
    frames: list[int],
    path: str | Path,
    *,
    view: str = "three-quarter",
    up: str | None = None,
    columns: bool = False,
    same_scale: bool = False,
) -> None:
    """Draw frames of motions as stick figures into a picture file.

    Args:
        rows: a label and a motion for each row.
        frames: the numbers of the frames, from left to right.
        path: of the picture; its suffix is the format.
        view: "front", "side" or "three-quarter", for a body that faces +Z with Y up.
        up: the axis that points up; by default that of the skeleton, or "Y" if it has none.
        columns: make each frame a row, with the motions side by side.
        same_scale: keep the relative sizes of the bodies; otherwise all are drawn equally tall.
    """
    camera = Camera(*VIEWS[view])
    scenes = _grid(rows, frames, up, same_scale)
    titles = [label for label, _ in rows]
    labels = [[f"frame {frame}" for frame in frames]] * len(rows)
    if columns:
        scenes = [list(scene) for scene in zip(*scenes, strict=True)]
        titles, labels = [f"frame {frame}" for frame in frames], [titles] * len(frames)
    write_picture(scenes, titles, labels, path, camera=camera)


def draw_together(
    columns: Sequence[tuple[str, Sequence[Motion]]], frame: int, path: str | Path, *, view: str = "three-quarter"
) -> None:
    """Draw one frame of several scenes side by side, each of motions in one world with Y up, all in the same scale."""
    camera = Camera(*VIEWS[view])
    size = max(body_height(motions[0].skeleton) for _, motions in columns)
    scenes = []
    for _, motions in columns:
        points = [motion.positions[frame] / size for motion in motions]
        everything = np.concatenate(points)
        ground = np.array([*(everything.min(axis=0) + everything.max(axis=0)) / 2.0]) * (1, 0, 1)
        scenes.append(
            [Cell(motion.skeleton, x - ground, ground, 1.0) for motion, x in zip(motions, points, strict=True)]
        )
    screen = np.concatenate([camera(cell.points)[0] for scene in scenes for cell in scene])
    left, low = screen.min(axis=0) - MARGIN
    right, high = screen.max(axis=0) + MARGIN
    low, pitch = min(low, -DEPTH * camera.slope - MARGIN[0]), right - left
    figure = Figure((pitch * len(columns) * INCHES_PER_HEIGHT, (high - low) * INCHES_PER_HEIGHT), dpi=150)
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(left, left + pitch * len(columns)), ylim=(low, high))
    ax.axis("off")
    _draw_floor(ax, camera, np.zeros(3))
    for number, ((label, _), scene) in enumerate(zip(columns, scenes, strict=True)):
        for cell in scene:
            _draw_figure(ax, cell, camera, number * pitch)
        ax.text(left + (number + 0.5) * pitch, low + 0.03, label, ha="center", color=LABEL, fontsize=8)
    figure.savefig(path, facecolor="white")


def write_picture(
    scenes: Sequence[Sequence[Cell]],
    titles: Sequence[str],
    labels: Sequence[Sequence[str]],
    path: str | Path,
    *,
    camera: Camera,
    dpi: int = 150,
) -> None:
    """Draw scenes below each other, with equal spacing, a title for each and a label for each of their cells."""
    stage = Stage.around([cell for scene in scenes for cell in scene], camera)
    across, upward = stage.pitch * len(scenes[0]), stage.high - stage.low
    figure = Figure((across * INCHES_PER_HEIGHT, upward * len(scenes) * INCHES_PER_HEIGHT), dpi=dpi)
    for number, (scene, title, names) in enumerate(zip(scenes, titles, labels, strict=True)):
        ax = figure.add_axes((0, 1 - (number + 1) / len(scenes), 1, 1 / len(scenes)))
        ax.text(stage.left + 0.04, stage.high - 0.09, title, color=LABEL, fontsize=10, fontweight="bold")
        stage.draw(ax, scene, names)
    figure.savefig(path, facecolor="white")
    Image.open(path).convert("RGB").quantize(COLOURS_OF_A_PICTURE, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    """Draw the files named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, metavar="A.bvh")
    parser.add_argument("--frames", required=True, help="frame numbers, as 0,30,60")
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.png")
    parser.add_argument("--view", choices=VIEWS, default="three-quarter")
    parser.add_argument("--up", help="the axis that points up, as Y or -Z")
    parser.add_argument("--columns", action="store_true", help="draw motions side by side, with a row per frame")
    parser.add_argument("--same-scale", action="store_true", help="keep the relative sizes of the bodies")
    args = parser.parse_args()
    rows = [(file.stem, read_bvh(file)) for file in args.files]
    frames = [int(frame) for frame in args.frames.split(",")]
    draw_strip(rows, frames, args.output, view=args.view, up=args.up, columns=args.columns, same_scale=args.same_scale)


if __name__ == "__main__":
    main()
