"""Draw motions as stick figures in a row, with a floor and soft shadows.

    python tools/draw.py walk.bvh child_walk.bvh --frames 0,20,40 -o walk.png --view three-quarter
    python tools/draw.py walk.bvh child_walk.bvh --frames 0:120 -o walk.gif --same-scale

In a still picture each motion is a row, with its frames from left to right; with `--columns`, each frame is a row, with
the motions side by side. Frames with a colon make a moving picture that repeats: the motions are side by side, a body
that walks stays in the middle, and the floor passes below it. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation
from skeleton_edits import only

from distretarget import Body, Motion, RetargetResult, Skeleton, read_bvh

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
STILL_COLOURS, MOVING_COLOURS = 64, 32  # of a picture, of all frames together; fewer make a smaller file
MARGIN = np.array([0.08, 0.15])  # around a figure, across and upward [body heights]
RATE = 20  # of a moving picture [frames/s]

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


VIEWS = {"front": Camera(0.0, 10.0), "side": Camera(90.0, 10.0), "three-quarter": Camera(38.0, 16.0)}
"""Of a body that faces +Z with Y up."""


# ---- from motions to figures


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
    size: float = 1.0


def upright(up: str) -> Rotation:
    """The rotation that turns the axis `up` ("Y", "-Z", ...) to Y."""
    axis, sign = "XYZ".index(up[-1]), -1.0 if up.startswith("-") else 1.0
    turn = np.zeros((3, 3))
    turn[1, axis] = sign
    first, second = [number for number in range(3) if number != axis]
    turn[0, first] = turn[2, second] = 1.0
    turn[2] *= np.linalg.det(turn)
    return Rotation.from_matrix(turn)


def facing(motion: Motion, body: Body, frame: int) -> Rotation:
    """The rotation after which Y is up, and the hips face +Z in a frame; only the first for a body without legs."""
    if body.legs is None:
        return upright(body.up)
    left, right = (motion.positions[frame, leg.hip] for leg in body.legs)
    up, across = body.up_vector, left - right
    across = across - (across @ up) * up
    across = across / np.linalg.norm(across)
    return Rotation.from_matrix(np.stack([across, up, np.cross(across, up)]))


def cells(
    motion: Motion,
    frames: Sequence[int],
    size: float | None = None,
    floor: float | None = None,
    turn: Rotation | None = None,
) -> list[Cell]:
    """The frames as figures, each moved to the origin; moved by one vector if the motion stays on the spot.

    Args:
        motion: the motion.
        frames: their numbers.
        size: by which lengths are divided; by default the height of the body.
        floor: its height [file units]; by default that of the lowest joint of all frames.
        turn: of the whole motion; by default it turns the skeleton's up axis to Y.
    """
    height = body_height(motion.skeleton)
    size = size or height
    matrix = (turn or upright(motion.skeleton.up or "Y")).as_matrix()
    points = motion.positions @ matrix.T / size
    points[..., 1] -= points[..., 1].min() if floor is None else floor / size
    grounds = points[frames, 0] * (1, 0, 1)
    if np.all(np.ptp(grounds, axis=0) < ON_THE_SPOT):
        grounds[:] = grounds.mean(axis=0)
    return [
        Cell(motion.skeleton, points[frame] - ground, ground, height / size)
        for frame, ground in zip(frames, grounds, strict=True)
    ]


def figures_of(result: RetargetResult, frames: Sequence[int], turn: Rotation | None = None) -> list[list[Cell]]:
    """Frames of source, rotation copy and result, equally tall, on the source's floor at the scale of each."""
    source, target = result.matching.source, result.matching.target
    floor = source.lowest(result.world.up_vector)
    return [
        body_cells(result.source, source, frames, floor, turn),
        body_cells(result.rotation_copy, target, frames, result.root_scale * floor, turn),
        body_cells(result.motion, target, frames, result.root_scale * floor, turn),
    ]


