"""Limbs that bend out of the way: arms and legs, by their top, middle and end joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.rotations import least_rotation
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True)
class Limb:
    """An arm or a leg."""

    top: int  # the joint that it turns about, such as the shoulder
    middle: int  # elbow or knee
    end: int  # wrist or ankle

    @property
    def joints(self) -> tuple[int, int, int]:
        """Top, middle and end."""
        return self.top, self.middle, self.end


def shares_of(
    limbs: tuple[Limb, ...], skeleton: Skeleton, places: Array, joints: Numbers, points: Array
) -> tuple[Numbers, Array]:
    """Return the limb that each point belongs to, (points,), -1 for none, and its shares of the displacements of middle
    and end, (points, 2). `joints`, (points,), carry the points, (points, 3); `places`, (joints, 3), are all joints'.
    """
    numbers, shares = np.full(len(joints), -1), np.zeros((len(joints), 2))
    for number, limb in enumerate(limbs):
        below = set(skeleton.subtree(limb.top))
        top, middle, end = places[[*limb.joints]]
        for k in (k for k, joint in enumerate(joints.tolist()) if joint in below):
            upper, lower = _along(top, middle, points[k]), _along(middle, end, points[k])
            numbers[k] = number
            shares[k] = (1.0 - lower, lower) if upper >= 1.0 or lower > 0.0 else (upper, 0.0)
    return numbers, shares


def _along(a: Array, b: Array, point: Array) -> float:
    """How far a point is along the line from a to b, 0 to 1."""
    square = float((b - a) @ (b - a))
    return float(np.clip((point - a) @ (b - a) / square, 0.0, 1.0)) if square else 1.0


def bent(motion: Motion, limbs: tuple[Limb, ...], displacements: Array) -> Motion:
    """Return the motion with the middle and the end of each limb displaced, (frames, limbs, 2, 3) [file units].

    The upper and the lower part of a limb turn by the least rotations; what is beyond its end keeps its rotation in the
    world.
    """
    frames = np.flatnonzero(displacements.any(axis=(1, 2, 3)))
    if not len(frames):
        return motion
    skeleton, some = motion.skeleton, motion[frames]
    world, x, moved = some.world_rotations, some.positions, displacements[frames]
    rotations = np.array(motion.rotations)
    local = np.array(some.rotations)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(frames), 1))
    for number, limb in enumerate(limbs):
        upper = x[:, limb.middle] - x[:, limb.top]
        lower = x[:, limb.end] - x[:, limb.middle]
        turns = (
            least_rotation(upper, upper + moved[:, number, 0]),
            least_rotation(lower, lower + moved[:, number, 1] - moved[:, number, 0]),
        )
        below, beyond = set(skeleton.subtree(limb.middle)), set(skeleton.subtree(limb.end))
        turn_of = {
            joint: still if joint in beyond else turns[1] if joint in below else turns[0]
            for joint in skeleton.subtree(limb.top)
        }
        for joint, turn in turn_of.items():
            parent = skeleton.parents.item(joint)
            above = turn_of.get(parent, still)
            if turn is not above and skeleton.children[joint]:
                base = Rotation.from_quat(above) * Rotation.from_quat(world[:, parent])
                local[:, joint] = (
                    base.inv() * Rotation.from_quat(turn) * Rotation.from_quat(world[:, joint])
                ).as_quat()
    rotations[frames] = local
    return Motion(skeleton, motion.root_positions, rotations, motion.frame_time_text, motion.moving)
