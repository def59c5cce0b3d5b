"""The reference pose of a body: a standing pose in which it can be aligned with another body.

A rest pose in which a person can stand (T-pose, A-pose, arms down) is the reference pose. Any other, such as one with
all bones along one axis, is replaced by a T-pose. The OFFSETs show where bones point in the axes of their joints, and
the motion as a whole how these axes are built, so that all clips of a rig have the same T-pose.

What one clip shows (a turned wrist, a head that looks down) does not belong to the rig. So the neutral rotation of a
joint is one with which rigs are built, and the motion only chooses between these: none against the parent, or right
angles to the parent's axes. If neither is near, it is the median over the frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES, Anatomy, side_and_part
from distretarget.body.axes import PARALLEL, SQUARE, Directions, axes_of, direction, nearest_axis, upright
from distretarget.body.conventions import leans_of
from distretarget.body.limbs import foot_bone
from distretarget.motion import Motion
from distretarget.numerics.rotations import least_matrix, nearest_rotations
from distretarget.numerics.vectors import Array, Flags, cross, lengths, level, normalised
from distretarget.skeleton import Skeleton

STANDING_ANGLE = 100.0  # a person can stand with a larger angle than this between trunk and legs [degrees] ...
RAISED_ARM = np.cos(np.radians(30))  # ... if both arms are at least this angle from straight up [cosine]
RAISED_LEG = np.cos(np.radians(60))  # ... and both legs at least this one [cosine]
FOOT_PITCH = np.radians(25)  # usual angle by which feet point downwards [rad]
PITCH_DEVIATION = np.radians(8)  # standard deviation of that angle over rigs [rad]
USUAL_WEIGHT = 0.01  # weight of the usual pitch; all resting feet of a motion together have up to 1
OPPOSITE = -0.9  # a bone with a smaller cosine to its goal first turns by 180 degrees about the sideways axis
ON_AXIS = np.cos(np.radians(20))  # a joint with a bone this near to one of its axes is built along the bone [cosine]
USUAL = np.cos(np.radians(60))  # the usual bend axis is within this angle of the one that the motion shows [cosine]
ACROSS = 0.7  # axes of a joint with a larger component across the bone may be the bend axis [sine]
MOST_FRAMES = 500  # up to this many frames of a motion are used, evenly spread
ITERATIONS = 10  # of the search for a median rotation
ALIKE = np.radians(1.0)  # rotations nearer to the median than this have the same weight [rad]
STILL = np.radians(0.05)  # a joint that turns by less than this is not animated [rad] ...
ANIMATED = np.radians(5.0)  # ... if elbows or knees turn by more than this [rad]
ALONG_FOOT = np.cos(np.radians(60))  # toes continue the foot within this angle [cosine]
LOWER_BONES = ("LowerArm", "LowerLeg")
HELD = ("Hand", "head")  # roles of joints that a clip may hold still in a pose that is not neutral
UNTURNED = np.radians(60.0)  # a joint with a smaller median rotation has none while it is neutral [rad]
RIGHT_ANGLED = np.radians(40.0)  # a joint with a median within this of right angles is at right angles [rad]
CLEAR_BEND = 0.2  # a limb with a larger mean bend shows its bend axis [sine]
# (6, 4, 3, 3), all rotations by right angles: by the permutation of the axes, then by their signs.
RIGHT_ANGLES = np.array(
    sorted(np.rint(Rotation.create_group("O").as_matrix()), key=lambda turn: abs(turn).tolist())
).reshape(6, 4, 3, 3)


def stands_at_rest(rest: Directions) -> bool:
    """Return whether a person can stand in the rest pose: legs down, trunk up, no limb raised along the trunk."""
    stands = not rest.is_whole or rest.stretch > STANDING_ANGLE
    limbs = (("UpperArm", "Hand", RAISED_ARM), ("UpperLeg", "Foot", RAISED_LEG))
    bones = [(rest.bone(side + top, side + end), most) for side in SIDES for top, end, most in limbs]
    return bool(stands and all(bone @ rest.trunk < most for bone, most in bones if bone is not None))


@dataclass(frozen=True, eq=False)
class _Goal:
    """The bone and the bend axis of a joint of a limb in a T-pose."""

    tip: int  # the joint at the end of its bone
    bone: Array  # (3,), the direction of the bone
    across: Array  # (3,), the direction of the axis about which the limb bends
    above: int  # the joint whose rotation it has while the limb is straight, if it is built alike; -1 for none
    as_above: bool  # whether the joint above bends about the same axis


def t_pose(skeleton: Skeleton, rest: Directions, motion: Motion | None, foot_pitch: float = FOOT_PITCH) -> Array:
    """Return the world rotations, (joints, 4), of a T-pose with Y up that faces Z, for a rest pose and any motion.

    Hips, spine, neck, head, collar bones, hands and toes are neutral. The joints of arms and legs turn by the least
    rotation that points their bones as in a T-pose, feet downwards by `foot_pitch` [rad], and roll until the axis about
    which they bend in the motion points as in a T-pose, too. A bone that nearly reverses turns about the sideways axis,
    as knees do. Without a motion, neutral joints have no rotation against their parents.
    """
    anatomy, shown = rest.anatomy, motion and motion[:: -(-len(motion) // MOST_FRAMES)]
    goals = dict(_limb_goals(skeleton, anatomy, foot_pitch)) | ({} if shown else dict(_trunk_goals(anatomy)))
    for toes in _toes_with_tails(skeleton, rest, shown):
        del goals[toes]
    goals |= {} if shown else dict(_goals_of_pieces(skeleton, anatomy, goals))
    bones = {joint: _bone(rest, shown, joint, goal.tip) for joint, goal in goals.items()}
    built = {joint for joint, bone in bones.items() if np.abs(bone).max() > ON_AXIS}
    built = built if 2 * len(built) > len(bones) else set()  # in other rigs it is a coincidence
    bends = bend_axes(anatomy, shown) if shown else {}
    neutral = _neutral_turns(anatomy, shown, built=bool(built)) if shown else np.tile(np.eye(3), (len(skeleton), 1, 1))
    known, leans = _carriers_and_hips(skeleton, rest, shown), _leans(anatomy)
    turns: list[Array] = []
    for joint, parent in enumerate(skeleton.parents.tolist()):
        turn = known[joint] if joint in known else leans.get(joint, np.eye(3)) @ turns[parent] @ neutral[joint]
        if joint in bones and bones[joint].any():
            goal = goals[joint]
            start = turns[goal.above] if joint in built and goal.above >= 0 else turn
            turn = _pointed(start, bones[joint], goal.bone)
            if joint in bends or (shown and joint in built):
                turn = _rolled(turn, goal, bends.get(joint), joint in built)
        turns.append(turn)
    return np.asarray(Rotation.from_matrix(np.array(turns)).as_quat())


def _carriers_and_hips(skeleton: Skeleton, rest: Directions, shown: Motion | None) -> dict[int, Array]:
    """The rotations, (3, 3), in a T-pose of the hips and of the joints above them, by joint."""
    hips, *carriers = skeleton.to_root(rest.anatomy.roles["hips"])
    if shown is None:
        return dict.fromkeys((*carriers[-1:], hips), _hip_axes(rest).T)
    turns = {joint: _against_trunk(rest.anatomy, shown, joint) for joint in carriers}
    places = _places_from(shown, hips, range(len(skeleton)))
    return turns | {hips: _hip_axes(Directions(rest.anatomy, places)).T}


def _bone(rest: Directions, shown: Motion | None, joint: int, tip: int) -> Array:
    """The direction of a bone in the axes of its joint, (3,); zero for a bone of length 0."""
    return normalised(_places_from(shown, joint, [tip])[0]) if shown else direction(rest.positions, joint, tip)


def usual_pitch(pitches: Array) -> float:
    """Return the pitch of flat feet from the pitches of resting feet of a motion, (n,), all [rad]: a mean that includes
    `FOOT_PITCH`, weighted by how likely a flat foot has each pitch, so that tiptoes and heels hardly count.
    """
    weights = np.exp(-0.5 * ((pitches - FOOT_PITCH) / PITCH_DEVIATION) ** 2)
    return float(np.average([*pitches, FOOT_PITCH], weights=[*weights, USUAL_WEIGHT * len(pitches)]))


def _pointed(turn: Array, bone: Array, goal: Array) -> Array:
    """The rotation `turn`, (3, 3), followed by the least one that points a bone, (3,) in its axes, along `goal`."""
    if goal @ turn @ bone < OPPOSITE:
        turn = np.diag([1.0, -1.0, -1.0]) @ turn
    return least_matrix((turn @ bone)[None], goal[None]) @ turn


def _rolled(turn: Array, goal: _Goal, bend: Array | None, built: bool) -> Array:
    """The rotation `turn`, (3, 3), followed by one about the bone that brings the axis `bend` to `goal.across`. `bend`,
    (3,) in the joint's axes, is None if the motion does not show it.

    In a joint that is built along its bone, one of its own axes is the bend axis: the one nearest to the goal by
    `turn`, unless the motion shows another. A bend opposite to that of the joint above does not count as
    another axis: it is a peculiarity of the motion, as of feet in ballet.
    """
    shown = goal.across if bend is None else normalised(level(turn @ bend, goal.bone))
    axis = shown
    if built:
        axes = level(np.vstack([turn.T, -turn.T]), goal.bone)
        axes = normalised(axes[lengths(axes) > ACROSS])
        usual = axes[np.argmax(axes @ goal.across)]
        near = abs(shown @ usual) if goal.as_above else shown @ usual
        axis = usual if near > USUAL else axes[np.argmax(axes @ shown)]
    angle = np.arctan2(cross(axis, goal.across) @ goal.bone, axis @ goal.across)
    return np.asarray(Rotation.from_rotvec(angle * goal.bone).as_matrix() @ turn)


def _leans(anatomy: Anatomy) -> dict[int, Array]:
    """The rotations, (3, 3), of spine, neck and head against the joint below in a T-pose (`Convention.leans`)."""
    joints, leans = _spine_to_head(anatomy), leans_of(anatomy.convention)
    steps = np.outer(np.diff(leans, prepend=0.0), [1.0, 0.0, 0.0])
    turns = Rotation.from_rotvec(steps, degrees=True).as_matrix() if len(leans) == len(joints) else ()
    return dict(zip(joints, turns, strict=False))


def _hip_axes(places: Directions) -> Array:
    """(3, 3), the body's axes in those of the hips, from joint positions in the axes of the hips: left across the hip
    joints, or the shoulders if hip joints lie along the spine; up along the spine's first bone, or along the trunk if
    only the trunk is near an axis of the hips.
    """
    anatomy, x = places.anatomy, places.positions
    bones = [direction(x, anatomy.roles["hips"], joint) for joint in _spine_to_head(anatomy)]
    bone = next((bone for bone in bones if bone.any()), places.trunk)
    up = next((up for up in (bone, places.trunk) if nearest_axis(up)[1] > SQUARE), bone)
    lefts = [normalised(width) for width in map(places.across, ("UpperLeg", "UpperArm")) if width is not None]
    left = next((left for left in lefts if lengths(cross(left, up)) > PARALLEL), places.left)
    return upright(axes_of(left, up))


def _spine_to_head(anatomy: Anatomy) -> list[int]:
    """The joints above the hips, up to the head."""
    return [*anatomy.spine, *anatomy.neck, *anatomy.joints("head")]


def _limb_goals(skeleton: Skeleton, anatomy: Anatomy, foot_pitch: float) -> Iterator[tuple[int, _Goal]]:
    """The joints of arms and legs, each with its goal in a T-pose with Y up that faces Z."""
    left, up, forward = np.eye(3)
    foot = np.cos(foot_pitch) * forward - np.sin(foot_pitch) * up
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        above = partial(_above, skeleton, anatomy, side)
        lower_joints = anatomy.joints(*(side + part for part in LOWER_BONES))
        for limb, bone, across in ((ARM[1:], sign * left, -sign * up), (LEG[:3], -up, left)):
            for upper, lower in _bones_of(anatomy, side, limb):
                yield upper, _Goal(lower, bone, across, above(upper), upper in lower_joints)
        if ends := foot_bone(skeleton, anatomy, side):
            yield ends[0], _Goal(ends[1], foot, left, above(ends[0]), True)
        toes = anatomy.roles.get(f"{side}Toes")
        if toes is not None:
            yield toes, _Goal(skeleton.farthest.item(toes), forward, left, above(toes), True)


def _goals_of_pieces(skeleton: Skeleton, anatomy: Anatomy, goals: Mapping[int, _Goal]) -> Iterator[tuple[int, _Goal]]:
    """The joints along long bones in pieces, as above twist joints, each with the goal of the bone: without a motion
    nothing else shows where the pieces point.
    """
    lower = anatomy.joints(*(side + part for side in SIDES for part in (*LOWER_BONES, "Hand", "Foot")))
    for joint, goal in goals.items():
        line = skeleton.to_root(goal.tip)
        pieces = line[line.index(joint) :: -1] if goal.tip in lower else ()
        for upper, tip in pairwise(pieces):
            yield upper, replace(goal, tip=tip, above=goal.above if upper == joint else -1)


def _above(skeleton: Skeleton, anatomy: Anatomy, side: str, joint: int) -> int:
    """The joint above one of a limb: the next of the limb, past twist joints; a shoulder's parent; -1 for a hip."""
    if joint == anatomy.roles.get(f"{side}UpperLeg"):
        return -1
    limbs = anatomy.joints(*(side + part for part in (*ARM[1:], *LEG)))
    return next((each for each in skeleton.to_root(joint)[1:] if each in limbs), skeleton.parents.item(joint))


