"""Limbs, given by top, middle and end joint, and how they bend for displacements of middle and end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.quaternions import least_rotation, multiply
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Numbers, lengths
from distretarget.skeleton import Skeleton

WRIST = np.radians(45.0)  # a wrist bends by this at most to keep the hand's world rotation [rad]
LEAST = 1e-9  # the smallest length or angle that is divided by [any unit, rad]
STRETCHED = 1e-3  # a reaching limb stays shorter than its stretched length by this share
FOLDED = np.radians(30.0)  # a reaching limb folds up to this angle between its bones, unless it was folded more [rad]
FAR = np.radians(90.0)  # the pole vector of a straight limb acts fully if the limb turns by this or more [rad]
UNTURNED, INVERSE = np.array([[0.0, 0.0, 0.0, 1.0], [-1.0, -1.0, -1.0, 1.0]])


@dataclass(frozen=True)
class Limb:
    """An arm or a leg."""

    top: int  # shoulder or hip joint
    middle: int  # elbow or knee
    end: int  # wrist or ankle
    is_arm: bool

    @property
    def joints(self) -> tuple[int, int, int]:
        """Top, middle and end."""
        return self.top, self.middle, self.end


def shares_of(
    limbs: Sequence[Limb], skeleton: Skeleton, places: Array, joints: Numbers, points: Array
) -> tuple[Numbers, Array]:
    """Return the index of the limb that each point belongs to, (points,), -1 for none, and the shares of the
    displacements of middle and end by which it moves, (points, 2). `joints`, (points,), carry the points, (points, 3);
    `places`, (joints, 3), are the positions of all joints.
    """
    numbers, shares = np.full(len(joints), -1), np.zeros((len(joints), 2))
    for number, limb in enumerate(limbs):
        on = np.isin(joints, skeleton.subtree(limb.top))
        top, middle, end = places[[*limb.joints]]
        upper, lower = _along(top, middle, points[on]), _along(middle, end, points[on])
        is_lower = np.isin(joints[on], skeleton.subtree(limb.middle))
        numbers[on] = number
        shares[on] = np.where(is_lower, [1.0 - lower, lower], [upper, 0.0 * upper]).T
    return numbers, shares


def _along(a: Array, b: Array, points: Array) -> Array:
    """(points,), the fraction at which points, (points, 3), project onto the line from a to b, 0 to 1."""
    square = float((b - a) @ (b - a))
    return np.clip((points - a) @ (b - a) / square, 0.0, 1.0) if square else np.ones(len(points))


def bent(motion: Motion, limbs: Sequence[Limb], displacements: Array) -> Motion:
    """Return the motion with the middle and the end of each limb displaced, (frames, limbs, 2, 3) [file units].

    The upper and the lower part of a limb turn by the least rotations. Hands and feet keep their world rotations; but a
    hand takes the part of its forearm's rotation that exceeds about `WRIST`.
    """
    frames = np.flatnonzero(displacements.any(axis=(1, 2, 3)))
    if not len(frames):
        return motion
    skeleton, some = motion.skeleton, motion[frames]
    world, places, moved = some.world_rotations, some.positions, displacements[frames]
    local = some.rotations.copy()
    turns = np.empty((4, len(frames), 4))  # of the upper part, the lower part, hand or foot, and the rest of the body
    turns[3] = UNTURNED
    for number in np.flatnonzero(moved.any(axis=(0, 2, 3))).tolist():
        limb = limbs[number]
        top, middle, end = (places[:, joint] for joint in limb.joints)
        upper, lower = middle - top, end - middle
        turns[0] = least_rotation(upper, upper + moved[:, number, 0])
        turns[1] = least_rotation(lower, lower + moved[:, number, 1] - moved[:, number, 0])
        turns[2] = _excess(turns[1]) if limb.is_arm else UNTURNED
        of_joint = np.full(len(skeleton), 3)
        for part, joint in enumerate(limb.joints):
            of_joint[skeleton.subtree(joint)] = part
        edges = np.flatnonzero((of_joint != of_joint[skeleton.parents]) & ~skeleton.end_sites)
        for joint in edges[edges > 0]:  # with the turns P and Q of parent and joint, the parent's W: W^-1 P^-1 Q W
            parent = skeleton.parents[joint]
            w, p, q = world[:, parent], turns[of_joint[parent]], turns[of_joint[joint]]
            for x, y, z, r in (each.T for each in (w, q, INVERSE * p, INVERSE * w)):
                multiply(x, y, z, r, local[:, joint].T.copy(), local[:, joint].T)
    rotations = motion.rotations.copy()
    rotations[frames] = local
    return Motion(skeleton, motion.root_positions, rotations, motion.frame_time_text, motion.moving)


def reaching(motion: Motion, limb: Limb, by: Array, poles: Array, firmness: Array | float = 0.0) -> Array:
    """Return the displacements of middle and end of a limb, (frames, 2, 3), that move its end by vectors, (frames, 3),
    as far as it reaches [file units].

    The limb turns about its top by the least rotation, and then bends in its plane. A limb that turns far and is nearly
    straight hardly has a plane; then its middle points along its pole vector, of `poles`, unit vectors (frames, 3), or
    zeros for none. With the weight `firmness`, (frames,), 0 to 1, its middle points there in any case.
    """
    top, middle, end = (motion.positions[:, joint] for joint in limb.joints)
    upper, lower = (motion.skeleton.lengths[joint] for joint in (limb.middle, limb.end))
    now, goal = end - top, end + by - top
    far, most = lengths(goal), np.maximum((1.0 - STRETCHED) * (upper + lower), lengths(now))
    least = np.minimum(np.sqrt(upper**2 + lower**2 - 2.0 * upper * lower * np.cos(FOLDED)), lengths(now))
    goal = (np.clip(far, least, most) / np.maximum(far, LEAST))[:, None] * goal
    far = np.maximum(lengths(goal), LEAST)[:, None]
    turn = Rotation.from_quat(least_rotation(now, goal))
    to_pole = smoothstep(turn.magnitude() / FAR)[:, None]
    along = (upper**2 - lower**2 + far**2) / (2.0 * far)
    own = across(turn.apply(middle - top), goal) / upper
    firmly = np.asarray(firmness)[..., None]
    to_pole = firmly + (1.0 - firmly) * to_pole * (1.0 - lengths(own)[:, None])
    aside = (1.0 - firmly) * own + to_pole * across(poles, goal)
    aside *= np.sqrt(np.maximum(upper**2 - along**2, 0.0)) / np.maximum(lengths(aside)[:, None], LEAST)
    moved = np.stack([top + along / far * goal + aside - middle, top + goal - end], axis=1)
    return np.where((by != 0.0).any(axis=1)[:, None, None], moved, 0.0)


def across(vectors: Array, axes: Array) -> Array:
    """Return the components of vectors perpendicular to axes, (frames, 3) each."""
    square = np.maximum((axes**2).sum(axis=1, keepdims=True), LEAST**2)
    return np.asarray(vectors - (vectors * axes).sum(axis=1, keepdims=True) / square * axes)


def _excess(turns: Array) -> Array:
    """(frames, 4), rotations less the angles that a wrist takes: nearly all of small angles, and at most `WRIST`."""
    vectors = Rotation.from_quat(turns).as_rotvec()
    angles = lengths(vectors)[:, None]
    return Rotation.from_rotvec(vectors * (1.0 - np.tanh(angles / WRIST) * WRIST / np.maximum(angles, LEAST))).as_quat()
