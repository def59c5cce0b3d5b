"""The rotation copy: the source's rotations on the target's bones. The baseline, and where everything starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.matching import Matching
from distretarget.motion import Motion, local_rotations, rigid_motion
from distretarget.rest_pose import rest_alignment

Array = NDArray[np.float64]


def rotation_copy(motion: Motion, matching: Matching, scale: float, up: Array) -> Motion:
    """The motion whose world rotations are R_src(t) A: those of the source, relative to the target's rest pose.

    Joints that follow two source joints turn between the two, joints that follow none with their parents. The pelvis,
    from which the legs part, goes where the source's goes, times `scale` [target units per source unit]; without legs
    the topmost joint that has a driver. `up`, (3,), points up in `motion`.
    """
    target = matching.target
    rest = rest_alignment(matching, motion, up)
    world = np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), len(target), 1))
    for joint, (first, second) in enumerate(matching.turns):
        if first >= 0:
            turned, other = (
                Rotation.from_quat(motion.world_rotations[:, driver]) * Rotation.from_quat(rest[joint, k])
                for k, driver in enumerate((first, second))
            )
            if first != second:
                turned = turned * Rotation.from_rotvec(matching.shares[joint] * (turned.inv() * other).as_rotvec())
            world[:, joint] = turned.as_quat()
        elif joint:
            world[:, joint] = world[:, target.parents[joint]]
    local = local_rotations(target, world)
    pelvis = matching.pelvis
    hung = rigid_motion(target, np.zeros((len(motion), 3)), local, motion.frame_time_text).positions[:, pelvis]
    path = scale * motion.positions[:, matching.drivers[pelvis]] - hung
    return rigid_motion(target, path, local, motion.frame_time_text)
