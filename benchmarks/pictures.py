"""Draw the pictures of docs/results.md: source, rotation copy, paper and contact below each other.

    python benchmarks/pictures.py CORPUS [FOLDER] [--only GLOB]
    python benchmarks/pictures.py CORPUS FOLDER --clip cmu_mb/05_03.bvh --target H --frames 100,200,300

CORPUS is a folder with the real clips; the script names and skips those that it lacks. FOLDER, where the pictures are
written, is `docs/pictures` by default. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from clips import SAMPLES
from edits import TARGETS, edited
from scipy.spatial.transform import Rotation

from distretarget import Motion, Options, read_bvh, retarget
from distretarget.body.body import Body
from distretarget.numerics.vectors import normalised

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tools"))
from draw import draw_strip  # noqa: E402


@dataclass(frozen=True, kw_only=True)
class Picture:
    """Which frames to draw of a clip on a target, and from where; `name` is the file's."""

    name: str
    clip: str
    target: str
    frames: tuple[int, ...]
    view: str = "three-quarter"


PICTURES = (
    Picture(
        name="clap_long_forearms",
        clip="clap.bvh",
        target="forearm and hand +50 %",
        frames=(0, 93, 120, 140),
        view="front",
    ),
    Picture(
        name="hands_on_hips_long_spine",
        clip="hands_on_hips.bvh",
        target="spine +60 %",
        frames=(0, 40, 150, 290),
        view="front",
    ),
    Picture(name="walk_on_h", clip="cmu_mb/02_01.bvh", target="H", frames=(30, 90, 210, 270)),
    Picture(name="worst_direction", clip="cmu_daz/13_11.bvh", target="H", frames=(5, 139, 250, 316)),
    Picture(name="worst_contact", clip="squat.bvh", target="H", frames=(0, 72, 130, 330)),
)


def draw(folder: Path, corpus: Path, picture: Picture) -> None:
    """Draw source, rotation copy, paper and contact, all turned to face the same way, into `name.png`."""
    source = read_bvh((corpus if "/" in picture.clip else SAMPLES) / picture.clip)
    body = edited(source.rigid_skeleton, TARGETS[picture.target])
    paper, contact = (retarget(source, body, Options(objective=objective)) for objective in ("paper", "contact"))
    turn = facing(source, picture.frames)
    rows = [
        (f"{picture.clip}", source),
        (f"rotation copy, {picture.target}", contact.rotation_copy),
        ("paper", paper.motion),
        ("contact", contact.motion),
    ]
    turned_rows = [(label, turned(motion, turn)) for label, motion in rows]
    draw_strip(
        turned_rows, list(picture.frames), folder / f"{picture.name}.png", view=picture.view, up="Y", same_scale=True
    )


def facing(motion: Motion, frames: tuple[int, ...]) -> Rotation:
    """The rotation after which Y is up, and the body in the first of the frames faces +Z."""
    body = Body.of_motion(motion)
    if body.legs is None:
        return Rotation.identity()
    left, right = (motion.positions[frames[0], leg.hip] for leg in body.legs)
    up, across = body.up_vector, left - right
    across = normalised(across - (across @ up) * up)
    return Rotation.from_matrix(np.stack([across, up, np.cross(across, up)]))


def turned(motion: Motion, turn: Rotation) -> Motion:
    """The motion turned as a whole; lHand and rHand become l_Hand and r_Hand, which the drawing tells apart."""
    names = [re.sub(r"^([lr])(?=[A-Z])", r"\1_", name) for name in motion.skeleton.names]
    rotations = np.array(motion.rotations)
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    skeleton = replace(motion.skeleton, names=tuple(names))
    path = turn.apply(np.array(motion.root_positions))
    return replace(motion, skeleton=skeleton, root_positions=path, rotations=rotations)


def main() -> None:
    """Draw the pictures that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "docs" / "pictures")
    parser.add_argument("--only", default="*", help="only pictures whose names match")
    parser.add_argument("--clip", help="draw this clip instead of those of the page")
    parser.add_argument("--target", choices=TARGETS, help="target of --clip")
    parser.add_argument("--frames", help="frames of --clip, as 0,30,60")
    parser.add_argument("--view", default="three-quarter", help="of --clip: front, side or three-quarter")
    arguments = parser.parse_args()
    pictures = [picture for picture in PICTURES if fnmatch(picture.name, arguments.only)]
    if arguments.clip:
        name = f"{Path(arguments.clip).with_suffix('').as_posix()}_{arguments.target}".replace("/", "_")
        frames = tuple(int(frame) for frame in arguments.frames.split(","))
        pictures = [
            Picture(name=name, clip=arguments.clip, target=arguments.target, frames=frames, view=arguments.view)
        ]
    for picture in pictures:
        if "/" in picture.clip and not (arguments.corpus / picture.clip).is_file():
            print("skipped, not in the corpus:", picture.clip)
            continue
        draw(arguments.folder, arguments.corpus, picture)


if __name__ == "__main__":
    main()