def _toes_with_tails(skeleton: Skeleton, rest: Directions, shown: Motion | None) -> Iterator[int]:
    """The toes whose End Sites do not continue the foot but lead up or back, as tails of bones in some programs."""
    for side in SIDES:
        ends = rest.anatomy.joints(f"{side}Foot", f"{side}Toes")
        tip = skeleton.farthest.item(ends[-1]) if len(ends) == 2 else 0
        if skeleton.end_sites[tip]:
            ankle, toes = ends
            places = (
                _places_from(shown, ankle, [toes, tip])
                if shown
                else rest.positions[[toes, tip]] - rest.positions[ankle]
            )
            if normalised(places[0]) @ normalised(places[1] - places[0]) < ALONG_FOOT:
                yield toes


def _trunk_goals(anatomy: Anatomy) -> Iterator[tuple[int, _Goal]]:
    """The joints of spine, neck and shoulders, with their goals in a T-pose if there is no motion."""
    left, up, _ = np.eye(3)
    for lower, upper in pairwise(_spine_to_head(anatomy)):
        yield lower, _Goal(upper, up, left, -1, False)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for upper, lower in _bones_of(anatomy, side, ARM[:2]):
            yield upper, _Goal(lower, sign * left, -sign * up, -1, False)


def _bones_of(anatomy: Anatomy, side: str, limb: tuple[str, ...]) -> Iterator[tuple[int, int]]:
    """The joints at the upper and lower end of each bone of a limb; parts that the body lacks are skipped."""
    return pairwise(anatomy.joints(*(side + part for part in limb)))


