"""A motion as in a mirror, left and right exchanged."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.axes import AHEAD, axis_vector, nearest_axis, perpendicular
from distretarget.body.body import Body
from distretarget.errors import MotionError
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Numbers, lengths, normalised
from distretarget.skeleton import Skeleton

SAME = 1e-9  # bones whose directions differ by less are each other's picture


def mirrored(motion: Motion) -> Motion:
    """Return a motion as in an upright mirror through the origin: each joint moves as its partner on the other side.

    Partners are found by the anatomy, and all others by where they are in the rest pose. What has no partner keeps its
    rotations. On bodies whose sides differ, bones point where those of their partners do in the mirror. Mirrored twice,
    a motion is the same.

    Raises:
        MotionError: no human body is recognised, so that nothing shows what is left.
    """
    body, skeleton = Body.of_motion(motion), motion.skeleton
    if not len(motion):
        return motion
    roles = _roles(body, skeleton)
    left = _left(skeleton, roles)
    if left is None:
        raise MotionError("shows no human body, so that there is no left and right to exchange")
    in_rest, in_world = _reflection(left), _reflection(normalised(perpendicular(left, body.up_vector)))
    partners = find_partners(skeleton, roles, in_rest)
    before, local = _matrices(motion.world_rotations), _matrices(motion.rotations)
    world = np.zeros_like(before)
    for joint, partner in enumerate(partners.tolist()):
        parent = skeleton.parents[joint]
        if partner < 0:
            world[:, joint] = world[:, parent] @ local[:, joint]
        else:
            world[:, joint] = in_world @ before[:, partner] @ in_rest @ _to_partner(skeleton, joint, partners, in_rest)
            local[:, joint] = np.swapaxes(world[:, parent], 1, 2) @ world[:, joint] if joint else world[:, joint]
    rotations = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(motion.rotations.shape)
    translations = motion.translations
    moved = translations.copy()
    moved[:, 0] = translations[:, 0] @ in_world
    if motion.moving is not None:
        for joint, partner in enumerate(partners):
            if joint and partner >= 0:
                stretch = (translations[:, partner] - skeleton.offsets[partner]) @ in_rest
                moved[:, joint] = skeleton.offsets[joint] + stretch
    return Motion.of_translations(skeleton, moved, rotations, motion.frame_time_text)


def _matrices(rotations: Array) -> Array:
    """(frames, joints, 3, 3), rotations, (frames, joints, 4), as matrices."""
    return np.asarray(Rotation.from_quat(rotations.reshape(-1, 4)).as_matrix().reshape(*rotations.shape[:2], 3, 3))


def find_partners(skeleton: Skeleton, roles: Mapping[str, int], reflection: Array) -> Numbers:
    """Return the joint on the other side of each joint, itself in the middle, and -1 where there is none, (joints,).

    `roles` are the known joints, and `reflection`, (3, 3), exchanges the sides of the rest pose.
    """
    other = {joint: roles.get(_other_side(role)) for role, joint in roles.items()}
    rest, partners = skeleton.rest_positions, np.full(len(skeleton), -1)
    middles = np.array([rest[[*skeleton.subtree(joint)]].mean(axis=0) for joint in range(len(skeleton))])
    partners[0] = 0
    for joint in range(len(skeleton)):
        partner = partners[joint]
        if partner < joint:  # none, or found with its partner
            continue
        one, two = (list(skeleton.children[each]) for each in (joint, partner))
        if not one or not two:
            continue
        places = [middles[each] - rest[at] for each, at in ((one, joint), (two, partner))]
        off = lengths(places[0][:, None] @ reflection - places[1][None])
        for i, a in enumerate(one):
            for k, b in enumerate(two):
                if other.get(a, b) != b or other.get(b, a) != a:
                    off[i, k] = skeleton.longest_path * 1e3
        for own, others in zip(*linear_sum_assignment(off), strict=True):
            if off[own, others] < skeleton.longest_path:
                partners[one[own]], partners[two[others]] = two[others], one[own]
    return partners


def _roles(body: Body, skeleton: Skeleton) -> dict[str, int]:
    """The joints of a skeleton by the roles that they play in the body that it has."""
    numbers = {key: joint for joint, key in enumerate(skeleton.keys)}
    roles = body.anatomy.roles if body.anatomy else {}
    return {role: numbers[body.skeleton.keys[joint]] for role, joint in roles.items()}


def _other_side(role: str) -> str:
    """The role on the other side; the role itself in the middle."""
    for side, opposite in zip(SIDES, reversed(SIDES), strict=True):
        if role.startswith(side):
            return opposite + role.removeprefix(side)
    return role


def _left(skeleton: Skeleton, roles: Mapping[str, int]) -> Array | None:
    """(3,), the unit vector to the left of a body in its rest pose, by all that it has on both sides; None if that is
    nothing.
    """
    rest, across = skeleton.rest_positions, np.zeros(3)
    for role, joint in roles.items():
        if role.startswith(SIDES[0]) and _other_side(role) in roles:
            across += rest[joint] - rest[roles[_other_side(role)]]
    if not across.any():
        return None
    axis, cosine = nearest_axis(normalised(across))
    return axis_vector(axis) if cosine > AHEAD else normalised(across)


def _reflection(normal: Array) -> Array:
    """(3, 3), the reflection at the plane through the origin with a unit normal, (3,)."""
    return np.asarray(np.eye(3) - 2.0 * np.outer(normal, normal))


def _to_partner(skeleton: Skeleton, joint: int, partners: Numbers, reflection: Array) -> Array:
    """(3, 3), the rotation of a joint in the rest pose that brings its bones to where those of its partner are in the
    mirror.
    """
    below = [child for child in skeleton.children[joint] if partners[child] >= 0]
    own = normalised(skeleton.offsets[below])
    goal = normalised(skeleton.offsets[partners[below]]) @ reflection
    known = own.any(axis=1) & goal.any(axis=1)
    if not known.any() or np.abs(own - goal)[known].max() < SAME:
        return np.eye(3)
    return np.asarray(Rotation.align_vectors(goal[known], own[known])[0].as_matrix())
