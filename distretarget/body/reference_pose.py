"""Postures in which a body stands, to compare it with another.

A rest pose in which a person can stand (T, A, arms down) serves as it is. One that is none (all bones along one axis)
is replaced: for a body in motion by the frame in which it stands most like a rest pose, else by one put together.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES, Anatomy
from distretarget.body.axes import body_axes, is_pose, leftwards, leg_directions, squared, trunk, unit
from distretarget.body.legs import body_unit
from distretarget.motion import Motion
from distretarget.numerics.rotations import least
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

PITCH = np.radians(25)  # by which a foot of a T-pose put together points below the floor's plane
OPPOSITE = -0.9  # cosine below which a bone is turned right round about the axis from side to side
BENT_ARM = 0.25  # what a bone of an arm counts, against trunk and legs, in the choice of a frame
RAISED_FOOT = 5.0  # what the height of an ankle over its low ones counts [1 / body unit]
LOW = 20.0  # the percentile of an ankle's heights at which the foot is down
TWISTED = 5.0  # what shoulders count that are turned against the hips
LEANING = 0.8  # of trunk and legs, one less their cosines to up together, from which nobody stands
BENDING = 0.1  # the mean sine of a joint's bend from which its plane is known


def resting(skeleton: Skeleton) -> Array:
    """(joints, 4), the world rotations of the rest pose: none."""
    return np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), 1))


def standing(skeleton: Skeleton, anatomy: Anatomy, motion: Motion | None, up: Array) -> Array:
    """(joints, 4), world rotations in which the body stands: those of its rest pose where that is a pose; else those of
    the frame of its motion that is most like one: upright, legs straight, feet down, arms hanging or out to the sides;
    else, if it never stands or no motion is known, those of a T-pose put together. `up`, (3,), is the motion's.
    """
    if is_pose(skeleton, anatomy):
        return resting(skeleton)
    if motion is None or not len(motion):
        return stood(skeleton, anatomy)
    x = motion.positions
    lean = (1.0 - trunk(anatomy, x) @ up) + (1.0 + leg_directions(anatomy, x) @ up)
    if lean.min() > LEANING:
        return stood(skeleton, anatomy)
    unlike = lean + TWISTED * _twist(anatomy, x)
    for ankle in (anatomy.roles[role] for role in ("leftFoot", "rightFoot") if role in anatomy.roles):
        height = x[:, ankle] @ up
        unlike += RAISED_FOOT * np.abs(height - np.percentile(height, LOW)) / body_unit(skeleton)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        outwards = sign * body_axes(anatomy, x)[..., 0]
        for upper, lower in _bones(anatomy, side, ARM[1:]):
            bone = unit(x[:, lower] - x[:, upper])
            unlike += BENT_ARM * (1.0 - np.maximum((bone * outwards).sum(axis=-1), -(bone @ up)))
    return np.array(motion.world_rotations[np.argmin(unlike)])


def _twist(anatomy: Anatomy, x: Array) -> Array:
    """(frames,), one less the cosine between the lines across the hip joints and across the shoulders."""
    pairs = [[anatomy.roles.get(side + part, -1) for side in SIDES] for part in ("UpperLeg", "UpperArm")]
    if -1 in (*pairs[0], *pairs[1]):
        return np.zeros(len(x))
    hips, shoulders = (unit(x[:, a] - x[:, b]) for a, b in pairs)
    return np.asarray(1.0 - (hips * shoulders).sum(axis=-1))


def bend_axes(skeleton: Skeleton, anatomy: Anatomy, motion: Motion | None, world: Array) -> dict[str, Array]:
    """The axes, (3,) unit vectors, about which elbows and knees bend in a motion, where the body stands in the world
    rotations `world`, (joints, 4); by the roles of upper arms and thighs.

    None where the rest pose is a pose, which tells the roll; and without those that hardly bend.
    """
    axes: dict[str, Array] = {}
    if motion is None or not len(motion) or is_pose(skeleton, anatomy):
        return axes
    for side in SIDES:
        for limb in (ARM[1:], LEG[:3]):
            bones = list(_bones(anatomy, side, limb))
            if len(bones) == 2:
                joint = bones[0][0]
                upper, lower = (unit(motion.positions[:, b] - motion.positions[:, a]) for a, b in bones)
                turned = Rotation.from_quat(motion.world_rotations[:, joint]).inv()
                axis = turned.apply(np.cross(upper, lower)).mean(axis=0)
                if np.linalg.norm(axis) > BENDING:
                    axes[side + limb[0]] = np.asarray(Rotation.from_quat(world[joint]).apply(unit(axis)))
    return axes


def stood(skeleton: Skeleton, anatomy: Anatomy) -> Array:
    """(joints, 4), world rotations that put together a T-pose, Y up, facing Z: the hips by their own axes, the spine
    straight up from them.

    Each joint is turned from the one above by the least rotation, but where that is right round, about the axis from
    side to side, as knees bend.
    """
    goals = dict(_goals(anatomy))
    turns: list[Rotation] = []
    for joint in range(len(skeleton)):
        above = skeleton.parents[joint]
        turn = turns[above] if joint else Rotation.from_matrix(_hip_axes(skeleton, anatomy).T)
        if joint in goals:
            tip, goal = goals[joint]
            bone = unit(turn.apply(skeleton.rest_positions[tip] - skeleton.rest_positions[joint]))
            if bone @ goal < OPPOSITE:
                turn = Rotation.from_rotvec([np.pi, 0.0, 0.0]) * turn
                bone = bone * [1.0, -1.0, -1.0]
            turn = least(bone[None], goal[None]) * turn
        turns.append(turn)
    return np.array([turn.as_quat() for turn in turns])


def standing_positions(skeleton: Skeleton, world: Array) -> Array:
    """(joints, 3), where the joints are in given world rotations (joints, 4), the root at the origin."""
    x = np.zeros((len(skeleton), 3))
    for joint in range(1, len(skeleton)):
        parent = skeleton.parents[joint]
        x[joint] = x[parent] + Rotation.from_quat(world[parent]).apply(np.array(skeleton.offsets[joint]))
    return x


def _hip_axes(skeleton: Skeleton, anatomy: Anatomy) -> Array:
    """(3, 3), left, up and forward of the hips at rest: across the hip joints, and along the spine's first bone."""
    x = skeleton.rest_positions
    hips = [anatomy.roles.get(f"{side}UpperLeg") for side in SIDES]
    left = leftwards(anatomy, x) if None in hips else unit(x[hips[0]] - x[hips[1]])
    bones = [unit(x[joint] - x[anatomy.roles["hips"]]) for joint in _upright(anatomy)]
    up = next((bone for bone in bones if bone.any()), trunk(anatomy, x))
    up = unit(up - (up @ left) * left)
    return squared(np.stack([left, up, np.cross(left, up)], axis=-1))