def _places_from(motion: Motion, joint: int, others: Sequence[int]) -> Array:
    """(len(others), 3), the mean positions over the frames of other joints in the axes of a joint."""
    offsets = motion.positions[:, others] - motion.positions[:, joint, None]
    turns = Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()
    return np.asarray((offsets @ turns).mean(axis=0))


def _against_trunk(anatomy: Anatomy, motion: Motion, joint: int) -> Array:
    """(3, 3), the rotation in a T-pose of a joint that carries the body: right angles near its median to the trunk."""
    trunk = Directions(anatomy, motion.positions).axes
    turns = Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()
    return np.asarray(_right_angled(_medians((trunk.swapaxes(-1, -2) @ turns)[:, None])[0])[0])


def _neutral_turns(anatomy: Anatomy, motion: Motion, *, built: bool) -> Array:
    """The rotation of each joint against its parent while it is neutral, (3, 3).

    A joint that is not animated is neutral as it is, except hands, neck and head, which a clip may hold still. A collar
    bone has its median rotation while the arm hangs. Other joints have none, if their median is near that; right angles
    in a rig that is `built` along its bones, if their median is near them; else their median. Left and right joints
    decide together, so that a hand or leg that one clip holds turned counts half.
    """
    local = Rotation.from_quat(motion.rotations).as_matrix()
    neutral, farthest = _medians(local)
    hinges = (side + part for side in SIDES for part in LOWER_BONES)
    animated = any(farthest[joint] > ANIMATED for joint in anatomy.joints(*hinges))
    held = {joint for role, joint in anatomy.roles.items() if role.endswith(HELD)} | {*anatomy.neck}
    for joints in _built_alike(anatomy, len(neutral)):
        fixed = animated and farthest[joints].max() < STILL and not held.intersection(joints)
        if not fixed and _angles(neutral[joints]).mean() < UNTURNED:
            neutral[joints] = np.eye(3)
        elif not fixed and built:
            neutral[joints] = _squared(neutral[joints])
    for joint, hangs in _collar_bones(anatomy, motion):
        neutral[joint] = _medians(local[hangs if hangs.any() else ~hangs, joint, None])[0][0]
    return neutral


