"""Draw the pictures of docs/scenes.md: sample scenes.

    python tools/make_scene_pictures.py [FOLDER]

Without FOLDER they go to docs/pictures. Needs the extra `docs`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from draw import draw_together
from sample_scenes import SCENES

from distretarget import Motion, Skeleton, load_target, retarget, retarget_scene

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"


def draw_scene(name: str, targets: tuple[str, ...], frame: int, folder: Path) -> None:
    """Draw a frame of a sample scene, of each performer alone and of the result, side by side, into `name.png`."""
    scene = SCENES[name]()
    sources = list(scene.performers.values())
    bodies = [_body(source, target) for source, target in zip(sources, targets, strict=True)]
    result = retarget_scene(sources, bodies)
    alone = [retarget(source, body).motion for source, body in zip(sources, bodies, strict=True)]
    columns = [("source", sources), ("each alone", alone), ("scene", [one.motion for one in result.results])]
    draw_together(columns, frame, folder / f"{name}.png", view="side")


def draw_props(frames: dict[str, int], target: str, path: Path) -> None:
    """Draw a frame of the results of sample scenes with props, side by side."""
    columns = []
    for name, frame in frames.items():
        scene = SCENES[name]()
        (source,) = scene.performers.values()
        result = retarget_scene([source], [_body(source, target)], scene.props)
        moved = [result.results[0].motion, *(prop.motion for prop in result.props)]
        columns.append((name.replace("_", " "), [_frame(motion, frame) for motion in moved]))
    draw_together(columns, 0, path, view="three-quarter")


def _body(source: Motion, target: str) -> Skeleton:
    """A sample target, or the source's own body."""
    if target == "own":
        return source.rigid_skeleton
    return load_target(SAMPLES / f"{target}.json").for_source(source.rigid_skeleton).skeleton


def _frame(motion: Motion, frame: int) -> Motion:
    return motion[frame : frame + 1]


def main() -> None:
    """Draw all pictures into the folder on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "docs" / "pictures")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    draw_scene("high_five", ("child", "own"), 57, folder)
    draw_props({"sit_on_chair": 120, "drum_on_table": 43, "staff": 20}, "child", folder / "props.png")


if __name__ == "__main__":
    main()
