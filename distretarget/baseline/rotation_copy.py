"""The rotation copy: the source's rotations on the target's bones, with a scaled root path; solving starts from it.

Bodies are aligned by their rest poses, which gives the rotation between each target joint and its source joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import FINGERS
from distretarget.body.body import Body
from distretarget.body.resting import feet_at_rest
from distretarget.matching.matching import BUILD_ANGLE, Matching, cached_by_soles
from distretarget.motion import Motion, motion_of_world
from distretarget.numerics.quaternions import rotation_products
from distretarget.numerics.rotations import least_matrix
from distretarget.numerics.vectors import Array, Numbers, lengths, level, read_only

FIRST_BONES = ("UpperArm", "UpperLeg")  # roles of the bones with which limbs begin
FINGER_BONES = tuple(f"{finger}{number}" for finger in FINGERS for number in (1, 2, 3))
BY_BONE = (*FIRST_BONES, "LowerArm", "LowerLeg", *FINGER_BONES)  # roles that are always aligned bone by bone
SINK = 0.1  # hips may be this much lower in a stride than in the source [leg lengths]
MOST_FRAMES = 95.0  # share of the frames with resting feet in which strides must be within reach [%]


@cached_by_soles
def rest_alignment(matching: Matching) -> Array:
    """Return A: (target joints, 2, 4), the rotation of each target joint relative to its two rotation sources: where a
    source joint has the world rotation R, the target joint gets R A. It is read-only.

    Arms, legs and fingers are aligned bone by bone, by the least rotation relative to the parent bone, which also gives
    the roll. Bones of trunk, palms and feet differ in direction from build to build, so these parts keep the alignment
    of the part above, and the root that of the whole body's axes. Soles are aligned with soles.
    """
    source, target = (np.asarray(Rotation.from_quat(pose.rotations).as_matrix()) for pose in matching.poses)
    back = source[np.maximum(matching.rotation_sources, 0)].swapaxes(-1, -2)
    turns = _joint_alignments(matching, _sole_normals(matching, source, target))
    alignments = back @ (turns @ target)[:, None]
    quaternions = Rotation.from_matrix(alignments.reshape(-1, 3, 3)).as_quat()
    return read_only(quaternions.reshape(-1, 2, 4))


def _roles(matching: Matching) -> dict[int, str]:
    """The roles of the target's joints; empty unless both bodies have an anatomy."""
    source, target = matching.source.anatomy, matching.target.anatomy
    return {joint: role for role, joint in target.roles.items()} if source and target else {}


def _sole_normals(matching: Matching, source_pose: Array, target_pose: Array) -> dict[int, tuple[Array, Array]]:
    """For each of the target's ankles, the sole normals of source and target, (3,), in poses (joints, 3, 3)."""
    if matching.legs is None or not _roles(matching):
        return {}
    return {
        b.ankle: (source_pose[a.ankle] @ source.normal, target_pose[b.ankle] @ target.normal)
        for a, b, (source, target) in zip(*matching.legs, matching.soles, strict=True)
    }


def _trunk(body: Body, roles: Mapping[int, str]) -> set[int]:
    """The joints of trunk, shoulders, neck and head, and all others from which upper arms and thighs hang."""
    if not roles or body.anatomy is None:
        return set()
    limbs = [joint for joint, role in roles.items() if role.endswith(FIRST_BONES)]
    tops = [*body.anatomy.spine, *body.anatomy.neck, *body.anatomy.joints("hips", "head")]
    return body.skeleton.with_ancestors([*body.skeleton.parents[limbs], *tops])


