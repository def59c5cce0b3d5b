"""Draw motions as stick figures on a floor, with soft shadows: still pictures, and loops as GIF files.

A body that walks stays in the middle of its cell, and the floor passes below it. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from PIL import Image
from scipy.spatial.transform import Rotation
from skeleton_edits import only

from distretarget import Motion, RetargetResult, Skeleton
from distretarget.body.axes import axis_vector
from distretarget.body.conventions import stem_and_side, words
from distretarget.numerics.vectors import Array

COLOURS = {"left": "#2a7f9e", "right": "#e0793a", None: "#3b4252"}  # of the sides of the body, and of the trunk
FLOOR, GRID, LABEL = "#f6f7f9", "#dfe3e8", "#3b4252"
SHADOW = ((0.060, "#eceef1"), (0.044, "#e2e5e9"), (0.028, "#d8dce1"))  # thickness [body heights], colour
LIGHT = (0.10, -0.28)  # offset of a shadow to the right and towards the camera, per height above the floor
INCHES_PER_HEIGHT = 2.3  # size of a body of height 1 in the picture
POINTS_PER_HEIGHT = 72 * INCHES_PER_HEIGHT
THICKNESS = 0.027  # of a bone [body heights]
DEPTH = 0.42  # of the strip of floor in front of the body, and behind it [body heights]
ON_THE_SPOT = 0.4  # a root that moves less than this keeps its path in the drawing [body heights]
STILL_COLOURS, MOVING_COLOURS = 64, 32  # of a still picture, and of all frames of a GIF together
MARGIN = np.array([0.08, 0.15])  # around a figure, across and upward [body heights]


class Camera(NamedTuple):
    """An orthographic view; `azimuth` turns it from the front to the right side, both angles in degrees."""

    azimuth: float
    elevation: float

    @property
    def slope(self) -> float:
        """The foreshortening of the floor's depth: 1 seen from above, 0 from the side."""
        return float(np.sin(np.radians(self.elevation)))

    def __call__(self, points: Array) -> Array:
        """(..., 3), screen coordinates x and y, and nearness to the camera, of points (..., 3), Y up."""
        return np.asarray(points @ Rotation.from_euler("yx", tuple(self), degrees=True).as_matrix().T)


VIEWS = {"front": Camera(0.0, 10.0), "side": Camera(90.0, 10.0), "three-quarter": Camera(38.0, 16.0)}
"""Of a body that faces +Z with Y up."""


# ---- from motions to figures


@dataclass(frozen=True)
class Cell:
    """A stick figure: points, (joints, 3), Y up, from an origin on the floor, `ground`, (3,) [body heights]."""

    skeleton: Skeleton
    points: Array
    ground: Array
    size: float = 1.0


def cells(
    motion: Motion, frames: Sequence[int], size: float, up: Array | None = None, floor: float | None = None
) -> list[Cell]:
    """Frames as figures, each moved to the origin, on the spot as a whole; lengths over `size`, `up` turned to Y."""
    turn, _ = Rotation.align_vectors([0.0, 1.0, 0.0], axis_vector(motion.skeleton.up or "Y") if up is None else up)
    points = motion.positions @ turn.as_matrix().T / size
    points[..., 1] -= points[..., 1].min() if floor is None else floor / size
    grounds = points[frames, 0] * (1, 0, 1)
    if np.all(np.ptp(grounds, axis=0) < ON_THE_SPOT):
        grounds[:] = grounds.mean(axis=0)
    return [
        Cell(motion.skeleton, points[frame] - ground, ground, body_height(motion.skeleton) / size)
        for frame, ground in zip(frames, grounds, strict=True)
    ]


