"""Draw the pictures of docs/gallery.md and of the guides: sheets and loops of samples, floor work, a duet, the zoo.

    python tools/make_gallery.py [FOLDER] [--only GLOB]

Each loop has a still of the same name, for readers who prefer no motion. FOLDER is `docs/pictures/gallery` by default.
Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from animate import Loop
from draw import VIEWS, Camera, Cell, body_height, cells, write_picture
from scipy.spatial.transform import Rotation
from zoo import MEMBERS, member

from distretarget import Body, Motion, RetargetResult, Skeleton, load_target, read_bvh, retarget, retarget_scene

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"
METHODS = ("source", "copied rotations", "distretarget")
SHEET_DPI, LOOP_DPI = 70, 105
STEP = 3  # frames of a clip from one picture of a loop to the next
DUET_FRAMES = range(40, 280, 4)
ACROSS = 5  # bodies in a row of the zoo

# For each sample clip the frame of the sheet; for each body of the sheet its file.
SAMPLE_FRAMES = {"clap": 93, "hands_on_hips": 150, "squat": 130, "turn": 160, "walk": 60, "wave": 150}
SAMPLE_BODIES = ("child", "giant", "long_arms", "rigs/unreal_a")
FLOOR_FRAMES = {"cartwheel": 80, "crawl": 60, "kneel": 150, "push_up": 60, "sit": 160, "climb_ladder": 150}
# For each loop: clip, body, first frame and the one after the last, view.
LOOPS = {
    "walk": ("walk", "giant", (40, 168), "three-quarter"),
    "hands_on_hips": ("hands_on_hips", "long_spine", (60, 200), "front"),
    "cartwheel": ("supports/cartwheel", "child", (10, 150), "front"),
    "push_up": ("supports/push_up", "long_arms", (0, 130), "side"),
    "crawl": ("supports/crawl", "long_spine", (0, 150), "side"),
}


def result_of(clip: str, body: str) -> RetargetResult:
    """A sample clip on a sample body."""
    return retarget(read_bvh(SAMPLES / f"{clip}.bvh"), load_target(SAMPLES / f"{body}.json"))


def figures_of(result: RetargetResult, frames: Sequence[int]) -> list[list[Cell]]:
    """Frames of source, rotation copy and result, equally tall, on the source's floor at the scale of each."""
    source, target = result.matching.source, result.matching.target
    floor = source.lowest(result.world.up_vector)
    return [
        _figures(result.source, source, frames, floor),
        _figures(result.rotation_copy, target, frames, result.root_scale * floor),
        _figures(result.motion, target, frames, result.root_scale * floor),
    ]


def _figures(motion: Motion, body: Body, frames: Sequence[int], floor: float) -> list[Cell]:
    """A body of height 1 without root on the floor, IK handles, props and cloth."""
    skeleton = motion.skeleton
    shown = np.flatnonzero(body.regions.of_joint >= 0)
    parents = [next((np.searchsorted(shown, a) for a in skeleton.line(j)[1:] if a in shown), -1) for j in shown]
    drawn = Skeleton(
        names=tuple(skeleton.names[joint] for joint in shown),
        parents=np.array(parents),
        offsets=skeleton.offsets[shown],
        channels=((),) * len(shown),
        end_sites=~np.isin(np.arange(len(shown)), parents),
    )
    return [
        replace(cell, skeleton=drawn, points=cell.points[shown], size=1.0)
        for cell in cells(motion, frames, body.up, body.height, floor)
    ]


def draw_samples(path: Path) -> None:
    """Draw a row for each sample clip: one frame of the source, and of the results on four bodies."""
    scenes = []
    for clip, frame in SAMPLE_FRAMES.items():
        sides = [figures_of(result_of(clip, body), [frame]) for body in SAMPLE_BODIES]
        scenes.append([sides[0][0][0], *(result[0] for _, _, result in sides)])
    labels = ["source", *(Path(body).name for body in SAMPLE_BODIES)]
    _write_sheet(path, scenes, list(SAMPLE_FRAMES), labels, "front")


def draw_floor_work(path: Path) -> None:
    """Draw a row for each clip in which more than feet rests: a frame of source, copy and result on a child."""
    scenes = []
    for clip, frame in FLOOR_FRAMES.items():
        scenes.append([figure for (figure,) in figures_of(result_of(f"supports/{clip}", "child"), [frame])])
    _write_sheet(path, scenes, list(FLOOR_FRAMES), METHODS, "three-quarter")


