"""Postures in which a body stands, to compare it with another.

A rest pose in which a person can stand (T, A, arms down) is its own reference. Some rest poses are not (all bones along
one axis); a frame of the body's motion in which it stands replaces them, or else a synthetic T-pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES, Anatomy
from distretarget.body.axes import Directions, squared
from distretarget.motion import Motion
from distretarget.numerics.rotations import least, normalised
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

STANDS = 100.0  # angle between trunk and legs of a rest pose in which a person can stand, at least [degrees]
RAISED = np.cos(np.radians(30))  # and its arms point farther than this from the direction of the trunk [cosine]
PITCH = np.radians(25)  # by which the foot of a synthetic T-pose points below the floor's plane [rad]
OPPOSITE = -0.9  # cosine below which a bone is turned half round about the axis from side to side
BENT_ARM = 0.25  # weight of each arm bone in the choice of a frame; trunk and legs have 1
RAISED_FOOT = 5.0  # weight of an ankle's height over its low heights in that choice [1 / body unit]
LOW_ANKLE = 20.0  # percentile of an ankle's heights at which the foot is down
TWISTED = 5.0  # weight of shoulders turned against the hips in that choice
LEANING = 0.8  # sum over trunk and legs of 1 - cosine to the vertical, above which nobody stands
BENDING = 0.1  # mean sine of a joint's bend, from which its plane is known


def stands_at_rest(rest: Directions) -> bool:
    """Whether a person can stand in the rest pose: legs down, trunk up, arms not along it."""
    stands = not rest.is_whole or rest.stretch > STANDS
    arms = [rest.bone(f"{side}UpperArm", f"{side}Hand") for side in SIDES]
    return bool(stands and all(arm @ rest.trunk < RAISED for arm in arms if arm is not None))


def standing_frame(moving: Directions, up: Array, unit: float) -> int | None:
    """The frame of a motion in which the body stands most like a rest pose: upright, legs straight, feet down, arms
    hanging or out to the sides; None where it never stands.

    `up`, (3,), points up; `unit` is the body unit [file units].
    """
    anatomy, x = moving.anatomy, moving.positions
    lean = (1.0 - moving.trunk @ up) + (1.0 + moving.legs @ up)
    if lean.min() > LEANING:
        return None
    unlike = lean + TWISTED * _twist(moving)
    for ankle in (anatomy.roles[role] for role in ("leftFoot", "rightFoot") if role in anatomy.roles):
        height = x[:, ankle] @ up
        unlike += RAISED_FOOT * np.abs(height - np.percentile(height, LOW_ANKLE)) / unit
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        outwards = sign * moving.axes[..., 0]
        for upper, lower in _bones(anatomy, side, ARM[1:]):
            bone = normalised(x[:, lower] - x[:, upper])
            unlike += BENT_ARM * (1.0 - np.maximum((bone * outwards).sum(axis=-1), -(bone @ up)))
    return int(np.argmin(unlike))


def _twist(moving: Directions) -> Array:
    """(frames,), one less the cosine between the lines across the hip joints and across the shoulders."""
    roles, x = moving.anatomy.roles, moving.positions
    pairs = [[roles.get(side + part, -1) for side in SIDES] for part in ("UpperLeg", "UpperArm")]
    if -1 in (*pairs[0], *pairs[1]):
        return np.zeros(len(x))
    hips, shoulders = (normalised(x[:, a] - x[:, b]) for a, b in pairs)
    return np.asarray(1.0 - (hips * shoulders).sum(axis=-1))


def bend_axes(anatomy: Anatomy, motion: Motion, world: Array) -> dict[str, Array]:
    """The axes about which elbows and knees bend in a motion, (3,) unit vectors by the roles of upper arms and thighs.

    They are given for a body that stands in the world rotations `world`, (joints, 4). Limbs that hardly bend have none.
    """
    axes: dict[str, Array] = {}
    for side in SIDES:
        for limb in (ARM[1:], LEG[:3]):
            bones = list(_bones(anatomy, side, limb))
            if len(bones) == 2:
                joint = bones[0][0]
                upper, lower = (normalised(motion.positions[:, b] - motion.positions[:, a]) for a, b in bones)
                turned = Rotation.from_quat(motion.world_rotations[:, joint]).inv()
                axis = turned.apply(np.cross(upper, lower)).mean(axis=0)
                if np.linalg.norm(axis) > BENDING:
                    axes[side + limb[0]] = np.asarray(Rotation.from_quat(world[joint]).apply(normalised(axis)))
    return axes


def synthetic_t_pose(skeleton: Skeleton, rest: Directions) -> Array:
    """(joints, 4), world rotations of a T-pose, Y up, facing Z: the hips by their own axes, the spine straight above.

    Each joint turns against the one above by the least rotation; where that is nearly half a turn, it turns about the
    axis from side to side, as knees bend.
    """
    goals = dict(_goals(rest.anatomy))
    x = skeleton.rest_positions
    turns: list[Rotation] = []
    for joint in range(len(skeleton)):
        turn = turns[skeleton.parents[joint]] if joint else Rotation.from_matrix(_hip_axes(rest).T)
        if joint in goals:
            tip, goal = goals[joint]
            bone = normalised(turn.apply(x[tip] - x[joint]))
            if bone @ goal < OPPOSITE:
                turn = Rotation.from_rotvec([np.pi, 0.0, 0.0]) * turn
                bone = bone * [1.0, -1.0, -1.0]
            turn = least(bone[None], goal[None]) * turn
        turns.append(turn)
    return np.array([turn.as_quat() for turn in turns])


def _hip_axes(rest: Directions) -> Array:
    """(3, 3), left, up and forward of the hips at rest: across the hip joints, and along the spine's first bone."""
    x, roles = rest.positions, rest.anatomy.roles
    hips = [roles.get(f"{side}UpperLeg") for side in SIDES]
    left = rest.left if None in hips else normalised(x[hips[0]] - x[hips[1]])
    bones = [normalised(x[joint] - x[roles["hips"]]) for joint in _spine_to_head(rest.anatomy)]
    up = next((bone for bone in bones if bone.any()), rest.trunk)
    up = normalised(up - (up @ left) * left)
    return squared(np.stack([left, up, np.cross(left, up)], axis=-1))


def _spine_to_head(anatomy: Anatomy) -> list[int]:
    """The joints above the hips, up to the head."""
    head = [anatomy.roles["head"]] if "head" in anatomy.roles else []
    return [*anatomy.spine, *anatomy.neck, *head]


def _goals(anatomy: Anatomy) -> Iterator[tuple[int, tuple[int, Array]]]:
    """For joints of a T-pose the joint at the end of their bone, and where the bone points."""
    for lower, upper in pairwise(_spine_to_head(anatomy)):
        yield lower, (upper, np.array([0.0, 1.0, 0.0]))
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for upper, lower in _bones(anatomy, side, ARM):
            yield upper, (lower, np.array([sign, 0.0, 0.0]))
        for upper, lower in _bones(anatomy, side, LEG[:3]):
            yield upper, (lower, np.array([0.0, -1.0, 0.0]))
        for upper, lower in _bones(anatomy, side, LEG[2:]):
            yield upper, (lower, np.array([0.0, -np.sin(PITCH), np.cos(PITCH)]))


def _bones(anatomy: Anatomy, side: str, limb: tuple[str, ...]) -> Iterator[tuple[int, int]]:
    """The joints at both ends of each bone of a limb that the body has."""
    return pairwise(anatomy.roles[side + role] for role in limb if side + role in anatomy.roles)
