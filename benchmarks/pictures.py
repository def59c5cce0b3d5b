"""Draw the pictures of docs/results.md: source, rotation copy, paper and contact below each other.

    python benchmarks/pictures.py CORPUS [FOLDER] [--only GLOB]

CORPUS is a folder with the real clips; the script names and skips those that it lacks. FOLDER, where the pictures are
written, is `docs/pictures` by default. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path

import click
from clips import SAMPLES, corpus_argument, found
from draw import facing, write_strip
from edits import TARGETS, edited

from distretarget import Body, Options, read_bvh, retarget

# For each picture the clip, the target, the frames and the view.
PICTURES = {
    "clap_long_forearms": ("clap.bvh", "forearm and hand +50 %", (0, 93, 120, 140), "front"),
    "hands_on_hips_long_spine": ("hands_on_hips.bvh", "spine +60 %", (0, 40, 150, 290), "front"),
    "walk_on_h": ("cmu_mb/02_01.bvh", "H", (30, 90, 210, 270), "three-quarter"),
    "jump_on_h": ("cmu_daz/13_11.bvh", "H", (5, 139, 250, 316), "three-quarter"),
    "hands_on_hips_on_h": ("hands_on_hips.bvh", "H", (0, 60, 150, 290), "three-quarter"),
}


def draw(path: Path, corpus: Path, clip: str, target: str, frames: tuple[int, ...], view: str) -> None:
    """Draw a picture. One rotation turns all motions, so that the source faces +Z in the first of the frames."""
    for source_path in found([clip], corpus).values():
        source = read_bvh(source_path)
        body = edited(source.rigid_skeleton, TARGETS[target])
        paper, contact = (retarget(source, body, Options(objective=objective)) for objective in ("paper", "contact"))
        rows = [(clip, source), (f"rotation copy, {target}", contact.rotation_copy)]
        rows += [("paper", paper.motion), ("contact", contact.motion)]
        turn = facing(source, Body.of_motion(source), frames[0])
        write_strip(path, rows, frames, view, turn)


@click.command(help=__doc__)
@corpus_argument
@click.argument("folder", type=Path, default=SAMPLES.parent / "docs" / "pictures")
@click.option("--only", default="*", help="Only pictures whose names match.")
def main(corpus: Path, folder: Path, only: str) -> None:
    """Draw the pictures whose clips exist."""
    for name, picture in PICTURES.items():
        if fnmatch(name, only):
            draw(folder / f"{name}.png", corpus, *picture)


if __name__ == "__main__":
    main()
