"""Draw the pictures of the documentation: a sample clip above the same clip on another body.

    python tools/make_pictures.py [FOLDER]

The folder is `docs/pictures` of this project unless another one is given. It needs matplotlib,
the extra `docs`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from draw import draw_strip

from distretarget import load_target, read_bvh, retarget

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"
PICTURES = (("squat", "child", [20, 58, 72, 100, 130, 146]),)


def draw_pair(clip: str, target: str, frames: list[int], folder: Path) -> None:
    """Draw frames of a sample clip, and below them the same frames on a sample body, as `clip.png`."""
    source = read_bvh(SAMPLES / f"{clip}.bvh")
    body = load_target(SAMPLES / f"{target}.json", source.rigid_skeleton)
    result = retarget(source, body.skeleton, joint_map=body.map)
    rows = [(f"{clip}.bvh", source), (f"{clip}.bvh on {target}.json", result.motion)]
    draw_strip(rows, frames, folder / f"{clip}.png", same_scale=True)


def main() -> None:
    """Draw all pictures into the folder on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "docs" / "pictures")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for clip, target, frames in PICTURES:
        draw_pair(clip, target, frames, folder)


if __name__ == "__main__":
    main()