def body_cells(
    motion: Motion,
    body: Body,
    frames: Sequence[int],
    floor: float | None = None,
    turn: Rotation | None = None,
    size: float | None = None,
) -> list[Cell]:
    """Frames of a body of height 1, without root on the floor, IK handles, props and cloth; arguments as in `cells`."""
    shown = np.flatnonzero(body.regions.of_joint >= 0)
    drawn = only(motion.skeleton, shown)
    ends = ~np.isin(np.arange(len(drawn)), drawn.parents)
    drawn = replace(drawn, channels=((),) * len(drawn), end_sites=ends)
    return [
        replace(cell, skeleton=drawn, points=cell.points[shown], size=1.0)
        for cell in cells(motion, frames, size or body.height, floor, turn or upright(body.up))
    ]


def articulated(motion: Motion) -> int:
    """The frame whose posture differs most from the mean; not in the first tenth, which may show a rest pose."""
    axes = Rotation.from_quat(motion.world_rotations[:, 0]).as_matrix()
    postures = (motion.positions - motion.positions[:, :1]) @ axes
    first = len(motion) // 10
    return first + int(np.argmax(np.linalg.norm(postures - postures.mean(axis=0), axis=(1, 2))[first:]))


def body_height(skeleton: Skeleton) -> float:
    """Approximate height of the standing body, whatever its rest pose [file units]."""
    return 0.7 * float(skeleton.path_lengths.max())


def tallest(motions: Iterable[Motion]) -> float:
    """The height of the tallest of several bodies [file units]."""
    return max(body_height(motion.skeleton) for motion in motions)


# ---- drawing


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
    """The side of the body by a joint's name, such as LeftHand, hand_l, lHand: left, right, or trunk if it has none."""
    for side, letter in (("left", "l"), ("right", "r")):
        alone = rf"(^|[_.:]){letter}([_.]|$)"
        if (
            side in name.lower()
            or re.search(alone, name.lower())
            or re.match(rf"[{letter}{letter.upper()}][A-Z]", name)
        ):
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
    for order, (thickness, colour) in enumerate(SHADOW, start=3):
        line = {"solid_capstyle": "round", "solid_joinstyle": "round", "zorder": order}
        for chain in _chains(cell.skeleton):
            ax.plot(*screen[chain].T, color=colour, linewidth=thickness * POINTS_PER_HEIGHT * cell.size, **line)


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
    def around(cls, scenes: Iterable[Iterable[Cell]], camera: Camera) -> Stage:
        """The smallest part of the screen with all figures, a margin and the floor."""
        screen = np.concatenate([camera(cell.points)[0] for scene in scenes for cell in scene])
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
    """Draw scenes below each other, with equal spacing, a title for each and labels from left to right."""
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
    duration: float,
    camera: Camera,
    dpi: int = 96,
    still: int | None = None,
) -> None:
    """Write a GIF that repeats for ever, and the scene with the number `still` as a PNG of the same size.

    Args:
        path: of the GIF.
        labels: from left to right, equally many columns for each.
        columns: figures that change in place, from left to right: of each, a cell for every scene.
        duration: of each scene [ms].
        camera: the view.
        dpi: pixels per inch, where a body is 2.3 inches tall.
        still: none is written by default.
    """
    stage = Stage.around(columns, camera)
    images = []
    for scene in zip(*columns, strict=True):
        figure = stage.figure(len(labels), 1, dpi)
        stage.draw(figure.add_axes((0, 0, 1, 1)), scene, labels)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    palette = images[0].quantize(MOVING_COLOURS, dither=Image.Dither.NONE)
    first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    path.parent.mkdir(parents=True, exist_ok=True)
    first.save(path, save_all=True, append_images=others, duration=round(duration), loop=0, optimize=True)
    if still is not None:
        picture = images[still].quantize(MOVING_COLOURS, dither=Image.Dither.NONE)
        picture.save(path.with_suffix(".png"), optimize=True)


# ---- whole pictures of motions