def _joint_alignments(matching: Matching, normals: Mapping[int, tuple[Array, Array]]) -> Array:
    """(target joints, 3, 3), the rotations that align each target joint with the source, both bodies in their poses.
    `normals` are the `_sole_normals`.

    Upper arms turn first to the source's sideways axis and then to its arm, so that a target in A-pose is aligned like
    the same target in T-pose. Ankles start from the alignment of the whole body, not of the leg. Feet that turn out in
    one rest pose only turn back with the thigh, as people turn them.
    """
    roles, (source_pose, target_pose) = _roles(matching), matching.poses
    whole = source_pose.axes @ target_pose.axes.T if matching.in_reference else np.eye(3)
    in_t_pose = matching.in_reference and not (matching.source.stands and matching.target.stands)
    foot = slice(1 if in_t_pose else 0)  # the bones of an ankle that are aligned
    left, trunk = source_pose.axes[:, 0], _trunk(matching.target, roles)
    outwards = {"leftUpperArm": left, "rightUpperArm": -left}
    turned = zip(matching.legs[1] if matching.legs else (), matching.turnout, strict=False)
    turnout = {joint: angle for leg, angle in turned for joint in (leg.hip, leg.ankle)}
    upper, *directions = matching.shared_bones(source_pose.positions, target_pose.positions)
    alignments: list[Array] = []
    parents = matching.target.skeleton.parents.tolist()
    edges = np.searchsorted(upper, range(len(parents) + 1)).tolist()
    for joint, parent in enumerate(parents):
        role = roles.get(joint, "")
        b, a = (each[edges[joint] : edges[joint + 1]] for each in directions)
        turn = whole if not joint or role.endswith("Foot") else alignments[parent]
        if joint in normals:
            turn = _sole_onto_sole(*normals[joint], b[foot], a[foot], turn)
        if len(a):
            if role in outwards:
                turn = least_matrix(a[:1] @ turn.T, outwards[role][None]) @ turn
            onto = least_matrix(a @ turn.T, b)
            far = (np.trace(onto) - 1.0) / 2.0 < np.cos(BUILD_ANGLE)
            another_pose = len(a) == 1 and far and joint not in normals and not role.endswith("Toes")
            if joint not in trunk and (another_pose or not role or role.endswith(BY_BONE)):
                turn = onto @ turn
        if angle := turnout.get(joint):
            axis = normals[joint][0] if joint in normals else -b[:1].sum(axis=0)  # none without a bone
            turn = Rotation.from_rotvec(-angle * axis).as_matrix() @ turn
        alignments.append(turn)
    return np.array(alignments)


def _sole_onto_sole(normal: Array, target_normal: Array, feet: Array, target_feet: Array, turn: Array) -> Array:
    """(3, 3), the alignment `turn` of an ankle, followed by the least rotation of the target's sole onto the source's,
    and by one about its normal that aligns `target_feet` with `feet`, directions (1, 3), or (0, 3) for none.
    """
    turn = least_matrix((turn @ target_normal)[None], normal[None]) @ turn
    if not len(feet):
        return turn
    return least_matrix(level(target_feet @ turn.T, normal), level(feet, normal)) @ turn


@dataclass(frozen=True)
class RootScale:
    """The scale from positions in the source's world to positions in the target's. Performers in one world share the
    scale along the floor, so that they meet, but not the scale of heights, so that each stands on the floor.
    """

    level: float  # along the floor [target units per source unit]
    height: float  # upwards [target units per source unit]
    rise: float = 0.0  # added to scaled heights, so that soles are on the floor [target units]

    @classmethod
    def even(cls, scale: float) -> RootScale:
        """Return a scale that is the same in all directions."""
        return cls(scale, scale)

    def places(self, places: Array, up: Array) -> Array:
        """Return positions in the target's world for those in the source's, (..., 3); `up` is the unit vector up."""
        heights = places @ up
        return np.asarray(self.level * places + (self.heights(heights) - self.level * heights)[..., None] * up)

    def heights(self, heights: Array) -> Array:
        """Return heights in the target's world for heights in the source's."""
        return self.height * heights + self.rise


def find_root_scale(matching: Matching) -> float:
    """Return how many target units the root travels per source unit: the ratio of leg lengths, which keeps strides and
    heights in proportion to the body, or without legs the ratio of the longest paths; 1 if either has no length.
    """
    if matching.legs:
        from_length, to_length = matching.leg_lengths
    else:
        shared = np.flatnonzero(matching.drivers >= 0)
        from_length = matching.source.skeleton.longest_path_among(matching.drivers[shared])
        to_length = matching.target.skeleton.longest_path_among(shared)
    return float(to_length / from_length) if min(from_length, to_length) > 0.0 else 1.0


