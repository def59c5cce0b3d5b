"""Motions from positions: the rotations of rigid bones that keep the distances between given positions, Eq. (2).

Positions show the directions of bones, but not the twist of a single bone: it takes the least rotation against its
parent. Upper arms and thighs twist so that elbows and knees bend about their own axes, as far as they are bent.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES
from distretarget.body.body import Body
from distretarget.distances import distance_problem
from distretarget.ik.poses import part_of_joint, posed_motion
from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.rotations import best_rotation
from distretarget.numerics.vectors import Array, Flags, Numbers, cross, lengths, level, normalised
from distretarget.objectives.paper import BareClip, solve_poses
from distretarget.skeleton import Skeleton

SURE = 0.15  # the twist of a limb is reliable if it is bent by more than this [sine of the angle]
SPAN = 0.15  # twists are averaged over this time before and after a frame [s]


def motion_of_positions(skeleton: Skeleton, joints: Numbers, positions: Array, frame_time_text: str) -> Motion:
    """Return the motion of a skeleton that keeps the distances between positions best.

    `positions`, (frames, positions, 3), are those of `joints`, which have to include all but End Sites. They may be in
    any unit, and of a body with other bone lengths: the root's path is scaled by the ratio of bone lengths.
    """
    source = _as_motion(skeleton, joints, positions, frame_time_text)
    given = source.rigid_skeleton
    drivers = np.full(len(skeleton), -1)
    drivers[joints] = joints
    shown = (drivers >= 0) & (given.lengths > 0) & (skeleton.lengths > 0)
    scale = float(skeleton.lengths[shown].sum() / given.lengths[shown].sum()) if shown.any() else 1.0
    copy = _fitted(skeleton, source, scale, drivers >= 0)
    distances = distance_problem(given, skeleton, drivers)
    parts = part_of_joint(skeleton, np.arange(len(skeleton)))
    start = BareClip(source, copy, copy.root_positions, distances, parts)
    poses = solve_poses(start, np.zeros((len(copy), int(parts.max()) + 2, 3)))
    posed = posed_motion(copy, poses.v, parts, copy.root_positions + poses.v[:, -1])
    return _placed(posed, scale * source.positions, np.flatnonzero(drivers >= 0))


def _as_motion(skeleton: Skeleton, joints: Numbers, positions: Array, frame_time_text: str) -> Motion:
    """The positions as a motion of bones that stretch and never rotate."""
    places = np.zeros((len(positions), len(skeleton), 3))
    translations = np.tile(skeleton.offsets, (len(positions), 1, 1))
    places[:, joints] = translations[:, joints] = positions
    below = joints[joints > 0]
    translations[:, below] -= places[:, skeleton.parents[below]]
    turns = np.tile(skeleton.rest_rotations, (len(positions), 1, 1))
    return Motion.of_translations(skeleton, translations, turns, frame_time_text)


def _fitted(skeleton: Skeleton, source: Motion, scale: float, shown: Flags) -> Motion:
    """The motion with the directions of the source's bones, and with the path of the source's root, scaled."""
    frames = len(source)
    local, hinges = np.tile(skeleton.rest_rotations, (frames, 1, 1)), _hinges(skeleton)
    world: list[Rotation] = []
    for joint, parent in enumerate(skeleton.parents.tolist()):
        above = world[parent] if joint else Rotation.identity(frames)
        ends = [end for end in _ends(skeleton, joint) if shown[end]]
        turn = Rotation.identity(frames)
        if ends:
            bones = np.tile(skeleton.offsets[ends], (frames, 1, 1))
            goals = source.positions[:, ends] - source.positions[:, [joint]]
            back = above.inv().as_matrix()
            turn = Rotation.from_quat(best_rotation(bones, np.einsum("fij,fnj->fni", back, goals)))
        if joint in hinges:
            lower, end, axis = hinges[joint]
            below = (above * turn).inv().apply(source.positions[:, end] - source.positions[:, lower])
            turn = turn * _twist(skeleton.offsets[lower], below, axis, source.frame_time)
        local[:, joint] = turn.as_quat()
        world.append(above * turn)
    return Motion(skeleton, scale * source.root_positions, local, source.frame_time_text)


def _placed(motion: Motion, points: Array, joints: Numbers) -> Motion:
    """The motion rotated and translated in each frame so that joints are nearest to points, which stress ignores."""
    x, y = motion.positions[:, joints], points[:, joints]
    middle, goal = x.mean(axis=1), y.mean(axis=1)
    turn = Rotation.from_quat(best_rotation(x - middle[:, None], y - goal[:, None]))
    rotations = np.array(motion.rotations)
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    return replace(motion, root_positions=goal + turn.apply(motion.root_positions - middle), rotations=rotations)


def _ends(skeleton: Skeleton, joint: int) -> Iterator[int]:
    """The ends of the bones of a joint, and of the joints that coincide with it."""
    for child in skeleton.children[joint]:
        if skeleton.lengths[child] > 0:
            yield child
        else:
            yield from _ends(skeleton, child)


def _hinges(skeleton: Skeleton) -> dict[int, tuple[int, int, Array]]:
    """For upper arms and thighs, by joint: the joint of the lower bone, its end, and the axis of its bend at rest."""
    body = Body.of(skeleton)
    if body.anatomy is None or not body.stands_at_rest:
        return {}
    hinges = {}
    left, up, _ = body.reference.axes.T
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for (upper, lower, end), axis in ((ARM[1:], -sign * up), (LEG[:3], left)):
            limb = [body.anatomy.roles.get(side + part, -1) for part in (upper, lower, end)]
            if min(limb) >= 0 and skeleton.to_root(limb[2])[1:3] == limb[1::-1]:
                hinges[limb[0]] = (limb[1], limb[2], axis)
    return hinges


def _twist(bone: Array, below: Array, axis: Array, frame_time: float) -> Rotation:
    """The twists about a bone, (3,), after which the bones `below` it, (frames, 3), are bent about an axis, (3,)."""
    along, below = normalised(bone), normalised(below)
    bent, straight = cross(np.broadcast_to(along, below.shape), below), normalised(level(axis, along))
    shown = np.stack([bent @ straight, bent @ cross(along, straight)], axis=1) * lengths(bent)[:, None]
    mean = averaged(shown + np.array([SURE**2, 0.0]), round(SPAN / frame_time))
    return Rotation.from_rotvec(np.arctan2(mean[:, 1], mean[:, 0])[:, None] * along)