def draw_strip(
    path: Path,
    rows: Sequence[tuple[str, Motion]],
    frames: Sequence[int],
    *,
    view: str = "three-quarter",
    turn: Rotation | None = None,
    columns: bool = False,
    same_scale: bool = False,
) -> None:
    """Draw frames of motions as stick figures into a picture file.

    Args:
        path: of the picture; its suffix is the format.
        rows: a label and a motion for each row.
        frames: the numbers of the frames, from left to right.
        view: one of `VIEWS`, for a body that faces +Z with Y up.
        turn: of all motions; by default it turns their up axes to Y.
        columns: make each frame a row, with the motions side by side.
        same_scale: keep the relative sizes of the bodies; otherwise all are drawn equally tall.

    Raises:
        ValueError: a motion lacks one of the frames.
    """
    for label, motion in rows:
        if max(frames) >= len(motion):
            raise ValueError(f"{label} has frames 0 to {len(motion) - 1}, not {max(frames)}")
    size = tallest(motion for _, motion in rows) if same_scale else None
    scenes = [cells(motion, frames, size, turn=turn) for _, motion in rows]
    titles, names = [label for label, _ in rows], [f"frame {frame}" for frame in frames]
    if columns:
        scenes, titles, names = [list(scene) for scene in zip(*scenes, strict=True)], names, titles
    write_picture(path, scenes, titles, [names] * len(scenes), VIEWS[view])


def draw_loop(
    path: Path,
    rows: Sequence[tuple[str, Motion]],
    frames: tuple[int, int],
    *,
    view: str = "three-quarter",
    turn: Rotation | None = None,
    same_scale: bool = False,
    dpi: int = 96,
    still: int | None = None,
) -> None:
    """Draw motions with the same frame time side by side in a moving picture, from the first frame to the one before
    the last; the other arguments are those of `draw_strip` and `write_loop`.
    """
    frame_time = rows[0][1].frame_time
    step = max(1, round(1 / RATE / frame_time))
    size = tallest(motion for _, motion in rows) if same_scale else None
    columns = [cells(motion, range(*frames, step), size, turn=turn) for _, motion in rows]
    write_loop(path, [label for label, _ in rows], columns, 1000 * step * frame_time, VIEWS[view], dpi, still)


def draw_together(
    path: Path, columns: Sequence[tuple[str, Sequence[Motion]]], frame: int, *, view: str = "three-quarter"
) -> None:
    """Draw one frame of several scenes side by side, each of motions in one world with Y up, all in the same scale."""
    size = tallest(motions[0] for _, motions in columns)
    scene = []
    for _, motions in columns:
        points = [motion.positions[frame] / size for motion in motions]
        everything = np.concatenate(points)
        middle = (everything.min(axis=0) + everything.max(axis=0)) / 2.0 * (1, 0, 1)
        scene += [Cell(motion.skeleton, x - middle, np.zeros(3)) for motion, x in zip(motions, points, strict=True)]
    write_picture(path, [scene], [""], [[label for label, _ in columns]], VIEWS[view])


@click.command(help=__doc__)
@click.argument("files", nargs=-1, required=True, type=Path)
@click.option("--frames", required=True, help="Numbers, as 0,30,60, or the first and the one after the last, as 0:120.")
@click.option("-o", "--output", required=True, type=Path)
@click.option("--view", type=click.Choice(list(VIEWS)), default="three-quarter")
@click.option("--up", help="The axis that points up, as Y or -Z; by default that of the file, or Y.")
@click.option("--columns", is_flag=True, help="Draw motions side by side, with a row per frame.")
@click.option("--same-scale", is_flag=True, help="Keep the relative sizes of the bodies.")
def main(
    files: tuple[Path, ...], frames: str, output: Path, view: str, up: str | None, columns: bool, same_scale: bool
) -> None:
    """Draw the files named on the command line."""
    rows, turn = [(file.stem, read_bvh(file)) for file in files], upright(up) if up else None
    if ":" in frames:
        first, end = map(int, frames.split(":"))
        draw_loop(output, rows, (first, end), view=view, turn=turn, same_scale=same_scale)
        return
    numbers = [int(frame) for frame in frames.split(",")]
    draw_strip(output, rows, numbers, view=view, turn=turn, columns=columns, same_scale=same_scale)


if __name__ == "__main__":
    main()
