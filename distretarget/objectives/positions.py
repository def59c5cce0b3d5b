"""Motions of given positions: the rotations of rigid bones that keep the distances between the positions, Eq. (2).

Positions show where the bones of a joint point, not how a single bone is twisted; it gets the least turn against its
parent's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.distances import distance_problem
from distretarget.ik.rigid_parts import part_of_joint, posed_motion
from distretarget.motion import Motion
from distretarget.numerics.rotations import best_rotation
from distretarget.objectives.paper import Posed, solve_poses
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]


def motion_of_positions(skeleton: Skeleton, joints: NDArray[np.intp], positions: Array, frame_time_text: str) -> Motion:
    """Return the motion of a skeleton that keeps the distances between positions best.

    `positions`, (frames, positions, 3), are those of `joints`, all but End Sites at least, in any unit and for any
    bone lengths: what the bones are longer or shorter than the positions show, the root's path is, too.
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
    posed = Posed(source, copy, copy.root_positions, distances, parts)
    poses = solve_poses(posed, np.zeros((len(copy), int(parts.max()) + 2, 3)))
    return posed_motion(copy, poses.v, parts, copy.root_positions + poses.v[:, -1])


def _as_motion(skeleton: Skeleton, joints: NDArray[np.intp], positions: Array, frame_time_text: str) -> Motion:
    """The positions as a motion of bones that stretch and do not turn."""
    places = np.zeros((len(positions), len(skeleton), 3))
    places[:, joints] = positions
    translations = np.tile(skeleton.offsets, (len(positions), 1, 1))
    translations[:, joints] = places[:, joints] - np.where(
        joints[:, None] > 0, places[:, skeleton.parents[joints]], 0.0
    )
    turns = np.tile(skeleton.unturned, (len(positions), 1, 1))
    return Motion.of_translations(skeleton, translations, turns, frame_time_text)


def _fitted(skeleton: Skeleton, source: Motion, scale: float, shown: NDArray[np.bool_]) -> Motion:
    """The motion whose bones point as those of the source, from the root down, with the root on its path, scaled."""
    frames = len(source)
    local = np.tile(skeleton.unturned, (frames, 1, 1))
    world: list[Rotation] = []
    for joint, parent in enumerate(skeleton.parents.tolist()):
        above = world[parent] if joint else Rotation.identity(frames)
        ends = [child for child in skeleton.children[joint] if shown[child] and skeleton.lengths[child] > 0]
        turn = Rotation.identity(frames)
        if ends:
            bones = np.tile(skeleton.offsets[ends], (frames, 1, 1))
            goals = source.positions[:, ends] - source.positions[:, [joint]]
            back = above.inv().as_matrix()
            turn = Rotation.from_quat(best_rotation(bones, np.einsum("fij,fnj->fni", back, goals)))
        local[:, joint] = turn.as_quat()
        world.append(above * turn)
    return Motion(skeleton, scale * source.root_positions, local, source.frame_time_text)
