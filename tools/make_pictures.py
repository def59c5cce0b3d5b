"""Draw the pictures of the front page: a sample clip, its rotation copy on another body, and the result.

    python tools/make_pictures.py [FOLDER]

Writes a moving picture, and a still of one frame for readers who prefer no motion. FOLDER is `docs/pictures` by
default. Needs matplotlib (the extra `docs`). tools/make_gallery.py draws the gallery, benchmarks/pictures.py the
pictures of docs/results.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from animate import Loop

from distretarget import Motion, load_target, read_bvh, retarget

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"
FRAMES = (66, 228)  # of the clap: from one meeting of the hands to another, six claps later
DPI = 170


def rows_of(clip: str, target: str) -> list[tuple[str, Motion]]:
    """A sample clip, its rotation copy on a sample target, and the result, each with a label."""
    source = read_bvh(SAMPLES / f"{clip}.bvh")
    result = retarget(source, load_target(SAMPLES / f"{target}.json"))
    return [("source", source), ("copied rotations", result.rotation_copy), ("distretarget", result.motion)]


def main() -> None:
    """Draw both pictures into the folder on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "docs" / "pictures")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    rows = rows_of("clap", "long_arms")
    loop = Loop.of_motions(rows, FRAMES, view="front", same_scale=True)
    loop.write_gif(folder / "clap_long_arms.gif", DPI)
    loop.write_still(folder / "clap_long_arms.png", 0, DPI)


if __name__ == "__main__":
    main()
