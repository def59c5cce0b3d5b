"""Alignment of two bodies by their rest poses: the rotation between each target joint and its source joints."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import FINGERS
from distretarget.body.body import Pose
from distretarget.matching.matching import BUILD_ANGLE, Matching
from distretarget.numerics.compiled import read_only
from distretarget.numerics.rotations import least_matrix
from distretarget.numerics.vectors import level

Array = NDArray[np.float64]

FINGER_BONES = tuple(f"{finger}{number}" for finger in FINGERS for number in (1, 2, 3))  # also aligned bone by bone
FIRST_BONES = ("UpperArm", "UpperLeg")  # roles of the bones with which limbs begin
LONG_BONES = (*FIRST_BONES, "LowerArm", "LowerLeg")  # roles whose bones are always aligned bone by bone
TRUNK = ("hips", "head")  # roles at the ends of the trunk


_FOUND: WeakKeyDictionary[Matching, Array] = WeakKeyDictionary()  # as long as the matching is in use


def rest_alignment(matching: Matching) -> Array:
    """Return A: (target joints, 2, 4), the rotation of each target joint relative to its two rotation sources: where a
    source joint has the world rotation R, the target joint gets R A.

    Arms, legs and fingers are aligned bone by bone, by the least rotation relative to the parent bone, which also gives
    the roll. Bones of trunk, palms and feet point differently in every build; these parts keep the alignment of the
    part above, starting with that of the whole body, axis by axis. Soles are aligned with soles.

    It is found once for each matching, and read-only.
    """
    if matching not in _FOUND:
        _FOUND[matching] = read_only(_found(_Bodies(matching)))
    return _FOUND[matching]


def _found(bodies: _Bodies) -> Array:
    """The alignment of two bodies, as in `rest_alignment`."""
    source_pose, target_pose = bodies.rotations
    back = source_pose[np.maximum(bodies.matching.rotation_sources, 0)].swapaxes(-1, -2)
    alignments = back @ (_joint_alignments(bodies) @ target_pose)[:, None]
    return Rotation.from_matrix(alignments.reshape(-1, 3, 3)).as_quat().reshape(-1, 2, 4)


@dataclass(frozen=True, eq=False)
class _Bodies:
    """Two matched bodies, in the poses in which they are aligned."""

    matching: Matching

    @cached_property
    def roles(self) -> Mapping[int, str]:
        """The roles of the target's joints; empty unless both bodies have an anatomy."""
        source, target = self.matching.source.anatomy, self.matching.target.anatomy
        return {joint: role for role, joint in target.roles.items()} if source and target else {}

    @cached_property
    def poses(self) -> tuple[Pose, Pose]:
        """The aligned poses of source and target."""
        source, target = self.matching.source, self.matching.target
        return (source.reference, target.reference) if self.matching.in_reference else (source.rest, target.rest)

    @cached_property
    def rotations(self) -> tuple[Array, Array]:
        """(joints, 3, 3) of source and target, the world rotations in these poses."""
        source, target = (np.asarray(Rotation.from_quat(pose.rotations).as_matrix()) for pose in self.poses)
        return source, target

    @cached_property
    def in_t_pose(self) -> bool:
        """Whether a T-pose replaces one of the rest poses."""
        return self.matching.in_reference and not (self.matching.source.stands and self.matching.target.stands)

    @cached_property
    def sole_normals(self) -> dict[int, tuple[Array, Array]]:
        """For each of the target's ankles, the sole normals of source and target, (3,), in these poses."""
        matching, (source_pose, target_pose) = self.matching, self.rotations
        if matching.legs is None or not self.roles:
            return {}
        return {
            b.ankle: (source_pose[a.ankle] @ source.normal, target_pose[b.ankle] @ target.normal)
            for a, b, (source, target) in zip(*matching.legs, matching.soles, strict=True)
        }

    @cached_property
    def trunk(self) -> set[int]:
        """The target's joints of trunk, shoulders, neck and head: all from which upper arms and thighs hang."""
        target = self.matching.target
        if not self.roles or target.anatomy is None:
            return set()
        line, roles = target.skeleton.line, target.anatomy.roles
        limbs = [line(joint)[1:] for role, joint in roles.items() if role.endswith(FIRST_BONES)]
        tops = [*target.anatomy.spine, *target.anatomy.neck, *(roles[role] for role in TRUNK if role in roles)]
        return set(itertools.chain(*limbs, *map(line, tops)))

    @cached_property
    def built_differently(self) -> set[int]:
        """The target's joints of trunk, palms and feet, whose bones point differently in every build."""
        return self.trunk | {
            joint for joint, role in self.roles.items() if not role.endswith((*LONG_BONES, *FINGER_BONES))
        }


def _joint_alignments(bodies: _Bodies) -> Array:
    """(target joints, 3, 3), the rotations that align each target joint with the source, both bodies in their poses.

    Upper arms turn by way of the direction straight out to the source's side, so that a target in A-pose is aligned
    like the same target in T-pose. Ankles start from the alignment of the whole body, not of the leg.
    """
    source_pose, target_pose = bodies.poses
    whole = source_pose.axes @ target_pose.axes.T if bodies.matching.in_reference else np.eye(3)
    left = source_pose.axes[:, 0]
    outwards = {"leftUpperArm": left, "rightUpperArm": -left}
    upper, *directions = bodies.matching.shared_bones(source_pose.positions, target_pose.positions)
    alignments: list[Array] = []
    parents = bodies.matching.target.skeleton.parents.tolist()
    edges = np.searchsorted(upper, range(len(parents) + 1)).tolist()
    for joint, parent in enumerate(parents):
        role = bodies.roles.get(joint, "")
        b, a = (each[edges[joint] : edges[joint + 1]] for each in directions)
        turn = whole if not joint or role.endswith("Foot") else alignments[parent]
        if joint in bodies.sole_normals:
            turn = _sole_onto_sole(bodies, joint, b[:1], a[:1], turn)
        if len(a):
            if role in outwards:
                turn = least_matrix(a[:1] @ turn.T, outwards[role][None]) @ turn
            onto = least_matrix(a @ turn.T, b)
            far = (np.trace(onto) - 1.0) / 2.0 < np.cos(BUILD_ANGLE)
            another_pose = len(a) == 1 and far and joint not in bodies.trunk and joint not in bodies.sole_normals
            if another_pose or joint not in bodies.built_differently:
                turn = onto @ turn
        alignments.append(turn)
    return np.array(alignments)


def _sole_onto_sole(bodies: _Bodies, joint: int, feet: Array, target_feet: Array, turn: Array) -> Array:
    """(3, 3), the alignment `turn` of an ankle, followed by the least rotation of the target's sole onto the source's.
    Where a T-pose replaces a rest pose, feet are also made to point the same way: `feet` and `target_feet`, (1, 3), are
    their directions on both bodies, (0, 3) without a foot.
    """
    normal, target_normal = bodies.sole_normals[joint]
    turn = least_matrix((turn @ target_normal)[None], normal[None]) @ turn
    if not len(feet) or not bodies.in_t_pose:
        return turn
    return least_matrix(level(target_feet @ turn.T, normal), level(feet, normal)) @ turn
