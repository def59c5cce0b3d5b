"""A body: a skeleton with its anatomy and any motion of it, and everything derived from these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import NoneType

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import LIMBS, REGION_PARTS, SIDES, Anatomy, Regions, find_regions
from distretarget.body.axes import FOLDED, STRETCHED, Directions, axis_vector, direction, nearest_axis, upright
from distretarget.body.limbs import Legs, find_legs, foot_bone, leg_length, tree_legs
from distretarget.body.named_anatomy import find_handles
from distretarget.body.recognition import corrected_anatomy, find_anatomy, front_shown
from distretarget.body.reference_pose import FOOT_PITCH, stands_at_rest, t_pose, usual_pitch
from distretarget.body.resting import feet_at_rest
from distretarget.body.tree_repairs import JointShift, attached_limbs
from distretarget.checks import check_kind
from distretarget.errors import MotionError, name_difference
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import lowest_heights
from distretarget.numerics.time_series import Shots, find_shots
from distretarget.numerics.vectors import Array, Numbers, normalised
from distretarget.rig import CACHED_RIGS, rig_property
from distretarget.skeleton import AXES, Skeleton
from distretarget.skin.limbs import Limb

STANDS_IN_MOTION = 0.7  # the body stands along an axis if their mean cosine is larger than this [cosine] ...
UP_FROM_MOTION = 0.3  # ... or than this if the rest pose does not show the up axis [cosine]
LIES = 0.05  # a body whose lowest joint is nearer to height 0 than this may lie there [leg lengths]
RISES = 0.05  # a body that stands along an axis in more of the frames than this may lie in the others [0 to 1]
OFF_FLOOR = 0.25  # a body whose lowest joint is farther from height 0 than this is not on the floor [leg lengths]
STANDS = 0.5  # a body that stands along an axis in more of the frames than this stands along it [0 to 1]
FLOOR_FRAMES = 10.0  # in up to so many of the frames a body may leave its floor [%]
LOWEST_FRAMES = 2.0  # percentile of the lowest joint's heights that is the height of the floor [%]
BESIDE = np.cos(np.radians(45))  # arms stand beside legs if all are within this angle, and the trunk is not [cosine]
UNFOLDED = 0.6  # in a rest pose that stands, hip and ankle are at least this far apart [lengths of the leg]
FAR = 0.5  # a hips joint farther than this from the middle of the hip joints is elsewhere [leg lengths]
CLEAR_FEET = 0.3  # feet show the sides if their mean cosine with the front or back is larger than this [cosine]


@dataclass(frozen=True, eq=False)
class Pose:
    """A pose of a body, with the root at the origin."""

    rotations: Array  # (joints, 4), world rotations
    positions: Array  # (joints, 3) [file units]
    directions: Directions | None  # the directions of the body; None without an anatomy
    # (3, 3), the body's left, up and forward as columns, snapped to near axes of the file; the axes of the file without
    # an anatomy
    axes: Array

    def places(self, joints: Numbers, offsets: Array) -> Array:
        """Return positions, (n, m, 3), of points that joints, (n,), carry at rest-pose `offsets`, (n, m, 3)."""
        turns = Rotation.from_quat(self.rotations[joints]).as_matrix()
        return np.asarray(np.einsum("nij,nmj->nmi", turns, offsets) + self.positions[joints, None])


@dataclass(frozen=True, eq=False)
class Body:
    """The source or the target of a retargeting.

    Attributes:
        skeleton: the joints, with rigid bones as the motion shows them; feet and hands hang from shin and forearm, even
            if they do not in the file.
        anatomy: the joint of each role; None where no human body is recognised.
        motion: any motion of the body, with at least one frame; None where there is none.
        known_up: which of `AXES` points up, if the caller knows; None to let `up` find it.
        standing: (joints, 4), the world rotations of a standing pose, if the caller knows one.
    """

    skeleton: Skeleton
    anatomy: Anatomy | None
    motion: Motion | None = None
    known_up: str | None = None
    standing: Array | None = None

    def __repr__(self) -> str:
        recognised = f"recognised by {self.anatomy.method}" if self.anatomy else "not recognised as human"
        return f"<Body of {len(self.skeleton)} joints, {recognised}>"

    @classmethod
    def of(cls, skeleton: Skeleton, motion: Motion | None = None) -> Body:
        """Return the body of a skeleton, recognised by the names of its joints and by its shape (`find_anatomy`);
        where the geometry contradicts the names, it decides.

        `motion`, any motion of these joints, may show more than the rest pose: shape, axes and bends of limbs.
        """
        check_kind("skeleton", skeleton, Skeleton)
        check_kind("motion", motion, Motion, NoneType)
        moving = motion if motion is not None and len(motion) else None
        tree = attached_limbs(skeleton, moving)
        if tree and tree.in_order:
            moving = moving and tree.motion(moving)
            skeleton = moving.rigid_skeleton if moving else tree.skeleton
        positions = None if moving is None else moving.positions
        body = cls(skeleton, find_anatomy(skeleton, positions), moving)
        stands = body.at_rest if body.stands_at_rest else body.in_motion
        if body.anatomy is None or body.anatomy.method == "humanoid" or stands is None:
            return body
        shown = corrected_anatomy(skeleton, body.anatomy, stands.positions)
        return body if shown is body.anatomy else replace(body, anatomy=shown)

    @classmethod
    def of_motion(cls, motion: Motion) -> Body:
        """Return the body that moves in a motion, with the bone lengths that its frames show."""
        check_kind("motion", motion, Motion)
        return cls.of(motion.rigid_skeleton, motion)

    @cached_property
    def rig(self) -> Body | None:
        """The body without its motion, one object for all bodies with equal skeletons, if the rest pose or `standing`
        shows how it stands; else the body itself, or None if it has a motion. The rig's `up` may differ.
        """
        if self.anatomy is not None:
            rig = _rig(self.skeleton, self.anatomy, None if self.standing is None else self.standing.tobytes())
            if rig.stands:
                return rig
        return None if self.motion else self

    # ---- limbs and size

    @property
    def roles(self) -> Mapping[str, int]:
        """The joint of each role; none without an anatomy."""
        return self.anatomy.roles if self.anatomy else {}

    @rig_property
    def legs(self) -> Legs | None:
        """The two legs; None where the body has none, or they have no length."""
        legs = find_legs(self.skeleton, self.anatomy)
        return legs if legs and leg_length(self.skeleton, legs) > 0.0 else None

    @rig_property
    def limbs(self) -> tuple[Limb, ...]:
        """The limbs whose three joints are known, arms before legs, left before right; none without an anatomy."""
        own = self.roles
        known = (roles for roles in LIMBS if own.keys() >= {*roles})
        return tuple(Limb(own[top], own[middle], own[end], "Hand" in end) for top, middle, end in known)

    @property
    def arms(self) -> tuple[Limb, ...]:
        """Those of the `limbs` that are arms."""
        return tuple(limb for limb in self.limbs if limb.is_arm)

    @rig_property
    def leg_length(self) -> float:
        """Length of thigh and shin, the mean of both legs [file units]; 0 without legs."""
        return leg_length(self.skeleton, self.legs) if self.legs else 0.0

    @rig_property
    def unit(self) -> float:
        """The body unit [file units]: two legs, or the height if that is more; without legs the longest path."""
        return max(2.0 * self.leg_length, self.height) if self.legs else self.skeleton.longest_path

    @rig_property
    def leg(self) -> float:
        """The length of a leg, or half the body unit where there is none [file units]."""
        return self.leg_length or 0.5 * self.unit

    @rig_property
    def height(self) -> float:
        """The vertical extent of the standing body without its arms; without an anatomy its extent along the legs,
        without legs its largest extent [file units].
        """
        of_body, rest = self.regions.of_joint >= 0, self.skeleton.rest_positions
        for arm in self.arms:
            of_body[[*self.skeleton.subtree(arm.top)]] = False
        if self.legs is None:
            return float(np.ptp(rest[of_body], axis=0).max())
        if self.at_rest and self.stands_at_rest:
            return float(np.ptp(rest[of_body] @ self.at_rest.vertical))
        if self.anatomy is None:
            return float(np.ptp(rest[of_body] @ axis_vector(_axis_of_legs(self.legs, rest[None]))))
        return float(np.ptp(self.reference.positions[of_body] @ self.reference.axes[:, 1]))

    @rig_property
    def pelvis_joint(self) -> int | None:
        """The joint where the legs branch off; None without legs."""
        return self.skeleton.common_ancestor(leg.hip for leg in self.legs) if self.legs else None

    @rig_property
    def above_hips(self) -> tuple[int, ...]:
        """The joints above hips and legs, such as a root on the floor: they carry the body and are no part of it."""
        hips = self.anatomy.roles.get("hips") if self.anatomy else None
        tops = [joint for joint in (hips, self.pelvis_joint) if joint is not None]
        return tuple(self.skeleton.to_root(min(tops))[1:]) if tops else ()

    @rig_property
    def regions(self) -> Regions:
        """The regions of the body."""
        return find_regions(self.skeleton, self.anatomy, self.above_hips)

    def joint_of(self, part: str) -> int | None:
        """Return the joint of a part of the body: the joint with this key, the upper joint of a limb such as "left
        forearm", or the first joint of a region; None if there is none.
        """
        if part in self.skeleton.keys:
            return self.skeleton.keys.index(part)
        side, _, limb = part.partition(" ")
        role = "UpperLeg" if limb == "thigh" else REGION_PARTS.get(limb, ("",))[0]
        if (joint := self.roles.get(f"{side}{role}")) is not None:
            return joint
        names, of_joint = self.regions.names, self.regions.of_joint
        return int((of_joint == names.index(part)).argmax()) if part in names else None

    @rig_property
    def handles(self) -> dict[int, int]:
        """The joint whose position and rotation each IK handle copies, by handle."""
        return find_handles(self.skeleton, self.anatomy, self.regions)

    # ---- how the body stands

    @rig_property
    def at_rest(self) -> Directions | None:
        """The directions of the rest pose; None without an anatomy."""
        return Directions(self.anatomy, self.skeleton.rest_positions) if self.anatomy else None

    @cached_property
    def in_motion(self) -> Directions | None:
        """The directions of the body in each frame of its motion; None without an anatomy or a motion."""
        return Directions(self.anatomy, self.motion.positions) if self.anatomy and self.motion else None

    @rig_property
    def stands_at_rest(self) -> bool:
        """Whether a person can stand in the rest pose; false without an anatomy."""
        return self.at_rest is not None and stands_at_rest(self.at_rest) and not self._is_folded

    @property
    def _is_folded(self) -> bool:
        """Whether a leg is folded at rest, as where its joints have axes of their own."""
        x, paths = self.skeleton.rest_positions, self.skeleton.paths_from
        ends = [(leg.hip, leg.ankle) for leg in self.legs or ()]
        return any(np.linalg.norm(x[ankle] - x[hip]) < UNFOLDED * paths(hip)[ankle] for hip, ankle in ends)

    @property
    def stands(self) -> bool:
        """Whether the rest pose or `standing` shows how the body stands."""
        return self.stands_at_rest or self.standing is not None

    @rig_property
    def up_at_rest(self) -> str | None:
        """Which of `AXES` points up in the rest pose; None where a person cannot stand in it."""
        return nearest_axis(self.at_rest.up)[0] if self.at_rest and self.stands_at_rest else None

    @cached_property
    def up_in_motion(self) -> str | None:
        """Which of `AXES` points up in the motion; None where neither the motion nor the rest pose shows it.

        Normally the rest pose decides, so that a body may lie down in the motion. The motion decides if the body stands
        along another axis in it, with its feet at height 0, and neither lies nor sometimes stands at height 0 along the
        rest pose's axis. If the body stands along neither axis, the axis is the normal of the floor at height 0 on
        which it moves.
        """
        if self.motion is None:
            return None
        if self.in_motion is None:
            return _axis_of_legs(self.legs, self.motion.positions) if self.legs else None
        axis, cosine = nearest_axis(self.in_motion.up.mean(axis=0))
        if self.up_at_rest is None:
            return None if cosine < UP_FROM_MOTION else axis
        if self.up_at_rest == axis:
            return axis
        off, off_at_rest = (abs(self.lowest(axis_vector(each))) for each in (axis, self.up_at_rest))
        stands, rises = self._share_along(axis) > STANDS, self._share_along(self.up_at_rest) > RISES
        lies = off_at_rest < (OFF_FLOOR if rises else LIES) * self.leg_length
        stands = (stands or cosine > STANDS_IN_MOTION) and off < OFF_FLOOR * self.leg_length
        up = axis if stands and not lies else self.up_at_rest
        travels = np.ptp(self.motion.positions[:, self.roles["hips"]], axis=0).max() > self.leg_length
        floors = [*filter(self._has_floor, AXES)] if travels and self._share_along(up) < RISES else ()
        return floors[0] if len(floors) == 1 else up

    def _share_along(self, axis: str) -> float:
        """The share of the frames in which the body stands along one of `AXES`."""
        return float((self.in_motion.up @ axis_vector(axis) > STANDS_IN_MOTION).mean()) if self.in_motion else 0.0

    def _has_floor(self, axis: str) -> bool:
        """Whether the lowest joint along one of `AXES` is near height 0 all the time."""
        heights = lowest_heights(self.motion.positions, axis_vector(axis)) if self.motion else np.full(1, np.inf)
        low, high = np.percentile(heights, [LOWEST_FRAMES, 100.0 - FLOOR_FRAMES])
        return bool(max(abs(low), abs(high)) < LIES * self.leg_length)

    @cached_property
    def up(self) -> str:
        """Which of `AXES` points up, by the caller, the file, the motion or the rest pose, in this order; else Y."""
        return self.known_up or self.skeleton.up or self.up_in_motion or self.up_at_rest or "Y"

    @cached_property
    def up_vector(self) -> Array:
        """(3,), the unit vector up."""
        return axis_vector(self.up)

    def lowest(self, up: Array) -> float:
        """Return a low percentile of the lowest joint's heights along `up`, (3,); 0 without a motion [file units]."""
        heights = lowest_heights(self.motion.positions, up) if self.motion else np.zeros(1)
        return float(np.percentile(heights, LOWEST_FRAMES))

    def shots_of(self, motion: Motion) -> Shots:
        """Return the shot of each frame of a motion of the body, (frames,), as `find_shots`."""
        return self._own_shots if motion is self.motion else self._find_shots(motion)

    @cached_property
    def _own_shots(self) -> Shots:
        return self._find_shots(self.motion) if self.motion else np.zeros(0, np.intp)

    def _find_shots(self, motion: Motion) -> Shots:
        joints = np.flatnonzero(self.regions.of_joint >= 0)
        return find_shots(motion.positions, joints, self.leg, motion.frame_time)

    @rig_property
    def rest(self) -> Pose:
        """The rest pose."""
        return self._pose(self.skeleton.rest_rotations)

    @rig_property
    def reference(self) -> Pose:
        """The pose in which the body is aligned with another: `standing` if known, else the rest pose if a person can
        stand in it, else a T-pose with Y up that faces Z.
        """
        if self.standing is not None:
            return self._pose(self.standing)
        if self.at_rest is None or self.stands_at_rest:
            return self.rest
        rotations = t_pose(self.skeleton, self.at_rest, self.motion, self.foot_pitch or FOOT_PITCH)
        return replace(self._pose(rotations), axes=np.eye(3))

    @cached_property
    def foot_pitch(self) -> float | None:
        """The downward pitch of flat feet, from feet that rest in the motion [rad]; None if none rests."""
        if self.motion is None or self.legs is None:
            return None
        feet = [leg for leg in self.legs if leg.toe != leg.ankle]
        x, up = self.motion.positions, self.up_vector
        resting = [feet_at_rest(self.motion, leg, up, self.leg_length).all(axis=1) for leg in feet]
        bones = [direction(x[rests], leg.ankle, leg.toe) for leg, rests in zip(feet, resting, strict=True)]
        return usual_pitch(-np.arcsin(np.clip(np.concatenate(bones) @ up, -1.0, 1.0))) if any(map(len, bones)) else None

    @rig_property
    def hanging(self) -> Array:
        """(joints, 3), joint positions in the reference pose with arms hanging [file units]."""
        places, up = np.array(self.reference.positions), self.reference.axes[:, 1]
        for arm in self.arms:
            below = self.skeleton.subtree(arm.top)
            places[below] = places[arm.top] - np.outer(self.skeleton.paths_from(arm.top)[below], up)
        return places

    def _pose(self, rotations: Array) -> Pose:
        positions = self.skeleton.posed(rotations)
        directions = Directions(self.anatomy, positions) if self.anatomy else None
        if directions is None:
            return Pose(rotations, positions, None, np.eye(3))
        axes = directions.standing_axes if self.stands_at_rest else upright(directions.axes)
        return Pose(rotations, positions, directions, axes)

    # ---- what kind of body it is

    @cached_property
    def left_is_left(self) -> bool | None:
        """Whether the joints named left are on the left side of the body; None if unclear. Its front is where the feet
        point, at rest if it stands there, else in motion; or without feet the knees, in motion or else at rest.
        """
        if self.anatomy is None:
            return None
        has_feet = all(foot_bone(self.skeleton, self.anatomy, side) for side in SIDES)
        shown = self.in_motion if has_feet else self.in_motion or self.at_rest
        shown = self.at_rest if has_feet and self.stands_at_rest else shown
        if shown is None:
            return None
        ahead = front_shown(self.skeleton, self.anatomy, shown.positions.reshape(-1, len(self.skeleton), 3))
        ahead = ahead if has_feet else normalised(ahead)
        cosine = float((shown.axes[..., 2] * ahead).sum(axis=-1).mean())
        return cosine > 0 if abs(cosine) > CLEAR_FEET else None

    @cached_property
    def on_all_fours(self) -> bool:
        """Whether the body seems to go on all fours: trunk and legs never stretch out, at rest or in motion."""
        if self.at_rest is None:
            return False
        if not self.at_rest.is_whole:
            return self._stands_on_arms
        if self.at_rest.stretch > STRETCHED:
            return False
        if self.in_motion is None:
            return bool(self.at_rest.stretch > FOLDED)
        return bool(np.percentile(self.in_motion.stretch, 99) < STRETCHED)

    @property
    def _stands_on_arms(self) -> bool:
        """Whether the arms of a body whose legs have no names stand beside its legs at rest, across the trunk."""
        anatomy, legs = self.anatomy, tree_legs(self.skeleton)
        arms = [anatomy.joints(f"{side}UpperArm", f"{side}LowerArm") for side in SIDES] if anatomy else []
        if (
            legs is None
            or not all(len(arm) == 2 for arm in arms)
            or {leg.hip for leg in legs} & {arm[0] for arm in arms}
        ):
            return False
        x = self.skeleton.rest_positions
        limbs = np.array([direction(x, *arm) for arm in arms] + [direction(x, leg.hip, leg.ankle) for leg in legs])
        trunk = normalised(x[[arm[0] for arm in arms]].mean(axis=0) - x[[leg.hip for leg in legs]].mean(axis=0))
        return bool((limbs @ limbs.T).min() > BESIDE and np.abs(limbs @ trunk).max() < BESIDE)

    # ---- other versions of the body

    @property
    def shift_to_thighs(self) -> JointShift | None:
        """The displacement of the hips joint to the middle of the hip joints; None if it is near already, as in most
        files, or if the thighs do not hang from it.
        """
        if self.legs is None or "hips" not in self.roles:
            return None
        hips, thighs, rest = self.roles["hips"], [leg.hip for leg in self.legs], self.skeleton.rest_positions
        shift = rest[thighs].mean(axis=0) - rest[hips]
        hang = self.skeleton.common_ancestor(thighs) == hips
        return JointShift(hips, shift) if hang and np.linalg.norm(shift) > FAR * self.leg_length else None

    @property
    def with_hips_at_thighs(self) -> Body:
        """The body with its hips joint displaced by `shift_to_thighs`."""
        shift = self.shift_to_thighs
        if shift is None:
            return self
        return Body.of_motion(shift.motion(self.motion)) if self.motion else Body.of(shift.skeleton(self.skeleton))

    @property
    def mirrored(self) -> Body:
        """The same body with left and right exchanged in its anatomy."""
        own = self.anatomy
        anatomy = own and replace(own.mirrored, swapped_sides="" if own.swapped_sides else "sides")
        return replace(self, anatomy=anatomy)

    def standing_as(self, rest: Motion) -> Body:
        """Return the same body with the first frame of another motion of its joints as its `standing` pose.

        Raises:
            MotionError: the motion has no frames, or other joints, or nobody can stand in its first frame.
        """
        check_kind("rest", rest, Motion)
        if not len(rest):
            raise MotionError("the given rest pose has no frames")
        keys, others = ({skeleton.keys[j] for j in skeleton.joints} for skeleton in (self.skeleton, rest.skeleton))
        if keys != others:
            raise MotionError(f"the given rest pose has other joints than the source: {name_difference(others, keys)}")
        world = np.tile(self.skeleton.rest_rotations, (1, 1, 1))
        for joint in self.skeleton.joints:
            world[0, joint] = rest.rotations[0, rest.skeleton.index(self.skeleton.keys[joint])]
        posed = Motion(self.skeleton, np.zeros((1, 3)), world, rest.frame_time_text)
        if self.anatomy is None or not stands_at_rest(Directions(self.anatomy, posed.positions[0])):
            raise MotionError("nobody can stand in the given rest pose; expected T-pose, A-pose or hanging arms")
        return replace(self, standing=np.asarray(posed.world_rotations[0]))

    def with_motion(self, motion: Motion, up: str) -> Body:
        """Return the same body in another motion, in which the axis `up` points up."""
        return self.with_up(up) if motion is self.motion else replace(self, motion=motion, known_up=up)

    def with_up(self, up: str) -> Body:
        """Return the same body with the axis `up` known to point up."""
        return self if up == self.up else replace(self, known_up=up)


@lru_cache(maxsize=CACHED_RIGS)
def _rig(skeleton: Skeleton, anatomy: Anatomy, standing: bytes | None) -> Body:
    """The body without a motion, with a `standing` pose if given."""
    rotations = None if standing is None else np.frombuffer(standing).reshape(-1, 4)
    rig = Body(skeleton, anatomy, standing=rotations)
    vars(rig)["rig"] = rig  # fill the cached property
    return rig


def _axis_of_legs(legs: Legs, positions: Array) -> str:
    """Which of `AXES` is nearest to the mean direction from ankles to hips, over positions (frames, joints, 3)."""
    hips, ankles, _ = (positions[:, joints] for joints in zip(*(leg.joints for leg in legs), strict=True))
    return nearest_axis((hips - ankles).mean(axis=(0, 1)))[0]
