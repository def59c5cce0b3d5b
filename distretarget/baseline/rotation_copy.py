"""The rotation copy: the source's rotations on the target's bones. The baseline, and where everything starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rest_pose import rest_alignment
from distretarget.matching.matching import Matching
from distretarget.motion import Motion, local_rotations, rigid_motion

Array = NDArray[np.float64]


def rotation_copy(
    motion: Motion, matching: Matching, scale: float, up: Array, target_motion: Motion | None = None
) -> Motion:
    """The motion whose world rotations are R_src(t) A: those of the source, relative to the target's rest pose.

    Joints that follow two source joints turn between the two, joints that follow none with their parents. The pelvis,
    from which the legs part, goes where the source's goes, times `scale` [target units per source unit]; without legs
    the topmost joint that has a driver. `up`, (3,), points up in `motion`;
    `target_motion`, if there is any, tells what the target's rest pose does not (`rest_pose`).
    """
    target = matching.target
    rest = rest_alignment(matching, motion, up, target_motion)
    world = np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), len(target), 1))
    driven, between = np.flatnonzero(matching.turns[:, 0] >= 0), np.flatnonzero(matching.shares > 0)
    world[:, driven] = _turned(motion, matching, rest, driven, 0).as_quat()
    if len(between):
        first, second = (_turned(motion, matching, rest, between, k) for k in (0, 1))
        ways = (first.inv() * second).as_rotvec() * matching.shares[between, None]
        world[:, between] = (first * Rotation.from_rotvec(ways)).as_quat()
    for joint in range(1, len(target)):
        if matching.turns[joint, 0] < 0:
            world[:, joint] = world[:, target.parents[joint]]
    local = local_rotations(target, world)
    pelvis = matching.pelvis
    hung = rigid_motion(target, np.zeros((len(motion), 3)), local, motion.frame_time_text).positions[:, pelvis]
    path = scale * motion.positions[:, matching.drivers[pelvis]] - hung
    return rigid_motion(target, path, local, motion.frame_time_text)


def _turned(motion: Motion, matching: Matching, rest: Array, joints: NDArray[np.intp], k: int) -> Rotation:
    """(frames, joints), the world rotations of some target joints by the first or second source joint they follow."""
    drivers = matching.turns[joints, k]
    return Rotation.from_quat(motion.world_rotations[:, drivers]) * Rotation.from_quat(rest[joints, k])
