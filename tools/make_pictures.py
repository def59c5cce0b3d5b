"""Draw the pictures of stick figures in docs/gallery.md and in the guides, all from the samples.

    python tools/make_pictures.py [FOLDER] [--only GLOB]

Each moving picture has a still of the same name, for readers who prefer no motion. FOLDER is `docs/pictures` by
default. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from functools import partial
from pathlib import Path

import click
import numpy as np
from draw import VIEWS, Cell, cells, figures_of, tallest, write_loop, write_picture
from sample_scenes import SCENES, facing, stick
from scipy.spatial.transform import Rotation
from zoo import MEMBERS, member

from distretarget import (
    Contact,
    ContactList,
    Motion,
    Plant,
    RetargetResult,
    Skeleton,
    load_target,
    read_bvh,
    retarget,
    retarget_scene,
)

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"
METHODS = ("source", "copied rotations", "distretarget")
CLAP_DPI, SHEET_DPI, LOOP_DPI = 170, 70, 105
MEETING = 66  # a frame of the clap in which the hands meet
STEP = 3  # frames of a clip from one picture of a loop to the next
DUET_FRAMES = range(40, 280, 4)
ACROSS = 5  # bodies in a row of the zoo
SKATED = 30.0  # distance over the whole clip whose feet skate [cm]

# For each sample clip the frame of the sheet; for each body of the sheet its file.
SAMPLE_FRAMES = {"clap": 93, "hands_on_hips": 150, "squat": 130, "turn": 160, "walk": 60, "wave": 150}
SAMPLE_BODIES = ("child", "giant", "long_arms", "rigs/unreal_a")
FLOOR_FRAMES = {"cartwheel": 80, "crawl": 60, "kneel": 150, "push_up": 60, "sit": 160, "climb_ladder": 150}
PROP_FRAMES = {"sit_on_chair": 120, "drum_on_table": 43, "staff": 20}


def result_of(clip: str, body: str) -> RetargetResult:
    """A sample clip on a sample body."""
    return retarget(read_bvh(SAMPLES / f"{clip}.bvh"), load_target(SAMPLES / f"{body}.json"))


def draw_clap(path: Path) -> None:
    """Draw source, rotation copy and result of a clap in a frame in which the hands meet, in the same scale."""
    result = result_of("clap", "long_arms")
    motions = (result.source, result.rotation_copy, result.motion)
    scene = [cell for motion in motions for cell in cells(motion, [MEETING], tallest(motions))]
    write_picture(path, [scene], [""], [METHODS], VIEWS["front"], CLAP_DPI)


def draw_samples(path: Path) -> None:
    """Draw a row for each sample clip: one frame of the source, and of the results on four bodies."""
    scenes = []
    for clip, frame in SAMPLE_FRAMES.items():
        sides = [figures_of(result_of(clip, body), [frame]) for body in SAMPLE_BODIES]
        scenes.append([sides[0][0][0], *(result[0] for _, _, result in sides)])
    labels = ["source", *(Path(body).name for body in SAMPLE_BODIES)]
    write_picture(path, scenes, list(SAMPLE_FRAMES), [labels] * len(scenes), VIEWS["front"], SHEET_DPI)


def draw_floor_work(path: Path) -> None:
    """Draw a row for each clip in which more than feet rests: a frame of source, copy and result on a child."""
    scenes = []
    for clip, frame in FLOOR_FRAMES.items():
        scenes.append([figure for (figure,) in figures_of(result_of(f"supports/{clip}", "child"), [frame])])
    write_picture(path, scenes, list(FLOOR_FRAMES), [METHODS] * len(scenes), VIEWS["three-quarter"], SHEET_DPI)


def draw_zoo(path: Path) -> None:
    """Draw a frame of one clip on every body of the zoo."""
    source, names = read_bvh(SAMPLES / "hands_on_hips.bvh"), list(MEMBERS)
    results = [retarget(source, member(name)) for name in names]
    drawn = [figures_of(result, [SAMPLE_FRAMES["hands_on_hips"]])[2][0] for result in results]
    scenes, labels = ([each[k : k + ACROSS] for k in range(0, len(names), ACROSS)] for each in (drawn, names))
    write_picture(path, scenes, [""] * len(scenes), labels, VIEWS["front"], SHEET_DPI)


def draw_clip(path: Path, clip: str, body: str, frames: tuple[int, int], view: str) -> None:
    """Draw a loop of source, rotation copy and result, equally tall."""
    result = result_of(clip, body)
    columns = figures_of(result, range(*frames, STEP))
    write_loop(path, METHODS, columns, STEP * result.source.frame_time, view, LOOP_DPI, still=len(columns[0]) // 2)


def draw_duet(path: Path) -> None:
    """Draw a loop of two performers who lean on each other's hand, on bodies of other sizes: alone, and together."""
    one = read_bvh(SAMPLES / "supports" / "hand_on_wall.bvh")
    hand = np.median(one.positions[:, one.skeleton.index("RightWrist")], axis=0)
    other = facing(one, gap=2 * hand[2] + 2)
    other = Motion(other.skeleton, other.root_positions + hand * [2, 0, 0], other.rotations, other.frame_time_text)
    bodies = [load_target(SAMPLES / f"{name}.json") for name in ("child", "long_spine")]
    scene = retarget_scene([one, other], bodies)
    alone = [result.rotation_copy for result in scene.results]
    pairs = ([one, other], alone, [result.motion for result in scene.results])
    columns = [column for pair in pairs for column in _together(pair, DUET_FRAMES)]
    seconds = DUET_FRAMES.step * one.frame_time
    write_loop(path, METHODS, columns, seconds, "side", LOOP_DPI, still=len(DUET_FRAMES) // 2)


def draw_drop(path: Path) -> None:
    """Draw hands on the hips of a child, before and after the contact of the left hand is dropped."""
    dropped = ContactList((Contact(between=(HAND, "hips"), keep=False),))
    source, child = read_bvh(SAMPLES / "hands_on_hips.bvh"), load_target(SAMPLES / "child.json")
    both = [retarget(source, child, contacts=contacts).motion for contacts in (ContactList(), dropped)]
    columns = {name: [motion[150:151]] for name, motion in zip(("before", "after"), both, strict=True)}
    _write_scenes(path, columns, "three-quarter", SHEET_DPI)


def draw_skating(path: Path) -> None:
    """Draw two frames of a clip whose feet skate, in one place, before and after both are planted."""
    still, child = read_bvh(SAMPLES / "wave.bvh"), load_target(SAMPLES / "child.json")
    drift = np.linspace(0.0, SKATED, len(still))[:, None] * (0.0, 0.0, 1.0)
    source = Motion(still.skeleton, still.root_positions + drift, still.rotations, still.frame_time_text)
    planted = tuple(Plant(plant=f"{side} foot", on="where it is") for side in ("left", "right"))
    both = [retarget(source, child, contacts=ContactList(entries)).motion for entries in ((), planted)]
    ends = [[motion[:1], motion[-1:]] for motion in both]
    _write_scenes(path, dict(zip(("before", "after"), ends, strict=True)), "side", SHEET_DPI)


def draw_handover(path: Path) -> None:
    """Draw a stick in the left hand of a walker, before and after the right hand takes it too."""
    walk = read_bvh(SAMPLES / "walk.bvh")
    grip, points = walk.positions[:, walk.skeleton.index("LeftWrist")], [(0, 0, 0), (0, -10, 0), (0, 60, 0)]
    held = stick("stick", points, grip, Rotation.identity(), "LeftWrist")
    taken = Plant(plant="right hand", on="stick", frames=HELD)
    columns: dict[str, list[Motion]] = {}
    for name, entries in (("before", ()), ("after", (taken,))):
        scene = retarget_scene([walk], [_child(walk)], [held], contacts=[ContactList(entries)])
        motions = scene.results[0].motion, scene.props[0].motion
        columns[name] = [motion[MIDDLE : MIDDLE + 1] for motion in motions]
    _write_scenes(path, columns, "three-quarter", SHEET_DPI)


def _together(pair: Sequence[Motion], frames: range) -> list[list[Cell]]:
    """Frames of two motions in one place, at the scale of the taller one."""
    size = tallest(pair)
    middle = np.mean([motion.positions[:, 0].mean(axis=0) for motion in pair], axis=0) * (1, 0, 1) / size
    floor = min(motion.positions[..., 1].min() for motion in pair) / size
    origin = middle + np.array([0, floor, 0])
    return [
        [Cell(motion.skeleton, motion.positions[frame] / size - origin, middle) for frame in frames] for motion in pair
    ]


def draw_high_five(path: Path) -> None:
    """Draw a frame of a sample scene, of each performer alone and of the result, side by side."""
    sources = list(SCENES["high_five"]().performers.values())
    bodies = [_child(sources[0]), sources[1].rigid_skeleton]
    alone = [retarget(source, body).motion for source, body in zip(sources, bodies, strict=True)]
    together = [one.motion for one in retarget_scene(sources, bodies).results]
    pairs = {"source": sources, "each alone": alone, "scene": together}
    _write_scenes(path, {name: [motion[57:58] for motion in pair] for name, pair in pairs.items()}, "side")


def draw_props(path: Path) -> None:
    """Draw a frame of the results of sample scenes with props, side by side, on a child."""
    columns = {}
    for name, frame in PROP_FRAMES.items():
        scene = SCENES[name]()
        (source,) = scene.performers.values()
        result = retarget_scene([source], [_child(source)], scene.props)
        moved = [result.results[0].motion, *(prop.motion for prop in result.props)]
        columns[name.replace("_", " ")] = [motion[frame : frame + 1] for motion in moved]
    _write_scenes(path, columns, "three-quarter")


def _child(source: Motion) -> Skeleton:
    return load_target(SAMPLES / "child.json").for_source(source.rigid_skeleton).skeleton


def _write_scenes(path: Path, columns: dict[str, list[Motion]], view: str, dpi: int = 150) -> None:
    """Draw the first frames of scenes side by side, each of motions in one world with Y up, all in the same scale."""
    size = tallest(motions[0] for motions in columns.values())
    scene = []
    for motions in columns.values():
        points = [motion.positions[0] / size for motion in motions]
        everything = np.concatenate(points)
        middle = (everything.min(axis=0) + everything.max(axis=0)) / 2.0 * (1, 0, 1)
        scene += [Cell(motion.skeleton, x - middle, np.zeros(3)) for motion, x in zip(motions, points, strict=True)]
    write_picture(path, [scene], [""], [list(columns)], VIEWS[view], dpi)


HAND, HELD = "left hand", (100, 150)
MIDDLE = 125  # of `HELD`
PICTURES: dict[str, Callable[[Path], None]] = {
    "clap_long_arms.png": draw_clap,
    "high_five.png": draw_high_five,
    "props.png": draw_props,
    "gallery/samples.png": draw_samples,
    "gallery/floor_work.png": draw_floor_work,
    "gallery/zoo.png": draw_zoo,
    "gallery/duet.gif": draw_duet,
    "repairs/drop.png": draw_drop,
    "repairs/skating.png": draw_skating,
    "repairs/handover.png": draw_handover,
} | {
    f"gallery/{Path(clip).name}.gif": partial(draw_clip, clip=clip, body=body, frames=frames, view=view)
    for clip, body, frames, view in (
        ("walk", "giant", (40, 168), "three-quarter"),
        ("hands_on_hips", "long_spine", (60, 200), "front"),
        ("supports/cartwheel", "child", (10, 150), "front"),
        ("supports/push_up", "long_arms", (0, 130), "side"),
        ("supports/crawl", "long_spine", (0, 150), "side"),
    )
}


@click.command(help=__doc__)
@click.argument("folder", type=Path, default=ROOT / "docs" / "pictures")
@click.option("--only", default="*", help="Only pictures whose names match, as 'gallery/*'.")
def main(folder: Path, only: str) -> None:
    """Draw the pictures that match `--only`."""
    for name, draw in PICTURES.items():
        if fnmatch(name, only):
            draw(folder / name)


if __name__ == "__main__":
    main()
