"""Alignment of the rest poses of two bodies: the rotation from each source joint to its target joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import FINGERS, SIDES
from distretarget.body.body import Pose
from distretarget.matching.matching import BUILD_ANGLE, Matching
from distretarget.numerics.rotations import least_matrix
from distretarget.numerics.vectors import cross, level

Array = NDArray[np.float64]

FINGER_BONES = tuple(f"{finger}{number}" for finger in FINGERS for number in (1, 2, 3))  # aligned bone by bone too
LONG_BONES = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")  # roles whose bones are always aligned bone by bone
SHORT_BONES = ("hips", "head", "Shoulder", "Foot", "Toes")  # roles whose bones point differently in every build


def rest_alignment(matching: Matching) -> Array:
    """Return A, (target joints, 2, 4): the target joint's world rotation is R A where R is the world rotation of one of
    its two rotation sources (`Matching.rotation_sources`).

    The root is aligned like the bodies as a whole, by their axes. Arms, legs and fingers are aligned bone by bone, by
    the least rotation from the alignment of the part above, from which they take their roll. Trunk, palms and feet keep
    the alignment of the part above, as their bones point differently in every build; soles are aligned with soles.
    Where a frame of the motion replaces a rest pose, the bend axes of elbows and knees give the roll.
    """
    bodies = _Bodies(matching)
    source_pose, target_pose = bodies.rotations
    back = source_pose[np.maximum(matching.rotation_sources, 0)].swapaxes(-1, -2)
    alignments = back @ (_joint_alignments(bodies) @ target_pose)[:, None]
    return Rotation.from_matrix(alignments.reshape(-1, 3, 3)).as_quat().reshape(-1, 2, 4)


@dataclass(frozen=True, eq=False)
class _Bodies:
    """What the alignment needs of two matched bodies."""

    matching: Matching

    @cached_property
    def roles(self) -> Mapping[str, int]:
        """The target's joint of each role; empty unless both bodies have an anatomy."""
        source, target = self.matching.source.anatomy, self.matching.target.anatomy
        return target.roles if source and target else {}

    @cached_property
    def in_reference(self) -> bool:
        """Whether the bodies are aligned in their reference poses, not in their rest poses."""
        return bool(self.roles) and not self.matching.rest_poses_alike

    @cached_property
    def poses(self) -> tuple[Pose, Pose]:
        """The aligned poses of source and target."""
        source, target = self.matching.source, self.matching.target
        return (source.reference, target.reference) if self.in_reference else (source.rest, target.rest)

    @cached_property
    def rotations(self) -> tuple[Array, Array]:
        """(joints, 3, 3) of source and target, the world rotations of these poses."""
        source, target = (np.asarray(Rotation.from_quat(pose.rotations).as_matrix()) for pose in self.poses)
        return source, target

    @cached_property
    def bend_axes(self) -> tuple[Mapping[str, Array], Mapping[str, Array]]:
        """The axes, (3,) by role, about which the limbs of source and target bend in these poses."""
        return (self.matching.source.bend_axes, self.matching.target.bend_axes) if self.in_reference else ({}, {})

    @cached_property
    def turn(self) -> Array:
        """(3, 3), the rotation from the target's axes to the source's."""
        source, target = self.poses
        return np.asarray(source.axes @ target.axes.T) if self.in_reference else np.eye(3)

    @cached_property
    def outwards(self) -> dict[int, Array]:
        """For the target's upper arms, the direction (3,) straight out to the source's side. They turn by way of it, so
        that a target in A-pose is aligned like the same target in T-pose.
        """
        left = self.poses[0].axes[:, 0]
        goals = zip((f"{side}UpperArm" for side in SIDES), (left, -left), strict=True)
        return {self.roles[role]: goal for role, goal in goals if role in self.roles}

    @cached_property
    def hinges(self) -> dict[int, tuple[str, Array]]:
        """For the target's upper arms and thighs, their role and the usual bend axis of elbow or knee, (3,): that of a
        body that stands like the source with arms out, whose forearms bend forwards and shins backwards.
        """
        left, up, _ = self.poses[0].axes.T
        usual = {"leftUpperArm": -up, "rightUpperArm": up, "leftUpperLeg": left, "rightUpperLeg": left}
        return {self.roles[role]: (role, axis) for role, axis in usual.items() if role in self.roles}

    @cached_property
    def ankles(self) -> set[int]:
        """The target's ankles: they are aligned like the body as a whole and sole onto sole, not like the leg."""
        return {joint for role, joint in self.roles.items() if role.endswith("Foot")}

    @cached_property
    def sole_normals(self) -> dict[int, tuple[Array, Array]]:
        """For the target's ankles, the normals of the soles of source and target in these poses, (3,) each."""
        matching, (source_pose, target_pose) = self.matching, self.rotations
        if matching.legs is None or not self.roles:
            return {}
        return {
            b.ankle: (source_pose[a.ankle] @ source.normal, target_pose[b.ankle] @ target.normal)
            for a, b, (source, target) in zip(*matching.legs, matching.soles, strict=True)
        }

    @cached_property
    def built_differently(self) -> set[int]:
        """The target's joints of trunk, shoulders, palms and feet, whose bones point differently in every build.

        Spine and hands are left out where the pose of a body is a frame of its motion, in which they may be bent.
        """
        target = self.matching.target
        if not self.roles or target.anatomy is None:
            return set()
        joints = {joint for role, joint in self.roles.items() if role.endswith(SHORT_BONES)}
        joints |= {*target.skeleton.line(self.roles.get("hips", 0))}
        if not self.posed_by_motion:
            joints |= {joint for role, joint in self.roles.items() if not role.endswith((*LONG_BONES, *FINGER_BONES))}
            joints |= {*target.anatomy.spine, *target.anatomy.neck}
        return joints

    @property
    def posed_by_motion(self) -> bool:
        """Whether the pose of one of the bodies may be a frame of its motion instead of its rest pose."""
        source, target = self.matching.source, self.matching.target
        posed = not source.stands_at_rest or not (target.motion is None or target.stands_at_rest)
        return self.in_reference and posed


