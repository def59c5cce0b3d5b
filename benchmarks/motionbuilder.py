"""Retarget real motion to another rig, and compare with what MotionBuilder made of it.

    python benchmarks/motionbuilder.py CORPUS [--markdown FILE] [--only GLOB]

The CMU clips exist in two conversions: on the performers' own skeletons (folder cmu_mb), and retargeted by
MotionBuilder to the Daz figure Aiko 3 (folder cmu_daz), frame for frame. This script retargets each clip of cmu_mb to
the skeleton of the same clip in cmu_daz, without a joint map or any option. It writes the table into FILE, between the
lines `<!-- motionbuilder -->` and `<!-- end -->`.
"""

from __future__ import annotations

import argparse
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from angles import angles
from numpy.typing import NDArray
from tables import insert

from distretarget import Motion, read_bvh, retarget
from distretarget.measure.figures import BY_KEY
from distretarget.measure.metrics import Reference

HEAD = (
    "| clip | frames | direction, copy and MotionBuilder, degrees | direction, result and MotionBuilder "
    "| contact error, copy / MotionBuilder / result | slide, source / MotionBuilder / result |\n"
    "|---|---|---|---|---|---|"
)


def measure(folder: Path, clip: str) -> str:
    """The row of one clip in the table."""
    source, reference = read_bvh(folder / "cmu_mb" / clip), read_bvh(folder / "cmu_daz" / clip)
    run = retarget(source, reference.skeleton)
    motions = (run.rotation_copy, reference, run.motion)
    reference = Reference(run.source, run.matching, run.world.up_vector)
    compared = [reference.compare(motion) for motion in motions]
    contact = " / ".join(f"{BY_KEY['contact_error'].of_clip(one.tracks) or 0.0:.4f}" for one in compared)
    tracks = compared[2].source_tracks, compared[1].tracks, compared[2].tracks
    slide = " / ".join(f"{BY_KEY['slide'].of_clip(one) or 0.0:.3f}" for one in tracks)
    apart = [directions(reference, motion, run.drivers).mean() for motion in (run.rotation_copy, run.motion)]
    return f"| {clip} | {len(source)} | {apart[0]:.1f} | {apart[1]:.1f} | {contact} | {slide} |"


def directions(a: Motion, b: Motion, drivers: NDArray[np.intp]) -> NDArray[np.float64]:
    """(frames, bones), the angles between the bones of two motions on one skeleton [degrees]; only bones whose both
    joints have a driver.
    """
    skeleton = a.skeleton
    lower = np.arange(1, len(skeleton))
    upper = skeleton.parents[1:]
    driven = (drivers[lower] >= 0) & (drivers[upper] >= 0) & (skeleton.lengths[1:] > 0)
    one, other = (motion.positions[:, lower[driven]] - motion.positions[:, upper[driven]] for motion in (a, b))
    return angles(one, other)


def main() -> None:
    """Print the table; write it into the page if one is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--markdown", type=Path, help="write the table into this page")
    parser.add_argument("--only", default="*", help="only clips whose names match")
    arguments = parser.parse_args()
    clips = sorted({path.name for path in (arguments.corpus / "cmu_mb").glob("*.bvh")})
    both = [clip for clip in clips if (arguments.corpus / "cmu_daz" / clip).exists()]
    rows = [HEAD]
    print(HEAD)
    for clip in both:
        if fnmatch(clip, arguments.only):
            rows.append(measure(arguments.corpus, clip))
            print(rows[-1], flush=True)
    if arguments.markdown:
        insert(arguments.markdown, {"motionbuilder": "\n".join(rows)})


if __name__ == "__main__":
    main()