def _upright(anatomy: Anatomy) -> list[int]:
    """The joints above the hips, up to the head."""
    head = [anatomy.roles["head"]] if "head" in anatomy.roles else []
    return [*anatomy.spine, *anatomy.neck, *head]


def _goals(anatomy: Anatomy) -> Iterator[tuple[int, tuple[int, Array]]]:
    """For joints of a T-pose the joint at the end of their bone, and where the bone points."""
    for lower, upper in pairwise(_upright(anatomy)):
        yield lower, (upper, np.array([0.0, 1.0, 0.0]))
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for upper, lower in _bones(anatomy, side, ARM):
            yield upper, (lower, np.array([sign, 0.0, 0.0]))
        for upper, lower in _bones(anatomy, side, LEG[:3]):
            yield upper, (lower, np.array([0.0, -1.0, 0.0]))
        for upper, lower in _bones(anatomy, side, LEG[2:]):
            yield upper, (lower, np.array([0.0, -np.sin(PITCH), np.cos(PITCH)]))


def _bones(anatomy: Anatomy, side: str, limb: tuple[str, ...]) -> Iterator[tuple[int, int]]:
    """The joints at both ends of each bone of a limb that has them."""
    return pairwise(anatomy.roles[side + role] for role in limb if side + role in anatomy.roles)