def _joint_alignments(bodies: _Bodies) -> Array:
    """(target joints, 3, 3), the rotations that align each target joint with the source, both bodies in their poses."""
    matching, (source_pose, target_pose) = bodies.matching, bodies.poses
    upper, *directions = matching.shared_bones(source_pose.positions, target_pose.positions)
    alignments: list[Array] = []
    parents = matching.target.skeleton.parents.tolist()
    edges = np.searchsorted(upper, range(len(parents) + 1)).tolist()
    for joint, parent in enumerate(parents):
        b, a = (each[edges[joint] : edges[joint + 1]] for each in directions)
        turn = bodies.turn if not joint or joint in bodies.ankles else alignments[parent]
        if joint in bodies.sole_normals:
            turn = _sole_onto_sole(bodies, joint, b[:1], a[:1], turn)
        if len(a):
            if joint in bodies.outwards:
                turn = least_matrix(a[:1] @ turn.T, bodies.outwards[joint][None]) @ turn
            onto = least_matrix(a @ turn.T, b)
            far = (np.trace(onto) - 1.0) / 2.0 < np.cos(BUILD_ANGLE)
            another_pose = len(a) == 1 and far and joint not in bodies.sole_normals
            if another_pose or joint not in bodies.built_differently:
                if joint in bodies.hinges:
                    onto = _roll(bodies, joint, b[0], onto, turn) @ onto
                turn = onto @ turn
        alignments.append(turn)
    return np.array(alignments)


def _sole_onto_sole(bodies: _Bodies, joint: int, feet: Array, target_feet: Array, turn: Array) -> Array:
    """(3, 3), the alignment of an ankle: `turn`, that of the body as a whole, then the target's sole onto the source's.

    Where the pose of a body may be a frame of its motion, in which feet may be turned, the feet are aligned too:
    `feet` and `target_feet`, (1, 3), are their directions on both bodies, (0, 3) without a foot.
    """
    normal, target_normal = bodies.sole_normals[joint]
    turn = least_matrix((turn @ target_normal)[None], normal[None]) @ turn
    if not len(feet) or not bodies.posed_by_motion:
        return turn
    return least_matrix(level(target_feet @ turn.T, normal), level(feet, normal)) @ turn


def _roll(bodies: _Bodies, joint: int, bone: Array, onto: Array, turn: Array) -> Array:
    """(3, 3), the turn about a bone, (3,), from the target's bend axis, turned by `onto @ turn`, to the source's."""
    role, usual = bodies.hinges[joint]
    source_bends, target_bends = bodies.bend_axes
    source_axis = source_bends.get(role, onto @ usual)
    target_axis = onto @ turn @ target_bends[role] if role in target_bends else onto @ usual
    across, goal = level(target_axis, bone), level(source_axis, bone)
    angle = np.arctan2(cross(across, goal) @ bone, across @ goal)
    return Rotation.from_rotvec(angle * bone).as_matrix()
