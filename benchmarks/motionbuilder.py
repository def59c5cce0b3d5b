"""Retarget real motion to another rig, and compare with what MotionBuilder made of it.

    python benchmarks/motionbuilder.py CORPUS [--markdown FILE] [--only GLOB]

The CMU clips exist in two conversions: on the performers' own skeletons (folder cmu_mb), and retargeted by
MotionBuilder to the Daz figure Aiko 3 (folder cmu_daz), frame for frame. This script retargets each clip of cmu_mb to
the skeleton of the same clip in cmu_daz, without a joint map or any option.
"""

from __future__ import annotations

from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import click
import numpy as np
from clips import corpus_argument, markdown_option
from numpy.typing import NDArray
from tables import publish, several, table

from distretarget import Motion, read_bvh, retarget
from distretarget.measure.comparison import Reference
from distretarget.measure.metrics import BY_KEY
from distretarget.numerics.vectors import angles_between

COLUMNS = (
    "clip | direction off MotionBuilder's, degrees: copy / result | "
    "contact error, copy / MotionBuilder / result | foot skate, source / MotionBuilder / result"
)


def measure(corpus: Path, clip: str) -> Iterator[str]:
    """The table row of one clip."""
    source, peer = read_bvh(corpus / "cmu_mb" / clip), read_bvh(corpus / "cmu_daz" / clip)
    run = retarget(source, peer.skeleton)
    reference = Reference(run.source, run.matching, run.world.up_vector)
    copy, other, result = (reference.compare(motion) for motion in (run.rotation_copy, peer, run.motion))
    yield clip.removesuffix(".bvh")
    yield several((directions(peer, motion, run.drivers).mean() for motion in (run.rotation_copy, run.motion)), ".1f")
    yield several([BY_KEY["contact_error"].of_clip(one.tracks) or 0.0 for one in (copy, other, result)], ".4f")
    tracks = result.source_tracks, other.tracks, result.tracks
    yield several([BY_KEY["foot_skate"].of_clip(one) or 0.0 for one in tracks], ".3f")


def directions(a: Motion, b: Motion, drivers: NDArray[np.intp]) -> NDArray[np.float64]:
    """(frames, bones), angles between bones of two motions on one skeleton, with drivers at both ends [degrees]."""
    skeleton = a.skeleton
    lower = np.flatnonzero((drivers >= 0) & (drivers[skeleton.parents] >= 0) & (skeleton.lengths > 0))
    lower = lower[lower > 0]
    one, other = (motion.positions[:, lower] - motion.positions[:, skeleton.parents[lower]] for motion in (a, b))
    return np.degrees(angles_between(one, other))


@click.command(help=__doc__)
@corpus_argument
@markdown_option
@click.option("--only", default="*", help="Only clips whose names match.")
def main(corpus: Path, page: Path | None, only: str) -> None:
    """Print the table; write it into the page if one is given."""
    names = ({path.name for path in (corpus / folder).glob("*.bvh")} for folder in ("cmu_mb", "cmu_daz"))
    clips = sorted(clip for clip in set.intersection(*names) if fnmatch(clip, only))
    publish({"motionbuilder": table(COLUMNS, (measure(corpus, clip) for clip in clips))}, page)


if __name__ == "__main__":
    main()