def figures_of(result: RetargetResult, frames: Sequence[int]) -> list[list[Cell]]:
    """Frames of source, copy and result, equally tall, without helper joints, on the source's floor, scaled."""
    source, target, figures = result.matching.source, result.matching.target, []
    floors = source.lowest(result.world.up_vector) * np.array([1.0, result.root_scale, result.root_scale])
    motions = (result.source, source), (result.rotation_copy, target), (result.motion, target)
    for (motion, body), floor in zip(motions, floors, strict=True):
        shown = np.flatnonzero(body.regions.of_joint >= 0)
        drawn = only(motion.skeleton, shown)
        ends = ~np.isin(np.arange(len(drawn)), drawn.parents)
        drawn = replace(drawn, channels=((),) * len(drawn), end_sites=ends)
        whole = cells(motion, frames, body.height, body.up_vector, floor)
        figures.append([replace(cell, skeleton=drawn, points=cell.points[shown], size=1.0) for cell in whole])
    return figures


def body_height(skeleton: Skeleton) -> float:
    """Approximate height of the standing body, whatever its rest pose [file units]."""
    return 0.7 * skeleton.longest_path


def tallest(motions: Iterable[Motion]) -> float:
    """The height of the tallest of several bodies [file units]."""
    return max(body_height(motion.skeleton) for motion in motions)


# ---- drawing


def _chains(skeleton: Skeleton) -> Iterator[list[int]]:
    """Chains of joints from the root, or a joint with several children, to the next such joint or an end."""
    for joint in skeleton.depth_first[1:]:
        parent = int(skeleton.parents[joint])
        if parent and len(skeleton.children[parent]) == 1:
            continue
        chain = [parent, joint]
        while len(skeleton.children[chain[-1]]) == 1:
            chain.append(skeleton.children[chain[-1]][0])
        yield chain


def _draw_figure(ax: Axes, cell: Cell, camera: Camera, shift: float) -> None:
    """Draw a figure and its shadow, moved by `shift` to the right."""
    names, ends = cell.skeleton.names, cell.skeleton.end_sites
    seen = camera(cell.points) + np.array([shift, 0, 0])
    screen, nearness = seen[:, :2], seen[:, 2]
    shadow = camera(cell.points * (1, 0, 1))[:, :2] + cell.points[:, 1:2] * (LIGHT[0], -LIGHT[1] * camera.slope)
    shadow[:, 0] += shift
    chains = sorted(_chains(cell.skeleton), key=lambda chain: nearness[chain[1:]].mean())
    for order, (thickness, colour) in enumerate(SHADOW, start=3):
        for chain in chains:
            _draw_line(ax, shadow[chain], colour, thickness * POINTS_PER_HEIGHT * cell.size, order)
    width = THICKNESS * POINTS_PER_HEIGHT * cell.size
    for order, chain in enumerate(chains, start=10):
        neck, top = chain[-2:]
        side = stem_and_side(words(names[top]))[1]
        thick = width * (1.0 if side else 1.15)
        if ends[top] and "head" in names[neck].lower():  # a disc in place of the bone
            centre, radius = 0.42 * screen[neck] + 0.58 * screen[top], 0.52 * np.hypot(*(screen[top] - screen[neck]))
            ax.add_patch(Circle(tuple(centre), radius, facecolor=COLOURS[None], edgecolor="white", zorder=order))
            chain = chain[:-1]
        _draw_line(ax, screen[chain], "white", thick + 0.35 * width, order)
        _draw_line(ax, screen[chain], COLOURS[side], thick, order)
        ax.plot(*screen[chain].T, "o", color="white", markersize=0.4 * width, markeredgewidth=0, zorder=order)


def _draw_line(ax: Axes, points: Array, colour: str, width: float, order: int) -> None:
    style = {"solid_capstyle": "round", "solid_joinstyle": "round"}
    ax.plot(*points.T, color=colour, linewidth=width, zorder=order, **style)


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
            screen = camera(ends - ground % 0.25)[:, :2]
            (line,) = ax.plot(*screen.T, color=GRID, linewidth=0.7, zorder=2)
            line.set_clip_path(strip)


