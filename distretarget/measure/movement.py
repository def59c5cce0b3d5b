"""How bones point and joints move in a result: directions, lengths, jerk, turns, and pops."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import rest_alignment
from distretarget.body.body import Body
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.compiled import compiled, contiguous, inlined
from distretarget.numerics.joint_paths import angles_to_bones, thirds_along, turns_along
from distretarget.numerics.kinematics import turned
from distretarget.numerics.parallel import blocks_of, in_blocks
from distretarget.numerics.time_series import Shots
from distretarget.numerics.vectors import Array, Numbers, lengths

Expected = Callable[[slice], Array]  # directions of bones in a block of frames, (frames, bones, 3), of any length

# Roles whose bones point differently in every build: of trunk, collar bones, hands, head and feet.
BUILT_DIFFERENTLY = ("hips", "spine", "chest", "upperChest", "neck", "head", "Shoulder", "Hand", "Foot", "Toes")
INSTANT = 1 / 60  # the time over which turns and pops are measured [s]
FAR = 4.0  # a joint pops if it moves farther than this ...
CALM = 1.5  # ... while it moves less than this in the rotation copy [both % of leg length in INSTANT]; ...
SUDDEN = 4.0  # ... or if its deviation from the copy goes as far, and this many times its usual way
NEAR = 2  # how many steps before and after it show its usual way


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


def expected_directions(source: Motion, matching: Matching, lower: Numbers) -> Expected:
    """Return where the target's bones above the joints `lower`, from `shared_bones`, should point.

    A bone of an arm, leg or finger should point as the source's bone does. Bones of the trunk, collar bones, hands,
    head and feet point differently in every build: the source's rotation, relative to the rest poses, should turn the
    target's own bone.
    """
    drivers, upper = matching.drivers, matching.target.skeleton.parents[lower]
    own, alignment = np.isin(upper, _built_differently(matching)), rest_alignment(matching)
    bones = matching.target.skeleton.offsets[lower]
    aligned = np.stack([Rotation.from_quat(alignment[upper, k]).apply(bones) for k in (0, 1)], axis=1)
    turns = np.where(own[:, None], matching.rotation_sources[upper], -1), matching.blend[upper], aligned

    def directions(block: slice) -> Array:
        world = source.world_rotations_in(block)
        expected = np.empty((len(world), len(lower), 3))
        _write_directions(source.positions[block], drivers[upper], drivers[lower], world, *turns, expected)
        return expected

    return directions


def _built_differently(matching: Matching) -> list[int]:
    """The target's joints whose bones point differently in every build; none unless both bodies have an anatomy."""
    anatomy = matching.target.anatomy
    if anatomy is None or matching.source.anatomy is None:
        return []
    joints = [joint for role, joint in anatomy.roles.items() if role.endswith(BUILT_DIFFERENTLY)]
    return [*joints, *anatomy.spine, *anatomy.neck, *matching.target.above_hips]


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


def bone_error(result: Motion, body: Body) -> Array:
    """(frames,), the largest relative error of the length of a bone of the body."""
    skeleton, of_body = result.skeleton, body.regions.of_joint >= 0
    lower = np.flatnonzero((skeleton.lengths > 0) & of_body & of_body[skeleton.parents])
    upper, known = skeleton.parents[lower], skeleton.lengths[lower]

    def errors(block: slice) -> Array:
        x = result.positions[block]
        return np.asarray(np.abs(lengths(x[:, lower] - x[:, upper]) / known - 1.0).max(axis=1, initial=0.0))

    return in_blocks(errors, len(result))


def jerk(motion: Motion, body: Body) -> Array:
    """(frames - 3,), the mean norm of the third difference of the positions of the body's joints [body sizes / s^3]."""
    size = body.skeleton.longest_path * motion.frame_time**3
    return np.asarray(thirds_along(motion.positions, np.flatnonzero(body.regions.of_joint >= 0)) / size)


def turns(motion: Motion, joints: Numbers) -> Array:
    """(frames - 1, joints), the angle from each frame's world rotation to the next [rad]."""
    return turns_along(motion.skeleton.parents, motion.rotations, joints)


def find_pops(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), how far each joint of a result pops on the way to the next frame [% of leg length in
    `INSTANT`]; 0 where it does not pop.

    A joint pops if it moves farther than `FAR` while it hardly moves in the rotation copy, or if its deviation from the
    copy does, `SUDDEN` times the median of the two steps before and the two after it. Joints outside the body, such as
    a root on the floor, do not pop, and no joint pops at a cut of the source between `shots`, (frames,).
    """
    scale = 100 * INSTANT / (0.5 * body.unit * result.frame_time)  # of steps in file units
    pops, going_on = np.zeros((max(len(result) - 1, 0), len(result.skeleton))), np.diff(shots) == 0
    joints = np.flatnonzero(body.regions.of_joint >= 0)
    for block in blocks_of(len(pops)):
        first = max(block.start - NEAR, 0)
        steps = slice(first, block.stop + NEAR)
        frames, rows = slice(first, steps.stop + 1), slice(block.start - first, block.stop - first)
        before, after = (contiguous(motion.positions_in(frames)) for motion in (copy, result))
        found = np.zeros_like(pops[steps])
        _write_pops(before, after, joints, going_on[steps], scale, found)
        pops[block] = found[rows]
    return pops


@compiled()
def _write_pops(copy, result, joints, going_on, scale, pops):  # type: ignore[no-untyped-def]
    """Write the steps that are pops, in % of leg length in `INSTANT`."""
    last = len(pops) - 1
    for frame in range(len(pops)):
        if not going_on[frame]:
            continue
        for joint in joints:
            step = _step(result, copy, frame, joint, 0.0) * scale
            if step > FAR and _step(copy, copy, frame, joint, 0.0) * scale < CALM:
                pops[frame, joint] = step
                continue
            step = _step(result, copy, frame, joint, 1.0) * scale
            if step > FAR:
                total, least, most = 0.0, np.inf, 0.0
                for lag in (-NEAR, -1, 1, NEAR):  # beyond the ends as in a mirror
                    near = max(last - abs(last - abs(frame + lag)), 0)
                    other = _step(result, copy, near, joint, 1.0) * scale
                    total, least, most = total + other, min(least, other), max(most, other)
                if step > SUDDEN * 0.5 * (total - least - most):
                    pops[frame, joint] = step


@inlined()
def _step(motion: Array, copy: Array, frame: int, joint: int, share: float) -> float:
    """How far a joint goes to the next frame, less a share of its way in the copy."""
    square = 0.0
    for i in range(3):
        step = motion[frame + 1, joint, i] - motion[frame, joint, i]
        step -= share * (copy[frame + 1, joint, i] - copy[frame, joint, i])
        square += step * step
    return float(np.sqrt(square))
