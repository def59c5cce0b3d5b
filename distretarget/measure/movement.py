"""How bones point in a result."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import rest_alignment
from distretarget.matching.matching import Matching, by_soles
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import angles_to_bones, write_directions
from distretarget.numerics.parallel import in_blocks
from distretarget.numerics.vectors import Array, Numbers
from distretarget.rig import found_once

Expected = Callable[[slice], Array]  # directions of bones in a block of frames, (frames, bones, 3), of any length

# Roles whose bones point differently in every build: of trunk, collar bones, hands, head and feet.
BUILT_DIFFERENTLY = ("hips", "spine", "chest", "upperChest", "neck", "head", "Shoulder", "Hand", "Foot", "Toes")


@found_once
def shared_bones(matching: Matching) -> Numbers:
    """(bones,), the lower joints of the target's bones that both bodies have, with a length on both."""
    source, skeleton, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    upper = skeleton.parents
    shared = (drivers >= 0) & (drivers[upper] >= 0) & (skeleton.lengths > 0)
    shared[0] = False
    lower = np.flatnonzero(shared)
    return np.asarray(lower[source.places[drivers[lower]] != source.places[drivers[upper[lower]]]])


def direction_error(expected: Expected, result: Motion, lower: Numbers) -> Array:
    """(frames, bones), the angle of the bones above the joints `lower` to their `expected` directions [degrees]."""
    upper = result.skeleton.parents[lower]

    def angles(block: slice) -> Array:
        return np.degrees(angles_to_bones(expected(block), result.positions[block], upper, lower))

    return in_blocks(angles, len(result))


def expected_directions(source: Motion, matching: Matching) -> Expected:
    """Return where the `shared_bones` of the target should point.

    A bone of an arm, leg or finger should point as the source's bone does. Bones of the trunk, collar bones, hands,
    head and feet point differently in every build: the source's rotation, relative to the rest poses, should turn the
    target's own bone.
    """
    drivers, lower, turns = matching.drivers, shared_bones(matching), _turned_bones(matching)
    upper = matching.target.skeleton.parents[lower]

    def directions(block: slice) -> Array:
        world = source.world_rotations_in(block)
        expected = np.empty((len(world), len(lower), 3))
        write_directions(source.positions[block], drivers[upper], drivers[lower], world, *turns, expected)
        return expected

    return directions


@by_soles
def _turned_bones(matching: Matching) -> tuple[Numbers, Array, Array]:
    """For each of the `shared_bones` the joints that turn it, (bones, 2), or -1, their blend, (bones,), and the bone in
    the axes of these joints, (bones, 2, 3).
    """
    lower, skeleton, alignment = shared_bones(matching), matching.target.skeleton, rest_alignment(matching)
    upper, bones = skeleton.parents[lower], skeleton.offsets[lower]
    own = np.isin(upper, _built_differently(matching))
    aligned = np.stack([Rotation.from_quat(alignment[upper, k]).apply(bones) for k in (0, 1)], axis=1)
    return np.where(own[:, None], matching.rotation_sources[upper], -1), matching.blend[upper], aligned


def _built_differently(matching: Matching) -> list[int]:
    """The target's joints whose bones point differently in every build; none unless both bodies have an anatomy."""
    anatomy = matching.target.anatomy
    if anatomy is None or matching.source.anatomy is None:
        return []
    joints = [joint for role, joint in anatomy.roles.items() if role.endswith(BUILT_DIFFERENTLY)]
    return [*joints, *anatomy.spine, *anatomy.neck, *matching.target.above_hips]