def _built_alike(anatomy: Anatomy, count: int) -> Iterator[list[int]]:
    """The left and the right joint of each part of the body, which rigs build as mirror images; other joints singly."""
    pairs = [anatomy.pair(part) for side, part in map(side_and_part, anatomy.roles) if side == SIDES[0]]
    yield from filter(None, pairs)
    yield from ([joint] for joint in {*range(count)}.difference(*pairs))


def _collar_bones(anatomy: Anatomy, motion: Motion) -> Iterator[tuple[int, Flags]]:
    """The joints of collar bones, each with whether its upper arm points downwards along the trunk, (frames,)."""
    directions = Directions(anatomy, motion.positions)
    for side in SIDES:
        arm = directions.bone(f"{side}UpperArm", f"{side}LowerArm")
        if arm is not None and f"{side}Shoulder" in anatomy.roles:
            yield anatomy.roles[f"{side}Shoulder"], (arm * directions.trunk).sum(axis=-1) < 0.0


def bend_axes(anatomy: Anatomy, motion: Motion) -> dict[int, Array]:
    """Return the axes, (3,), about which elbows and knees bend, by the joints of limbs, each in the joint's own axes:
    the mean over the frames. Limbs that hardly bend have none, nor do arms that mostly bend backwards; for a straight
    knee the plane of shin and foot shows the axis. An ankle has the axis of its knee.
    """
    axes: dict[int, Array] = {}
    forward = Directions(anatomy, motion.positions).axes[..., 2]
    for side in SIDES:
        for limb in (ARM[1:], LEG):
            ends = list(_bones_of(anatomy, side, limb))
            if len(ends) < 2:
                continue
            upper, lower, *feet = (direction(motion.positions, *bone) for bone in ends)
            across = [cross(upper, lower), *(cross(foot, lower) for foot in feet)]
            if limb != LEG and (across[0] * cross(upper, forward)).sum() < 0.0:
                continue
            for joint in [joint for joint, _ in ends[:2]] + [ends[1][1]] * (limb == LEG):
                to_joint = Rotation.from_quat(motion.world_rotations_of(joint)).inv()
                means = [to_joint.apply(each).mean(axis=0) for each in across]
                axis = next((mean for mean in means if lengths(mean) > CLEAR_BEND), None)
                if axis is not None:
                    axes[joint] = normalised(axis)
    return axes


