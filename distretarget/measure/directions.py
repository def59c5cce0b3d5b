"""Bone directions of a result, against where the source's motion should point the bones on that body."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import rest_alignment
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.compiled import compiled
from distretarget.numerics.joint_paths import angles_to_bones
from distretarget.numerics.kinematics import turned
from distretarget.numerics.parallel import in_blocks

Array = NDArray[np.float64]
Joints = NDArray[np.intp]
Expected = Callable[[slice], Array]  # directions of bones in a block of frames, (frames, bones, 3)

# Roles whose bones point differently in every build: of trunk, collar bones, hands, head and feet.
BUILT_DIFFERENTLY = ("hips", "spine", "chest", "upperChest", "neck", "head", "Shoulder", "Hand", "Foot", "Toes")


def direction_error(expected: Expected, result: Motion, lower: Joints) -> Array:
    """(frames, bones), the angle between the bones above the joints `lower`, (bones,), and their `expected` directions
    [degrees].
    """
    upper = result.skeleton.parents[lower]

    def angles(block: slice) -> Array:
        return np.degrees(angles_to_bones(expected(block), result.positions[block], upper, lower))

    return in_blocks(angles, len(result))


def expected_directions(source: Motion, matching: Matching, lower: Joints) -> Expected:
    """Return where the target's bones above the joints `lower`, from `shared_bones`, should point in a block of frames,
    (frames, bones, 3); vectors of any length.

    A bone of an arm, leg or finger should point as the source's bone does. Bones of the trunk, collar bones, hands,
    head and feet point differently in every build: the source's rotation, relative to the rest poses, should turn the
    target's own bone.
    """
    drivers, upper = matching.drivers, matching.target.skeleton.parents[lower]
    own = np.isin(upper, _built_differently(matching))
    alignment = rest_alignment(matching)

    bones = matching.target.skeleton.offsets[lower]
    aligned = np.stack([Rotation.from_quat(alignment[upper, k]).apply(bones) for k in (0, 1)], axis=1)
    turns = np.where(own[:, None], matching.rotation_sources[upper], -1), matching.blend[upper], aligned

    def directions(block: slice) -> Array:
        world = source.world_rotations_in(block)
        expected = np.empty((len(world), len(lower), 3))
        _write_directions(source.positions[block], drivers[upper], drivers[lower], world, *turns, expected)
        return expected

    return directions


@compiled()
def _write_directions(positions, upper, lower, world, turning, blend, bones, directions):  # type: ignore[no-untyped-def]
    """Write the directions from the joints `upper` to `lower`, (bones,) each; of bones that joints turn, (bones, 2) or
    -1, those of `bones`, (bones, 2, 3), with the world rotations R of both joints, blended: R A b.
    """
    for frame in range(len(directions)):
        for n in range(len(lower)):
            way, p, q = directions[frame, n], positions[frame, upper[n]], positions[frame, lower[n]]
            way[0], way[1], way[2] = q[0] - p[0], q[1] - p[1], q[2] - p[2]
            for k in range(2):
                if turning[n, k] >= 0 and (k == 0 or blend[n] > 0.0):
                    r, v = world[frame, turning[n, k]], bones[n, k]
                    x, y, z = turned(r[0], r[1], r[2], r[3], v[0], v[1], v[2])
                    share = blend[n] if k else 1.0
                    way[0] = share * x + (1.0 - share) * way[0]
                    way[1] = share * y + (1.0 - share) * way[1]
                    way[2] = share * z + (1.0 - share) * way[2]


def shared_bones(matching: Matching) -> Joints:
    """(bones,), the lower joints of the target's bones that both bodies have, with a length on both."""
    source, skeleton, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    upper = skeleton.parents
    shared = (drivers >= 0) & (drivers[upper] >= 0) & (skeleton.lengths > 0)
    shared[0] = False
    lower = np.flatnonzero(shared)
    return np.asarray(lower[source.places[drivers[lower]] != source.places[drivers[upper[lower]]]])


def _built_differently(matching: Matching) -> list[int]:
    """The target's joints whose bones point differently in every build; none unless both bodies have an anatomy."""
    anatomy = matching.target.anatomy
    if anatomy is None or matching.source.anatomy is None:
        return []
    joints = [joint for role, joint in anatomy.roles.items() if role.endswith(BUILT_DIFFERENTLY)]
    return [*joints, *anatomy.spine, *anatomy.neck, *matching.target.above_hips]
