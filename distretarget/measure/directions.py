"""Bone directions of a result, against where the source's motion should point the bones on that body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rest_pose import rest_alignment
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.kinematics import angles_to_bones
from distretarget.numerics.parallel import in_blocks

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

# Roles whose bones point differently in every build: of trunk, collar bones, hands, head and feet.
BUILT_DIFFERENTLY = ("hips", "spine", "chest", "upperChest", "neck", "head", "Shoulder", "Hand", "Foot", "Toes")


def direction_error(expected: Array, result: Motion, lower: Joints) -> Array:
    """(frames, bones), the angle between the bones above the joints `lower`, (bones,), and their `expected` directions,
    (frames, bones, 3), of any length [degrees].
    """
    angles = angles_to_bones(expected, result.positions, result.skeleton.parents[lower], lower)
    return np.degrees(angles, out=angles)


def expected_directions(source: Motion, matching: Matching, lower: Joints) -> Array:
    """(frames, bones, 3), where the target's bones above the joints `lower`, from `shared_bones`, should point; vectors
    of any length.

    A bone of an arm, leg or finger should point as the source's bone does. Bones of the trunk, collar bones, hands,
    head and feet point differently in every build: the source's rotation, relative to the rest poses, should turn the
    target's own bone.
    """
    drivers, upper = matching.drivers, matching.target.skeleton.parents[lower]
    own = np.isin(upper, _built_differently(matching))
    alignment = rest_alignment(matching)

    def directions(block: slice) -> Array:
        positions = source.positions[block]
        expected = positions[:, drivers[lower]] - positions[:, drivers[upper]]
        if own.any():
            world = source.world_rotations_in(block)
            expected[:, own] = _by_rotation(world, alignment, matching, upper[own], lower[own])
        return expected

    return in_blocks(directions, len(source))


def shared_bones(matching: Matching) -> Joints:
    """(bones,), the lower joints of the target's bones that both bodies have, with a length on both."""
    source, skeleton, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    upper = skeleton.parents
    shared = (drivers >= 0) & (drivers[upper] >= 0) & (skeleton.lengths > 0)
    shared[0] = False
    lower = np.flatnonzero(shared)
    return lower[source.path_lengths[drivers[lower], drivers[upper[lower]]] > 0]


def _built_differently(matching: Matching) -> list[int]:
    """The target's joints whose bones point differently in every build; none unless both bodies have an anatomy."""
    anatomy = matching.target.anatomy
    if anatomy is None or matching.source.anatomy is None:
        return []
    joints = [joint for role, joint in anatomy.roles.items() if role.endswith(BUILT_DIFFERENTLY)]
    return [*joints, *anatomy.spine, *anatomy.neck, *matching.target.above_hips]


def _by_rotation(world: Array, alignment: Array, matching: Matching, upper: Joints, lower: Joints) -> Array:
    """(frames, bones, 3), R A b: the target's own bones b, turned by A from its rest pose to the source's, then by the
    source's world rotations R, `world`, (frames, source joints, 4).
    """

    def turned(bones: Joints, k: int) -> Array:
        """The bones turned by their first (k = 0) or second (k = 1) rotation source."""
        own = Rotation.from_quat(alignment[upper[bones], k]).apply(matching.target.skeleton.offsets[lower[bones]])
        return np.asarray(Rotation.from_quat(world[:, matching.rotation_sources[upper[bones], k]]).apply(own))

    weight = matching.blend[upper, None]
    between = np.flatnonzero(weight)
    directions = turned(np.arange(len(upper)), 0)
    if len(between):
        directions[:, between] *= 1.0 - weight[between]
        directions[:, between] += weight[between] * turned(between, 1)
    return directions
