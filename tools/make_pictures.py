"""Draw the picture of the front page: a sample clip, its rotation copy on another body, and the result.

    python tools/make_pictures.py [FOLDER]

FOLDER is `docs/pictures` by default. Needs matplotlib (the extra `docs`). benchmarks/pictures.py draws the pictures of
docs/results.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from draw import draw_strip

from distretarget import load_target, read_bvh, retarget

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"
PICTURES = (("clap", "long_arms", [93, 140]),)


def draw_result(clip: str, target: str, frames: list[int], folder: Path) -> None:
    """Draw frames of a sample clip, its rotation copy on a sample target and the result, side by side, into
    `clip_target.png`.
    """
    source = read_bvh(SAMPLES / f"{clip}.bvh")
    body = load_target(SAMPLES / f"{target}.json").for_source(source.rigid_skeleton)
    result = retarget(source, body.skeleton, joint_map=body.map)
    motions = [("source", source), ("rotation copy", result.rotation_copy), ("distretarget", result.motion)]
    draw_strip(motions, frames, folder / f"{clip}_{target}.png", view="front", columns=True, same_scale=True)


def main() -> None:
    """Draw all pictures into the folder on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "docs" / "pictures")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for clip, target, frames in PICTURES:
        draw_result(clip, target, frames, folder)


if __name__ == "__main__":
    main()
