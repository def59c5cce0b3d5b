"""From points to rotations: the target's joints turned so that its exact bones reach for given points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion, rigid_motion
from distretarget.numerics.euler import restrict
from distretarget.numerics.rotations import best_rotation
from distretarget.skeleton import Skeleton
from distretarget.solve.articulation import rigid_heads


def swing(copy: Motion, points: NDArray[np.float64], solved: NDArray[np.intp]) -> Motion:
    """The motion whose bones point as the solved points say, from the root down.

    Each rigid part deviates from the rotation copy by the rotation that takes its bones, as the copy has them, nearest
    to the points below it: the least rotation for one bone, a weighted alignment for several. So the twist, which
    points do not determine, is the copy's, which is the source's relative to the target's rest pose. A joint with no
    point below it keeps the copy's world rotation. Joints with fewer than three rotation channels turn as far as
    those allow, and what is below them makes up for it.

    Args:
        copy: the rotation copy on the target.
        points: (frames, joints, 3), positions; only those of `solved` are looked at [file units].
        solved: the joints that have points.
    """
    skeleton = copy.skeleton
    heads = rigid_heads(copy)
    handles = _handles(skeleton, heads, set(solved.tolist()))
    positions = np.array(copy.positions)
    world = np.array(copy.world_rotations)
    local = np.array(copy.rotations)
    deviations = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), len(copy), 1))
    for joint, head in enumerate(heads):
        above = world[:, skeleton.parents[joint]] if joint else np.array([[0.0, 0.0, 0.0, 1.0]])
        if joint:
            positions[:, joint] = positions[:, skeleton.parents[joint]] + _turn(above, skeleton.offsets[joint])
        if handles[joint]:
            bones = copy.positions[:, handles[joint]] - copy.positions[:, joint, None]
            deviations[joint] = best_rotation(bones, points[:, handles[joint]] - positions[:, joint, None])
        world[:, joint] = _product(deviations[head], copy.world_rotations[:, joint])
        local[:, joint] = _product(above * [-1, -1, -1, 1], world[:, joint])
        axes = skeleton.rotation_axes(joint)
        if len(axes) < 3:
            local[:, joint] = restrict(local[:, joint], axes)
            world[:, joint] = _product(above, local[:, joint])
    return rigid_motion(skeleton, copy.root_positions, local, copy.frame_time_text)


def _handles(skeleton: Skeleton, heads: NDArray[np.intp], solved: set[int]) -> list[list[int]]:
    """Per joint, where it heads a rigid part, the joints with points that the part's bones carry, away from it."""
    handles: list[list[int]] = [[] for _ in heads]
    for joint in range(1, len(skeleton)):
        head = int(heads[skeleton.parents[joint]])
        if joint in solved and skeleton.path_lengths[head, joint] > 0:
            handles[head].append(joint)
    return handles


def _turn(rotations: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(Rotation.from_quat(rotations).apply(np.array(vector)))  # scipy wants it writable


def _product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat())