def root_path(baseline: Motion, matching: Matching, scale: RootScale) -> Array:
    """Return the root's path, (frames, 3) [target file units], that moves the hips along the source's scaled path."""
    if matching.legs is None:
        return np.ascontiguousarray(baseline.root_positions)
    source_hips, hips = (
        motion.positions[:, [leg.hip for leg in legs]].mean(axis=1)
        for motion, legs in zip((matching.source_motion, baseline), matching.legs, strict=True)
    )
    return np.ascontiguousarray(scale.places(source_hips, matching.source.up_vector) - hips + baseline.root_positions)


def longest_strides(matching: Matching) -> float:
    """Return the largest factor of the strides, relative to leg length, that the legs can reach, by (s d)^2 + (h -
    sink)^2 = (leg length)^2 for feet that rest at d along the floor and h below their hip joint; or infinite.
    """
    if matching.legs is None:
        return float("inf")
    motion, up, leg_length = matching.source_motion, matching.source.up_vector, matching.leg_lengths[0]
    factors = []
    for leg in matching.legs[0]:
        rests = feet_at_rest(motion, leg, up, leg_length).any(axis=1)
        to_hip = motion.positions[rests, leg.hip] - motion.positions[rests, leg.ankle]
        reach = np.sqrt(np.maximum(leg_length**2 - (to_hip @ up - SINK * leg_length) ** 2, 0.0))
        factors.append(reach / np.maximum(lengths(level(to_hip, up)), 1e-9 * leg_length))
    reachable = np.concatenate(factors)
    return float(np.percentile(reachable, 100.0 - MOST_FRAMES) if reachable.any() else 0.0) or float("inf")


def common_level_scale(heights: Sequence[float], longest: Sequence[float]) -> float:
    """Return the scale along the floor for all: the mean of `heights`, or less if somebody's legs are too short."""
    if len(heights) == 1:
        return heights[0]
    return float(min(np.mean(heights), *np.multiply(heights, longest)))


def rotation_copy(matching: Matching, scale: RootScale) -> Motion:
    """Return the motion with the world rotations R_src(t) A, where A is the alignment of the rest poses. Joints without
    rotation sources follow their parents as in the reference pose; the pelvis takes its driver's scaled path.
    """
    source, skeleton, up = matching.source_motion, matching.target.skeleton, matching.source.up_vector
    alignment = rest_alignment(matching).copy()
    sources, blend = matching.rotation_sources.copy(), matching.blend.copy()
    stance = matching.target.reference.rotations
    for joint in (np.flatnonzero(sources[1:, 0] < 0) + 1).tolist():
        parent = skeleton.parents[joint]
        sources[joint], alignment[joint], blend[joint] = sources[parent], alignment[parent], blend[parent]
        if not matching.target.stands_at_rest:
            above, own = Rotation.from_quat(stance[[parent, joint]])
            turn = above.inv() * own
            alignment[joint] = (Rotation.from_quat(alignment[parent]) * turn).as_quat()
    between = np.flatnonzero(blend > 0)

    def aligned(turned: Array, joints: Numbers, k: int) -> Array:
        return rotation_products(turned, sources[joints, k], alignment[joints, k])

    def pose(block: slice, world: Array) -> Array:
        turned = source.world_rotations_in(block)
        world[:] = aligned(turned, np.arange(len(skeleton)), 0)
        if len(between):
            first, second = (Rotation.from_quat(aligned(turned, between, k)) for k in (0, 1))
            steps = (first.inv() * second).as_rotvec() * blend[between, None]
            world[:, between] = (first * Rotation.from_rotvec(steps)).as_quat()
        path = scale.places(source.positions[block, matching.drivers[matching.pelvis]], up)
        for joint in skeleton.to_root(matching.pelvis)[:-1]:
            parent = Rotation.from_quat(world[:, skeleton.parents[joint]])
            path = path - parent.apply(np.array(skeleton.offsets[joint]))
        return path

    return motion_of_world(skeleton, len(source), source.frame_time_text, pose)