class Stage(NamedTuple):
    """The part of a camera's screen that every cell of a picture shows [body heights]."""

    camera: Camera
    left: float
    right: float
    low: float
    high: float

    @classmethod
    def around(cls, scenes: Iterable[Iterable[Cell]], camera: Camera) -> Stage:
        """The smallest part of the screen with all figures, a margin and the floor."""
        screen = np.concatenate([camera(cell.points)[:, :2] for scene in scenes for cell in scene])
        left, low = screen.min(axis=0) - MARGIN
        right, high = screen.max(axis=0) + MARGIN
        return cls(camera, left, right, min(low, -DEPTH * camera.slope - MARGIN[0]), high)

    def figure(self, columns: int, rows: int, dpi: int) -> Figure:
        """An empty picture with cells of this size."""
        across, upward = (self.right - self.left) * columns, (self.high - self.low) * rows
        return Figure((across * INCHES_PER_HEIGHT, upward * INCHES_PER_HEIGHT), dpi=dpi, facecolor="white")

    def draw(self, ax: Axes, cells: Sequence[Cell], labels: Sequence[str]) -> None:
        """Draw figures from left to right on one floor, above the labels; equally many for each label."""
        pitch = self.right - self.left
        ax.set(xlim=(self.left, self.left + pitch * len(labels)), ylim=(self.low, self.high))
        ax.axis("off")
        _draw_floor(ax, self.camera, cells[0].ground)
        for number, cell in enumerate(cells):
            _draw_figure(ax, cell, self.camera, number * len(labels) // len(cells) * pitch)
        for number, label in enumerate(labels):
            ax.text(self.left + (number + 0.5) * pitch, self.low + 0.03, label, ha="center", color=LABEL, fontsize=8)


def write_picture(
    path: Path,
    scenes: Sequence[Sequence[Cell]],
    titles: Sequence[str],
    labels: Sequence[Sequence[str]],
    camera: Camera,
    dpi: int = 150,
) -> None:
    """Draw scenes below each other at equal heights, each with a title, and labels from left to right."""
    stage = Stage.around(scenes, camera)
    figure = stage.figure(len(labels[0]), len(scenes), dpi)
    for number, (scene, title, names) in enumerate(zip(scenes, titles, labels, strict=True)):
        ax = figure.add_axes((0, 1 - (number + 1) / len(scenes), 1, 1 / len(scenes)))
        ax.text(stage.left + 0.04, stage.high - 0.09, title, color=LABEL, fontsize=10, fontweight="bold")
        stage.draw(ax, scene, names)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    Image.open(path).convert("RGB").quantize(STILL_COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


def write_loop(
    path: Path,
    labels: Sequence[str],
    columns: Sequence[Sequence[Cell]],
    seconds: float,
    view: str,
    dpi: int,
    still: int,
) -> None:
    """Write a GIF that repeats for ever, and the scene `still` as PNG. A column is a figure that changes in place: a
    cell for every scene. Labels are from left to right, equally many columns for each. A body is 2.3 inches tall.
    """
    stage = Stage.around(columns, VIEWS[view])
    images = []
    for scene in zip(*columns, strict=True):
        figure = stage.figure(len(labels), 1, dpi)
        stage.draw(figure.add_axes((0, 0, 1, 1)), scene, labels)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    write_gif(path, images, seconds, images[0].quantize(MOVING_COLOURS, dither=Image.Dither.NONE))
    images[still].quantize(MOVING_COLOURS, dither=Image.Dither.NONE).save(path.with_suffix(".png"), optimize=True)


def write_gif(path: Path, images: Iterable[Image.Image], seconds: float, palette: Image.Image) -> None:
    """Write a GIF that repeats for ever, each picture shown for some seconds, in the colours of a palette."""
    first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    path.parent.mkdir(parents=True, exist_ok=True)
    first.save(path, save_all=True, append_images=others, duration=round(1000 * seconds), loop=0, optimize=True)
