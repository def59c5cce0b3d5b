"""The reference pose of a body: a standing pose in which it can be aligned with another body.

A rest pose in which a person can stand (T-pose, A-pose, arms down) is the reference pose. Any other, such as one with
all bones along one axis, is replaced by a frame of the motion in which the body stands, or else by a synthetic T-pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES, Anatomy
from distretarget.body.axes import PARALLEL, Directions, axes_of, direction, squared
from distretarget.motion import Motion
from distretarget.numerics.rotations import least
from distretarget.numerics.vectors import cross, lengths, normalised
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

STANDING_ANGLE = 100.0  # a person can stand with a larger angle than this between trunk and legs [degrees] ...
RAISED_ARM = np.cos(np.radians(30))  # ... if both arms are at least this angle away from straight up [cosine]
FOOT_PITCH = np.radians(25)  # usual angle by which feet point downwards, as in the synthetic T-pose [rad]
OPPOSITE = -0.9  # a bone with a smaller cosine to its goal first turns half round about the sideways axis [cosine]

# Weights in the choice of the frame in which the body stands best; the leaning of trunk and legs has weight 1.
ARM_WEIGHT = 0.25  # of each arm bone's deviation from hanging or pointing sideways
FOOT_WEIGHT = 5.0  # of an ankle's distance from its standing height [1 / body unit]
LOW_ANKLE = 20.0  # percentile of an ankle's heights that is its standing height [%]
TWIST_WEIGHT = 5.0  # of the twist between shoulders and hips
LEANING = 0.8  # in a frame in which a body stands, trunk and legs lean by less than this [sum of 1 - cosine]

CLEAR_BEND = 0.1  # a limb whose mean bend is larger than this shows its bend axis [sine]


def stands_at_rest(rest: Directions) -> bool:
    """Return whether a person can stand in the rest pose: legs down, trunk up, arms not raised along the trunk."""
    stands = not rest.is_whole or rest.stretch > STANDING_ANGLE
    arms = [rest.bone(f"{side}UpperArm", f"{side}Hand") for side in SIDES]
    return bool(stands and all(arm @ rest.trunk < RAISED_ARM for arm in arms if arm is not None))


def standing_frame(moving: Directions, up: Array, unit: float) -> int | None:
    """Return the frame of a motion in which the body stands best: upright, legs straight, feet down, arms hanging or
    out to the sides; None where it never stands. `up`, (3,), is the unit vector up; `unit` the body unit [file units].
    """
    anatomy, x = moving.anatomy, moving.positions
    lean = (1.0 - moving.trunk @ up) + (1.0 + moving.legs @ up)
    if lean.min() > LEANING:
        return None
    unlike = lean + TWIST_WEIGHT * _twist(moving)
    for ankle in (anatomy.roles[role] for role in ("leftFoot", "rightFoot") if role in anatomy.roles):
        height = x[:, ankle] @ up
        unlike += FOOT_WEIGHT * np.abs(height - np.percentile(height, LOW_ANKLE)) / unit
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        outwards = sign * moving.axes[..., 0]
        for ends in _bones(anatomy, side, ARM[1:]):
            bone = direction(x, *ends)
            unlike += ARM_WEIGHT * (1.0 - np.maximum((bone * outwards).sum(axis=-1), -(bone @ up)))
    return int(np.argmin(unlike))


def _twist(moving: Directions) -> Array:
    """(frames,), the twist of the trunk: 1 - cosine between the lines across the hip joints and the shoulders."""
    hips, shoulders = moving.across("UpperLeg"), moving.across("UpperArm")
    if hips is None or shoulders is None:
        return np.zeros(len(moving.positions))
    return np.asarray(1.0 - (normalised(hips) * normalised(shoulders)).sum(axis=-1))


def bend_axes(anatomy: Anatomy, motion: Motion, world: Array) -> dict[str, Array]:
    """Return the axes about which elbows and knees bend in a motion, by the roles of upper arms and thighs: unit
    vectors (3,) in the pose of the world rotations `world`, (joints, 4). Limbs that hardly bend have none.

    An axis is the mean over the frames in the joint's own coordinates. Like a pole vector it gives a limb its roll.
    """
    axes: dict[str, Array] = {}
    turned = motion.world_rotations
    for side in SIDES:
        for limb in (ARM[1:], LEG[:3]):
            bones = list(_bones(anatomy, side, limb))
            if len(bones) == 2:
                joint = bones[0][0]
                across = cross(*(direction(motion.positions, *ends) for ends in bones))
                axis = Rotation.from_quat(turned[:, joint]).inv().apply(across).mean(axis=0)
                if np.linalg.norm(axis) > CLEAR_BEND:
                    axes[side + limb[0]] = np.asarray(Rotation.from_quat(world[joint]).apply(normalised(axis)))
    return axes


def synthetic_t_pose(skeleton: Skeleton, rest: Directions) -> Array:
    """Return the world rotations, (joints, 4), of a T-pose with Y up that faces Z, for a rest pose.

    The hips turn by their own axes, every other joint relative to its parent by the least rotation. Where that is
    nearly half a turn, it is about the sideways axis, as knees turn.
    """
    goals = dict(_goals(rest.anatomy))
    turns: list[Rotation] = []
    for joint in range(len(skeleton)):
        turn = turns[skeleton.parents[joint]] if joint else Rotation.from_matrix(_hip_axes(rest).T)
        if joint in goals:
            tip, goal = goals[joint]
            bone = normalised(turn.apply(rest.positions[tip] - rest.positions[joint]))
            if bone @ goal < OPPOSITE:
                turn = Rotation.from_rotvec([np.pi, 0.0, 0.0]) * turn
                bone = bone * [1.0, -1.0, -1.0]
            turn = least(bone[None], goal[None]) * turn
        turns.append(turn)
    return np.array([turn.as_quat() for turn in turns])


def _hip_axes(rest: Directions) -> Array:
    """(3, 3), the axes of the hips at rest: up along the spine's first bone, left across the hip joints, or across the
    shoulders if the hip joints lie along the spine.
    """
    bones = [direction(rest.positions, rest.anatomy.roles["hips"], joint) for joint in _spine_to_head(rest.anatomy)]
    up = next((bone for bone in bones if bone.any()), rest.trunk)
    lefts = [normalised(width) for width in map(rest.across, ("UpperLeg", "UpperArm")) if width is not None]
    left = next((left for left in lefts if lengths(cross(left, up)) > PARALLEL), rest.left)
    return squared(axes_of(left, up))


def _spine_to_head(anatomy: Anatomy) -> list[int]:
    """The joints above the hips, up to the head."""
    return [*anatomy.spine, *anatomy.neck, *(anatomy.roles[role] for role in ("head",) if role in anatomy.roles)]


def _goals(anatomy: Anatomy) -> Iterator[tuple[int, tuple[int, Array]]]:
    """Joints, each with the joint at the end of its bone and the direction of that bone in a T-pose, (3,)."""
    left, up, _ = np.eye(3)
    foot = np.array([0.0, -np.sin(FOOT_PITCH), np.cos(FOOT_PITCH)])
    for lower, upper in pairwise(_spine_to_head(anatomy)):
        yield lower, (upper, up)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for limb, goal in ((ARM, sign * left), (LEG[:3], -up), (LEG[2:], foot)):
            for upper, lower in _bones(anatomy, side, limb):
                yield upper, (lower, goal)


def _bones(anatomy: Anatomy, side: str, limb: tuple[str, ...]) -> Iterator[tuple[int, int]]:
    """The joints at the upper and lower end of each bone of a limb; parts that the body lacks are skipped."""
    return pairwise(anatomy.roles[side + role] for role in limb if side + role in anatomy.roles)