def _medians(turns: Array) -> tuple[Array, Array]:
    """The median rotations over the frames, (joints, 3, 3), by least sum of angles, and the largest angles [rad]."""
    weights = np.ones(turns.shape[:2])
    for _ in range(ITERATIONS):
        medians = nearest_rotations(np.einsum("fj,fjab->jab", weights, turns))
        cosines = (np.einsum("fjab,jab->fj", turns, medians) - 1.0) / 2.0
        away = np.arccos(np.clip(cosines, -1.0, 1.0))
        weights = 1.0 / np.maximum(away, ALIKE)
    return medians, away.max(axis=0)


def _angles(turns: Array) -> Array:
    """The angles of rotations (..., 3, 3) [rad]."""
    return np.asarray(np.arccos(np.clip((np.trace(turns, axis1=-2, axis2=-1) - 1.0) / 2.0, -1.0, 1.0)))


def _squared(turns: Array) -> Array:
    """The rotations of joints that are built alike, (joints, 3, 3), or the rotations by right angles nearest to them if
    these are near on average.
    """
    nearest = _right_angled(turns)
    return nearest if _angles(nearest.swapaxes(-1, -2) @ turns).mean() < RIGHT_ANGLED else turns


def _right_angled(turns: Array) -> Array:
    """The rotations by right angles nearest to those of joints that are built alike, (joints, 3, 3): all permute the
    axes alike, as mirror images do, but signs may differ.
    """
    cosines = np.einsum("jab,lsab->jls", turns, RIGHT_ANGLES)
    permutation = np.argmax(cosines.max(axis=-1).sum(axis=0))
    return np.asarray(RIGHT_ANGLES[permutation, np.argmax(cosines[:, permutation], axis=-1)])
