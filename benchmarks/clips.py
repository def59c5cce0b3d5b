"""The clips that the benchmarks use, samples and real ones, bodies with other bone lengths, and shared options."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from fnmatch import fnmatch
from pathlib import Path

import click
import numpy as np

from distretarget import Motion, Skeleton

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

# The part of the body that a bone belongs to, by the name of its lower joint; the first pattern that matches counts.
PARTS = {
    "hand": r"finger|thumb|index|mid|ring|pinky|metacarp|(hand|wrist)_?end",
    "foot": r"toe|metatars|(foot|ankle)_?end",
    "upper arm": r"forearm|elbow|lowerarm|lowarm",
    "forearm": r"hand|wrist",
    "shoulders": r"arm|shoulder|shldr|collar|clavicle",
    "shin": r"foot|ankle",
    "hips": r"upleg|upperleg|thigh|hip|buttock|pelvis\.",
    "thigh": r"leg|knee|shin|calf",
    "trunk": r"spine|back|abdomen|chest|neck|head|torso|waist",
}
LEGS = ("thigh", "shin", "foot")
ARMS = ("upper arm", "forearm", "hand")

# Factors on the lengths of the bones of each part; other bones keep their lengths.
TARGETS: dict[str, dict[str, float]] = {
    "spine +60 %": {"trunk": 1.6},
    "forearm and hand +50 %": {"forearm": 1.5, "hand": 1.5},
    "lower legs -30 %": {"shin": 0.7},
    "child": {**dict.fromkeys(LEGS, 0.6), **dict.fromkeys(ARMS, 0.7), "trunk": 0.85},
    "H": {"thigh": 1.5, "shin": 1.1, "hips": 1.35, "shoulders": 1.2, "upper arm": 0.7, "forearm": 0.95, "trunk": 1.15},
}
ARMS_AND_LEGS = {**dict.fromkeys(ARMS, 1.3), **dict.fromkeys(LEGS, 0.8)}

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


def part_of(name: str) -> str | None:
    """The part of the body that the bone above a joint belongs to, by the joint's name; None for an unknown name."""
    return next((part for part, pattern in PARTS.items() if re.search(pattern, name.lower())), None)


def edited(skeleton: Skeleton, factors: dict[str, float]) -> Skeleton:
    """The skeleton with the bones of each part scaled by its factor."""
    scale = [factors.get(part_of(name) or "", 1.0) for name in skeleton.names]
    return skeleton.with_lengths(skeleton.lengths * np.array(scale))
