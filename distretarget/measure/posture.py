"""Directions of trunk, head, palms, soles and legs in a result against its source.

Nothing here uses the alignment of the two bodies, by which results are made. The axes of head and soles come from
gravity in a rest pose in which a person can stand; else, over the frames of the body's own motion, those of the head
from the neck and where the body faces, and those of soles from gravity. All others come from positions of joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.axes import axis_vector, direction, nearest_axis
from distretarget.body.body import Body
from distretarget.body.limbs import Leg
from distretarget.matching.matching import Matching
from distretarget.measure.metrics import Track
from distretarget.measure.supports import feet_rest
from distretarget.motion import Motion
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.vectors import Array, Flags, angles_between, cross, level, normalised

LEAST_FRAMES = 20  # over which axes may be averaged
ON_AXIS = np.cos(np.radians(15))  # a bone this near to an axis of its joint was built along it [cosine]
NEAR = np.cos(np.radians(35))  # a mean direction over a motion stands for an axis of a joint this near to it [cosine]
FLAT = np.sin(np.radians([5, 40]))  # a flat foot points downwards by an angle between these [sine]
STEEPEST = np.sin(np.radians(60))  # a foot that points farther up or down than this in the rest pose is not flat [sine]
KEYS = ("trunk_tilt", "head_tilt", "palm_turn", "sole_tilt", "heading", "splay")  # of the metrics
OUTER_FINGERS = ("Little", "Ring", "Middle")  # across the palm from the index finger; the first that both bodies have


@dataclass(frozen=True, eq=False)
class KeptDirection:
    """A direction of a part of the body that should be the same in source and result."""

    joint: int  # of the target; it names the part
    source: Array  # (frames, n), unit vectors in the source
    of_motion: Callable[[Motion], Array]  # the unit vectors in a motion of the target
    measured: Flags | None = None  # (frames,), where it counts; None for all

    def error(self, result: Motion) -> Array:
        """(frames,), the angle between result and source [degrees]; nan where it is not measured."""
        angles = np.degrees(angles_between(self.of_motion(result), self.source))
        return np.asarray(angles if self.measured is None else np.where(self.measured, angles, np.nan))


Axes = tuple[Array, Array]
"""Up and forward, (3,) each, in the axes of a joint; zero where unknown."""
UNKNOWN: Axes = (np.zeros(3), np.zeros(3))
Posture = Mapping[str, Sequence[KeptDirection]]  # by key of the metric


def find_posture(source: Motion, matching: Matching, up: Array, stance: Flags) -> Posture:
    """Find the directions that should be kept, by metric: the trunk's axis up, the head's, the normals of palms and
    resting soles, the headings of head and resting feet, and how far legs point outwards. `up` is (3,), `stance`
    (frames, foot joints).
    """
    posture = {key: list[KeptDirection]() for key in KEYS}

    def add(key: str, joint: int, sides: Iterable[Callable[[Motion], Array]], measured: Flags | None = None) -> None:
        of_source, of_target = sides
        posture[key].append(KeptDirection(joint, of_source(source), of_target, measured))

    def add_axes(tilt: str, joints: Sequence[int], axes: Sequence[Axes], measured: Flags | None = None) -> None:
        """Add the axes up and forward of a joint of source and target."""
        for key, of_joint, along in ((tilt, [up for up, _ in axes], None), ("heading", [axis for _, axis in axes], up)):
            if all(axis.any() for axis in of_joint):
                sides = (partial(_turned, joint, axis, along) for joint, axis in zip(joints, of_joint, strict=True))
                add(key, joints[1], sides, measured)

    bodies = matching.source, matching.target
    pairs = [[body.anatomy.pair(part) for part in ("UpperLeg", "UpperArm")] if body.anatomy else [] for body in bodies]
    trunks = [[joint for pair in each for joint in pair] for each in pairs]
    if all(each and all(each) for each in pairs) and all(body.up_at_rest for body in bodies):
        add("trunk_tilt", trunks[1][0], (partial(_trunk, *each) for each in zip(bodies, trunks, strict=True)))
    heads = [body.roles["head"] for body in bodies if "head" in body.roles]
    if len(heads) == len(bodies):
        add_axes("head_tilt", heads, [*map(_head_axes, bodies, heads)])
    for hands in _hands(matching):
        add("palm_turn", hands[1][0], (partial(_palm, joints) for joints in hands))
    for k, legs in enumerate(zip(*matching.legs, strict=True) if matching.legs else ()):
        ankle_rests, rests = stance[:, 2 * k], stance[:, 2 * k] & stance[:, 2 * k + 1]
        both = zip(legs, (side[1 - k] for side in matching.legs or ()), strict=True)
        add("splay", legs[1].ankle, (partial(_outwards, *pair) for pair in both), ankle_rests)
        axes = [*map(_foot_axes, bodies, legs, matching.leg_lengths)]
        if not all(body.up_at_rest for body in bodies):  # over a motion, turned-out feet would be taken for the build
            axes = [(up, _along_foot(body, leg, up)) for body, leg, (up, _) in zip(bodies, legs, axes, strict=True)]
        if matching.source_normals is not None and axes[0][0].any():
            axes[0] = matching.source_normals[k], axes[0][1]
        if matching.target_normals is not None and legs[1].toe != legs[1].ankle:
            axes[1] = matching.target_normals[k], axes[1][1]
        if matching.turnout[k]:
            axes[1] = axes[1][0], Rotation.from_rotvec(matching.turnout[k] * axes[1][0]).apply(axes[1][1])
        add_axes("sole_tilt", [leg.ankle for leg in legs], axes, rests)
    return posture


def errors_of(directions: Sequence[KeptDirection], result: Motion) -> Track:
    """The errors of directions in a result, (frames, directions) [degrees]."""
    errors = np.reshape([each.error(result) for each in directions], (len(directions), len(result))).T
    return Track(errors, np.isfinite(errors), result.skeleton.keys_of(each.joint for each in directions))


def _trunk(body: Body, ends: Sequence[int], motion: Motion) -> Array:
    """(frames, 3), the axis of the trunk, between hips and shoulders, that points up in the reference pose."""
    upright = _trunk_axes(body.reference.positions[None], ends)[0].T @ body.reference.axes[:, 1]
    return np.asarray(_trunk_axes(motion.positions, ends) @ upright)


def _trunk_axes(positions: Array, ends: Sequence[int]) -> Array:
    """(frames, 3, 3), the axes of a trunk, in columns: to its left, from hips to shoulders, ahead."""
    left, right, *shoulders = ends
    along = normalised(positions[:, shoulders].mean(axis=1) - positions[:, [left, right]].mean(axis=1))
    across = positions[:, left] - positions[:, right]
    across = normalised(across - (across * along).sum(axis=1)[:, None] * along)
    return np.stack([across, along, cross(across, along)], axis=2)


def _head_axes(body: Body, head: int) -> Axes:
    """The axes up and forward of a head: of the rest pose if it stands; else the mean directions of neck and body. If
    the rig is built along the neck, the joint's axes near these are taken, or none: the head may be bent in the whole
    motion.
    """
    if body.at_rest and body.stands_at_rest:
        return body.at_rest.vertical, body.rest.axes[:, 2]
    if body.motion is None or body.in_motion is None or len(body.motion) < LEAST_FRAMES:
        return UNKNOWN
    neck = body.skeleton.parents[head]
    turns = Rotation.from_quat(body.motion.world_rotations_of(head)).inv()
    up = normalised(turns.apply(direction(body.motion.positions, neck, head)).sum(axis=0))
    forward = turns.apply(body.in_motion.axes[:, :, 2]).sum(axis=0)
    along = _axis_near(direction(body.rest.positions, neck, head), ON_AXIS)
    if not along.any():
        return up, normalised(level(forward, up))
    return along * (along @ up > NEAR), _axis_near(level(forward, along), NEAR)


def _foot_axes(body: Body, leg: Leg, length: float) -> Axes:
    """The axes up and forward of an ankle while the foot is flat: in the rest pose, else the mean over the motion. If
    the rig is built along the foot, up is made perpendicular to the ankle's axis across it, as a foot may be on its
    edge.
    """
    if leg.toe == leg.ankle:
        return UNKNOWN
    if body.at_rest and body.stands_at_rest:
        up = body.at_rest.vertical
        if abs(direction(body.rest.positions, leg.ankle, leg.toe) @ up) <= STEEPEST:
            return up, body.rest.axes[:, 2]
    if body.motion is None or len(body.motion) < 2:
        return UNKNOWN
    rests = feet_rest(body.motion, [leg], length, body.up_vector).all(axis=1)
    heights = direction(body.motion.positions, leg.toe, leg.ankle) @ body.up_vector
    rests &= (FLAT[0] < heights) & (heights < FLAT[1])
    up, forward = _mean_axes(body, leg.ankle, rests)
    if not up.any():
        return UNKNOWN
    turns = Rotation.from_quat(body.motion.world_rotations_of(leg.ankle)[rests]).inv()
    bone = normalised(turns.apply(direction(body.motion.positions[rests], leg.ankle, leg.toe)).sum(axis=0))
    built = _axis_near(bone, ON_AXIS).any()
    return normalised(level(up, _axis_near(cross(bone, up), NEAR) * built)), forward


def _axis_near(direction: Array, least: float) -> Array:
    """The axis of a joint, (3,), whose cosine to a direction in its axes is above `least`; zero if there is none."""
    axis, cosine = nearest_axis(normalised(direction))
    return axis_vector(axis) * (cosine > least)


def _along_foot(body: Body, leg: Leg, up: Array) -> Array:
    """(3,), the direction of a foot along the floor in the axes of its ankle, where `up` is up; zero if unknown."""
    pose = body.reference
    bone = pose.positions[leg.toe] - pose.positions[leg.ankle]
    bone = Rotation.from_quat(pose.rotations[leg.ankle]).inv().apply(bone)
    return normalised(level(bone, up)) if up.any() else np.zeros(3)


def _mean_axes(body: Body, joint: int, frames: Flags) -> Axes:
    """The mean directions up, and in which the body faces, in the axes of a joint over some frames; or `UNKNOWN`."""
    if body.motion is None or body.in_motion is None or np.count_nonzero(frames) < LEAST_FRAMES:
        return UNKNOWN
    turns = Rotation.from_quat(body.motion.world_rotations_of(joint)[frames]).inv()
    up, forward = body.up_vector, level(body.in_motion.axes[frames, :, 2], body.up_vector)
    return normalised(turns.apply(up).sum(axis=0)), normalised(turns.apply(forward).sum(axis=0))


def _hands(matching: Matching) -> Iterator[list[list[int]]]:
    """For each hand of which both bodies have them: wrist, index knuckle and an outer knuckle, of source and target."""
    roles = [body.roles for body in (matching.source, matching.target)]
    for side in SIDES:
        for finger in OUTER_FINGERS:
            names = [side + part for part in ("Hand", "Index1", f"{finger}1")]
            if all({*names} <= own.keys() for own in roles):
                yield [[own[name] for name in names] for own in roles]
                break


def _turned(joint: int, axis: Array, up: Array | None, motion: Motion) -> Array:
    """(frames, 3), an axis of a joint, (3,), in the world; only its horizontal part if `up`, (3,), is given."""
    axes = turned_by(motion.world_rotations_of(joint), axis)
    return axes if up is None else level(axes, up)


def _palm(joints: Sequence[int], motion: Motion) -> Array:
    """(frames, 3), the normal of the palm: across the wrist and two knuckles."""
    wrist, index, outer = (motion.positions[:, joint] for joint in joints)
    return normalised(cross(index - wrist, outer - wrist))


def _outwards(leg: Leg, other: Leg, motion: Motion) -> Array:
    """(frames, 2), cosine and sine of the angle by which a leg, from hip to ankle, points away from the other one."""
    positions = motion.positions
    sine = normalised(positions[:, leg.ankle] - positions[:, leg.hip])
    sine = (sine * normalised(positions[:, leg.hip] - positions[:, other.hip])).sum(axis=-1)
    return np.stack([np.sqrt(np.maximum(1.0 - sine**2, 0.0)), sine], axis=-1)
