"""The clips that the benchmarks use, samples and real ones, and the command-line options that they share."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from fnmatch import fnmatch
from pathlib import Path

import click
import numpy as np

from distretarget import Motion

ROOT = Path(__file__).resolve().parents[1]
SAMPLES, HERO = ROOT / "sample_bvh", ROOT / "sample_characters" / "hero.glb"
sys.path.append(str(ROOT / "tools"))
SAMPLE_CLIPS = sorted(path.name for path in SAMPLES.glob("*.bvh"))
CLIPS = [
    *(f"cmu_mb/{clip}.bvh" for clip in ("02_01", "02_05", "02_10", "05_03", "05_12", "12_01")),
    *(f"cmu_daz/{clip}.bvh" for clip in ("05_03", "13_11", "14_04", "14_30")),
    *(f"animated_drawings/{clip}.bvh" for clip in ("jesse_dance", "zombie")),
]
LONG = 10_000  # frames of a long clip

corpus_argument = click.argument("corpus", type=Path)
page_type = click.Path(exists=True, dir_okay=False, path_type=Path)
markdown_option = click.option("--markdown", "page", type=page_type, help="Write the tables into this page.")


def found(clips: Iterable[str], corpus: Path, pattern: str = "*") -> dict[str, Path]:
    """Existing clips that match a pattern: samples, or with a folder of the corpus; prints the missing ones."""
    paths = {clip: (corpus if "/" in clip else SAMPLES) / clip for clip in clips if fnmatch(clip, pattern)}
    if absent := [clip for clip, path in paths.items() if not path.is_file()]:
        print("skipped, missing:", *absent)
    return {clip: path for clip, path in paths.items() if clip not in absent}


def back_and_forth(motion: Motion, frames: int) -> Motion:
    """The motion played forwards and backwards until it has this many frames; needs at least two frames."""
    last = len(motion) - 1
    order = last - np.abs(np.arange(frames) % (2 * last) - last)
    return motion[order]
