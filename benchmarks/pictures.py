"""Draw the pictures of docs/results.md: source, rotation copy, paper and contact below each other.

    python benchmarks/pictures.py CORPUS [FOLDER] [--only GLOB]
    python benchmarks/pictures.py CORPUS FOLDER --clip cmu_mb/05_03.bvh --target H --frames 100,200,300

CORPUS is a folder with the real clips; the script names and skips those that it lacks. FOLDER, where the pictures are
written, is `docs/pictures` by default. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import click
from clips import SAMPLES, found
from draw import VIEWS, draw_strip, facing
from edits import TARGETS, edited
from tables import corpus_argument

from distretarget import Body, Options, read_bvh, retarget


class Picture(NamedTuple):
    """Which frames to draw of a clip on a target, and from where; `name` is the file's."""

    name: str
    clip: str
    target: str
    frames: tuple[int, ...]
    view: str = "three-quarter"


PICTURES = (
    Picture("clap_long_forearms", "clap.bvh", "forearm and hand +50 %", (0, 93, 120, 140), "front"),
    Picture("hands_on_hips_long_spine", "hands_on_hips.bvh", "spine +60 %", (0, 40, 150, 290), "front"),
    Picture("walk_on_h", "cmu_mb/02_01.bvh", "H", (30, 90, 210, 270)),
    Picture("worst_direction", "cmu_daz/13_11.bvh", "H", (5, 139, 250, 316)),
    Picture("worst_contact", "squat.bvh", "H", (0, 72, 130, 330)),
)


def draw(folder: Path, path: Path, picture: Picture) -> None:
    """Draw source, rotation copy, paper and contact, all turned as the source has to be to face +Z in the first frame,
    into `name.png`.
    """
    source = read_bvh(path)
    body = edited(source.rigid_skeleton, TARGETS[picture.target])
    paper, contact = (retarget(source, body, Options(objective=objective)) for objective in ("paper", "contact"))
    rows = [
        (f"{picture.clip}", source),
        (f"rotation copy, {picture.target}", contact.rotation_copy),
        ("paper", paper.motion),
        ("contact", contact.motion),
    ]
    turn = facing(source, Body.of_motion(source), picture.frames[0])
    draw_strip(folder / f"{picture.name}.png", rows, picture.frames, view=picture.view, turn=turn, same_scale=True)


@click.command(help=__doc__)
@corpus_argument
@click.argument("folder", type=Path, default=SAMPLES.parent / "docs" / "pictures")
@click.option("--only", default="*", help="Only pictures whose names match.")
@click.option("--clip", help="Draw this clip instead of those of the page.")
@click.option("--target", type=click.Choice(list(TARGETS)), help="Target of --clip.")
@click.option("--frames", help="Frames of --clip, as 0,30,60.")
@click.option("--view", type=click.Choice(list(VIEWS)), default="three-quarter", help="Of --clip.")
def main(
    corpus: Path, folder: Path, only: str, clip: str | None, target: str | None, frames: str | None, view: str
) -> None:
    """Draw the pictures that the command line asks for."""
    pictures = [picture for picture in PICTURES if fnmatch(picture.name, only)]
    if clip:
        name = f"{Path(clip).with_suffix('').as_posix()}_{target}".replace("/", "_")
        pictures = [Picture(name, clip, target, tuple(map(int, frames.split(","))), view)]
    paths = found([picture.clip for picture in pictures], corpus)
    for picture in pictures:
        if picture.clip in paths:
            draw(folder, paths[picture.clip], picture)


if __name__ == "__main__":
    main()
