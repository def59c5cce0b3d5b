"""Where the bones of a result point, against where the source's motion points them on that body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rest_pose import rest_alignment
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_blocks
from distretarget.numerics.vectors import angles_between

Array = NDArray[np.float64]

# Roles whose bones point differently in every build: of trunk, collar bones, hands, head and feet.
BUILT_DIFFERENTLY = ("hips", "spine", "chest", "upperChest", "neck", "head", "Shoulder", "Hand", "Foot", "Toes")


def direction_error(expected: Array, result: Motion, lower: NDArray[np.intp]) -> Array:
    """(frames, bones), the angle between the bones that end at the joints `lower`, (bones,), and their expected
    directions, (frames, bones, 3), of any length [degrees].
    """

    def error(block: slice) -> Array:
        positions = result.positions[block]
        bones = positions[:, lower] - positions[:, result.skeleton.parents[lower]]
        return np.asarray(np.degrees(angles_between(expected[block], bones)))

    return in_blocks(error, len(result))


def expected_directions(source: Motion, matching: Matching) -> Array:
    """(frames, bones, 3), where the bones that both bodies have (`bones_of`) are expected to point; lengths vary.

    A bone of an arm, a leg or a finger, and any other, is expected to point as the source's bone does. The bones of
    trunk, collar bones, hands, head and feet point differently in every build: they are expected to point where the
    source's rotation, by way of the rest poses, points the target's own bone.
    """
    lower = bones_of(matching)
    upper = matching.target.skeleton.parents[lower]
    drivers = matching.drivers
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


def bones_of(matching: Matching) -> NDArray[np.intp]:
    """The lower joints of the bones that both bodies have, with a length on both."""
    source, skeleton, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    lower = np.arange(1, len(skeleton))
    upper = skeleton.parents[1:]
    shared = (drivers[lower] >= 0) & (drivers[upper] >= 0) & (skeleton.lengths[1:] > 0)
    lower, upper = lower[shared], upper[shared]
    return lower[source.path_lengths[drivers[lower], drivers[upper]] > 0]


def _built_differently(matching: Matching) -> list[int]:
    """The target's joints whose bones point differently in every build; none unless both bodies have an anatomy."""
    anatomy = matching.target.anatomy
    if anatomy is None or matching.source.anatomy is None:
        return []
    joints = [joint for role, joint in anatomy.roles.items() if role.endswith(BUILT_DIFFERENTLY)]
    return [*joints, *anatomy.spine, *anatomy.neck, *matching.target.above_hips]


def _by_rotation(
    world: Array, alignment: Array, matching: Matching, upper: NDArray[np.intp], lower: NDArray[np.intp]
) -> Array:
    """(frames, bones, 3), the target's own bones turned by the rotations of the source, R A b; R is `world`, (frames,
    source joints, 4), and A the alignment of the rest poses.
    """

    def turned(bones: NDArray[np.intp], k: int) -> Array:
        """The target's own bones, turned by their first (k = 0) or second (k = 1) rotation source."""
        own = Rotation.from_quat(alignment[upper[bones], k]).apply(matching.target.skeleton.offsets[lower[bones]])
        return np.asarray(Rotation.from_quat(world[:, matching.rotation_sources[upper[bones], k]]).apply(own))

    weight = matching.blend[upper, None]
    between = np.flatnonzero(weight)
    directions = turned(np.arange(len(upper)), 0)
    if len(between):
        first, second = (1.0 - weight[between]) * directions[:, between], weight[between] * turned(between, 1)
        directions[:, between] = first + second
    return directions
