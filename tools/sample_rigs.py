"""The sample rigs, `sample_bvh/rigs`: an adult of about 1.75 m in the naming conventions of four programs.

Segment lengths follow Winter, Biomechanics and Motor Control of Human Movement, metric 4.1.
"""

from __future__ import annotations

from pathlib import Path

from skeleton_edits import LYING, with_axes

from distretarget import Skeleton, load_target

RIGS = Path(__file__).resolve().parents[1] / "sample_bvh" / "rigs"
CONVENTIONS = ("mixamo", "xsens", "lafan1", "unreal")
POSES = ("T", "A")


def rig(convention: str, pose: str) -> Skeleton:
    """The skeleton of a convention in a rest pose [cm]; the root's OFFSET puts its feet on the floor.

    In "T" the arms point sideways, in "A" 45 degrees below the horizontal. "X" is the rest pose of LAFAN1's files, in
    which nobody can stand: see `LYING`.
    """
    if pose != "X":
        return load_target(RIGS / f"{convention}_{pose.lower()}.json").skeleton
    if convention != "lafan1":
        raise ValueError(f"only lafan1 has pose X, not {convention}")
    standing = rig("lafan1", "T")
    skeleton = with_axes(standing, LYING["X"].axes(standing))
    return skeleton.with_offsets(skeleton.offsets.round(6))
