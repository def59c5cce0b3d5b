"""From points to rotations: turn the target's joints so that its exact bones come nearest to given points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.euler import restrict
from distretarget.numerics.rotations import best_rotation
from distretarget.skeleton import Skeleton


def fit_rotations(
    copy: Motion, points: NDArray[np.float64], joints: NDArray[np.intp], roots: NDArray[np.intp]
) -> Motion:
    """Turn the bones of the rotation copy towards points, from the root down.

    Each rigid part deviates from the copy by the rotation that brings its bones nearest to the points they carry: the
    least rotation for one bone, a weighted alignment for several. So the twist, which points do not determine, stays
    that of the copy. A joint with no point below it keeps the copy's world rotation. Joints with fewer than three
    rotation channels turn as far as these allow, and the joints below them make up for the rest.

    Args:
        copy: the rotation copy on the target.
        points: (frames, joints, 3), positions; only those of `joints` count [file units].
        joints: the joints that have points.
        roots: (joints,), the topmost joint of the rigid part that each joint belongs to.
    """
    skeleton = copy.skeleton
    carried = _carried_points(skeleton, roots, set(joints.tolist()))
    positions = np.array(copy.positions)
    world = copy.world_rotations
    local = np.array(copy.rotations)
    deviations = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), len(copy), 1))
    for joint, root in enumerate(roots):
        above = world[:, skeleton.parents[joint]] if joint else np.array([[0.0, 0.0, 0.0, 1.0]])
        if joint:
            positions[:, joint] = positions[:, skeleton.parents[joint]] + _turn(above, skeleton.offsets[joint])
        if carried[joint]:
            bones = copy.positions[:, carried[joint]] - copy.positions[:, joint, None]
            deviations[joint] = best_rotation(bones, points[:, carried[joint]] - positions[:, joint, None])
        world[:, joint] = _product(deviations[root], world[:, joint])
        local[:, joint] = _product(above * [-1, -1, -1, 1], world[:, joint])
        axes = skeleton.rotation_axes(joint)
        if len(axes) < 3:
            local[:, joint] = restrict(local[:, joint], axes)
            world[:, joint] = _product(above, local[:, joint])
    return Motion(skeleton, copy.root_positions, local, copy.frame_time_text)


def _carried_points(skeleton: Skeleton, roots: NDArray[np.intp], joints: set[int]) -> list[list[int]]:
    """For the root of each rigid part, those of `joints` at the ends of the part's bones and away from it."""
    carried: list[list[int]] = [[] for _ in roots]
    for joint in range(1, len(skeleton)):
        root = int(roots[skeleton.parents[joint]])
        if joint in joints and skeleton.path_lengths[root, joint] > 0:
            carried[root].append(joint)
    return carried


def _turn(rotations: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(Rotation.from_quat(rotations).apply(np.array(vector)))  # a copy: scipy needs a writable array


def _product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat())
