"""Rest poses: arms sideways, lowered or down, and one in which nobody can stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.skeleton import Skeleton
from zoo.tree import roles, turned_below

Pose = Literal["T", "A", "I", "X"]

LOWERED: Mapping[Pose, float] = {"T": 0.0, "A": 45.0, "I": 85.0, "X": 0.0}  # the arms, below the horizontal [degrees]


def posed(skeleton: Skeleton, pose: Pose) -> Skeleton:
    """The skeleton, given in T-pose, in a rest pose.

    In "X", which LAFAN1's files have, every only child lies along +X of its parent, and the offsets of siblings are
    written in axes that point up, forward and left.
    """
    for side, sign in zip(SIDES, (-1, 1), strict=True):
        turn = Rotation.from_euler("Z", sign * LOWERED[pose], degrees=True)
        skeleton = turned_below(skeleton, roles(skeleton)[f"{side}UpperArm"], turn)
    return _along_x(skeleton) if pose == "X" else skeleton


def _along_x(skeleton: Skeleton) -> Skeleton:
    offsets = np.array(skeleton.offsets)[:, [1, 2, 0]]
    alone = [joint for joint in range(1, len(skeleton)) if len(skeleton.children[skeleton.parents[joint]]) == 1]
    offsets[alone] = skeleton.lengths[alone, None] * np.array([1.0, 0.0, 0.0])
    offsets[0] = skeleton.offsets[0]
    return skeleton.with_offsets(offsets)
