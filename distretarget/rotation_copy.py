"""The rotation copy: the source's rotations on the target's bones. The baseline, and where everything starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.alignment import best_rotation
from distretarget.motion import Motion, local_rotations, rigid_motion
from distretarget.skeleton import Skeleton


def rotation_copy(
    motion: Motion, target: Skeleton, drivers: NDArray[np.intp], root_positions: NDArray[np.float64]
) -> Motion:
    """The motion whose world rotations are R_src(t) A: those of the source, relative to the target's rest pose.

    `drivers`, (target joints,), is the source joint that drives each target joint; joints without one follow their
    parents. `root_positions`, (frames, 3), is the target's root path [target file units].
    """
    rest = rest_alignment(motion.rigid_skeleton, target, drivers)
    world = np.empty((len(motion), len(target), 4))
    for joint, driver in enumerate(drivers):
        if driver >= 0:
            turned = Rotation.from_quat(motion.world_rotations[:, driver]) * Rotation.from_quat(rest[joint])
            world[:, joint] = turned.as_quat()
        else:
            world[:, joint] = world[:, target.parents[joint]]
    return rigid_motion(target, root_positions, local_rotations(target, world), motion.frame_time_text)


def rest_alignment(source: Skeleton, target: Skeleton, drivers: NDArray[np.intp]) -> NDArray[np.float64]:
    """A: (target joints, 4), the rotations that take the target's rest bones of each joint onto the source's.

    The least such rotation where a joint has one bone, the best fit where it has several; a joint without bones is
    turned as its parent.
    """
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(target), 1))
    for joint in range(len(target)):
        below = [c for c in target.children[joint] if drivers[c] >= 0 and drivers[joint] >= 0]
        ours = target.offsets[below]
        theirs = source.rest_positions[drivers[below]] - source.rest_positions[drivers[joint]]
        seen = (np.linalg.norm(ours, axis=1) > 0) & (np.linalg.norm(theirs, axis=1) > 0)
        if seen.any():
            rotations[joint] = best_rotation(_unit(ours[seen])[None], _unit(theirs[seen])[None])[0]
        elif joint:
            rotations[joint] = rotations[target.parents[joint]]
    return rotations


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
