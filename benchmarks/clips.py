"""The sample clips and those of the corpus that the benchmarks use, and clips of any length made from them."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from distretarget import Motion

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"
sys.path.append(str(ROOT / "tools"))  # for the benchmarks that draw, or make bodies
CLIPS = [
    *(f"cmu_mb/{clip}.bvh" for clip in ("02_01", "02_05", "02_10", "05_03", "05_12", "12_01")),
    *(f"cmu_daz/{clip}.bvh" for clip in ("05_03", "13_11", "14_04", "14_30")),
    *(f"animated_drawings/{clip}.bvh" for clip in ("jesse_dance", "zombie")),
]
LONG = 10_000  # frames of a long clip


def found(clips: Iterable[str], corpus: Path, pattern: str = "*") -> dict[str, Path]:
    """The clips that match a pattern and exist: those with a folder are in the corpus, others are samples. Prints the
    names of those that are missing.
    """
    paths = {clip: (corpus if "/" in clip else SAMPLES) / clip for clip in clips if fnmatch(clip, pattern)}
    if absent := [clip for clip, path in paths.items() if not path.is_file()]:
        print("skipped, missing:", *absent)
    return {clip: path for clip, path in paths.items() if clip not in absent}


def back_and_forth(motion: Motion, frames: int) -> Motion:
    """The motion played forwards and backwards until it has this many frames; needs at least two frames."""
    last = len(motion) - 1
    order = last - np.abs(np.arange(frames) % (2 * last) - last)
    return motion[order]