def draw_zoo(path: Path) -> None:
    """Draw a frame of one clip on every body of the zoo."""
    source, names = read_bvh(SAMPLES / "hands_on_hips.bvh"), list(MEMBERS)
    results = [retarget(source, member(name)) for name in names]
    drawn = [figures_of(result, [SAMPLE_FRAMES["hands_on_hips"]])[2][0] for result in results]
    scenes, labels = ([each[k : k + ACROSS] for k in range(0, len(names), ACROSS)] for each in (drawn, names))
    write_picture(scenes, [""] * len(scenes), labels, path, camera=Camera(*VIEWS["front"]), dpi=SHEET_DPI)


def draw_duet(path: Path) -> None:
    """Draw a loop of two performers who lean on each other's hand, on bodies of other sizes: alone, and together."""
    one, other = _two_performers()
    bodies = [load_target(SAMPLES / f"{name}.json") for name in ("child", "long_spine")]
    scene = retarget_scene([one, other], bodies)
    alone = [result.rotation_copy for result in scene.results]
    pairs = ([one, other], alone, [result.motion for result in scene.results])
    columns = [column for pair in pairs for column in _together(pair, DUET_FRAMES)]
    _write_loop(Loop.of_columns(METHODS, columns, 1000 * DUET_FRAMES.step * one.frame_time, "side"), path)


def _two_performers() -> tuple[Motion, Motion]:
    """A person who leans with a hand on a wall, and another in place of the wall, whose hand meets it."""
    one = read_bvh(SAMPLES / "supports" / "hand_on_wall.bvh")
    hand = np.median(one.positions[:, one.skeleton.index("RightWrist")], axis=0)
    turn = Rotation.from_euler("Y", 180, degrees=True)
    path, rotations = turn.apply(np.array(one.root_positions)) + hand * [2, 0, 2] + [0, 0, 2], np.array(one.rotations)
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    return one, replace(one, root_positions=path, rotations=rotations)


def _together(pair: Sequence[Motion], frames: range) -> list[list[Cell]]:
    """Frames of two motions in one place, at the scale of the taller one."""
    size = max(body_height(motion.skeleton) for motion in pair)
    middle = np.mean([motion.positions[:, 0].mean(axis=0) for motion in pair], axis=0) * (1, 0, 1) / size
    floor = min(motion.positions[..., 1].min() for motion in pair) / size
    origin = middle + np.array([0, floor, 0])
    return [
        [Cell(motion.skeleton, motion.positions[frame] / size - origin, middle, 1.0) for frame in frames]
        for motion in pair
    ]


def draw_loop(name: str, path: Path) -> None:
    """Draw a loop of source, rotation copy and result."""
    clip, body, frames, view = LOOPS[name]
    result = result_of(clip, body)
    columns = figures_of(result, range(*frames, STEP))
    _write_loop(Loop.of_columns(METHODS, columns, 1000 * STEP * result.source.frame_time, view), path)


def _write_loop(loop: Loop, path: Path) -> None:
    """Write a moving picture, and its middle as a still."""
    loop.write_gif(path, LOOP_DPI)
    loop.write_still(path.with_suffix(".png"), len(loop.scenes) // 2, LOOP_DPI)


def _write_sheet(
    path: Path, scenes: Sequence[Sequence[Cell]], titles: Sequence[str], labels: Sequence[str], view: str
) -> None:
    write_picture(scenes, titles, [labels] * len(scenes), path, camera=Camera(*VIEWS[view]), dpi=SHEET_DPI)


SHEETS: dict[str, Callable[[Path], None]] = {
    "samples.png": draw_samples,
    "floor_work.png": draw_floor_work,
    "zoo.png": draw_zoo,
    "duet.gif": draw_duet,
}


def main() -> None:
    """Draw the pictures that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "docs" / "pictures" / "gallery")
    parser.add_argument("--only", default="*", help="only pictures whose names match")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for name, draw in SHEETS.items():
        if fnmatch(name, arguments.only):
            draw(arguments.folder / name)
    for name in LOOPS:
        if fnmatch(f"{name}.gif", arguments.only):
            draw_loop(name, arguments.folder / f"{name}.gif")


if __name__ == "__main__":
    main()
