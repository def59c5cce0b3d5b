"""The clip record: all that the objectives need of a source clip and its target, computed once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from distretarget.baseline.rotation_copy import RootScale, root_path, rotation_copy
from distretarget.body.anatomy import Regions
from distretarget.body.body import Body
from distretarget.body.limbs import Leg, Legs, arm_raise, in_front_or_behind
from distretarget.body.soles import Sole
from distretarget.contact_entries import DroppedContact
from distretarget.distances import DistanceProblem, distance_problem
from distretarget.ik.poses import part_of_joint
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import lowest_heights
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import Shots, by_shot, opening, widened
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.rig import rig_cached
from distretarget.skeleton import Skeleton

SWING = 1.0  # arms that swing in a slow walk are in front of the trunk, or behind it, for less than this [s]


@dataclass(frozen=True)
class LegPair:
    """A leg of the source and the leg of the target that it drives, with their soles."""

    source: Leg
    target: Leg
    source_sole: Sole
    target_sole: Sole


@dataclass(frozen=True, eq=False, kw_only=True)
class Clip:
    """A source motion, its rotation copy on the target, and how the two bodies correspond. Slicing selects frames."""

    source: Motion  # in the target's axes [source file units]
    copy: Motion  # the rotation copy [target file units]
    root: Array  # (frames, 3), the path that the root follows [target file units]
    shots: Shots  # (frames,), the number of each frame's shot; shots are separated by cuts
    scale: RootScale  # from the source's world to the target's
    up: Array  # (3,), the unit vector up in both
    unit: float  # the target's body unit [target file units]
    leg_lengths: tuple[float, float]  # of source and target [file units of each]; 0 without legs
    legs: tuple[LegPair, ...]  # both legs; none unless source and target have them
    is_person: bool  # whether the target's body is that of a person
    target_legs: Legs | None  # the target's own legs, driven or not; None where it has none
    source_skeleton: Skeleton  # the source's joints with rigid bones
    hanging: Array  # (source joints, 3), `Body.hanging` of the source [source file units]
    # (frames, source joints), how deliberately each joint of an arm is placed, 0 to 1: 1 for a hand while its arm is
    # raised or bent, and for hand and forearm in front of the trunk or behind it, if the arm is raised or they stay
    # there for longer than `SWING`; 0 for all other joints
    raised_arms: Array
    pelvis: int  # the target's joint where its legs branch off, if it has a driver; else the first that has one
    drivers: Numbers  # (joints,), the source joint that drives each target joint; -1 for none
    regions: Regions  # the target's body regions, between which self-contacts are found
    limb_joints: Numbers  # driven joints of the target's body, without the feet's; none without legs
    undriven_joints: Numbers  # undriven joints of the target's body, without the feet's; none without legs
    distances: DistanceProblem  # the points that source and target share, with their path lengths
    roots: Numbers  # (joints,), the topmost joint of the rigid part that each joint belongs to
    parts: Numbers  # (joints,), the rigid part that carries the bones below each joint
    drops: tuple[DroppedContact, ...] = ()  # contacts that the user drops
    by_skin: Flags | None = None  # (joints, joints), pairs whose contacts are found from skins; None without skin

    @classmethod
    def of(cls, matching: Matching, scale: RootScale) -> Clip:
        """Return the clip of a source matched to its target, with its root on the source's path, scaled."""
        source, body, motion = matching.source, matching.target, matching.source_motion
        copy, roots = rotation_copy(matching, scale), rigid_part_roots(matching)
        legs = zip(*matching.legs, matching.soles, strict=True) if matching.legs else ()
        return cls(
            source=motion,
            copy=copy,
            root=root_path(copy, matching, scale),
            shots=source.shots_of(motion),
            scale=scale,
            up=source.up_vector,
            unit=body.unit,
            leg_lengths=matching.leg_lengths,
            legs=tuple(LegPair(a, b, *soles) for a, b, soles in legs),
            is_person=body.anatomy is not None,
            target_legs=body.legs,
            source_skeleton=source.skeleton,
            hanging=source.hanging,
            raised_arms=raised_arms(source, motion),
            pelvis=matching.pelvis,
            drivers=matching.drivers,
            regions=matching.regions,
            limb_joints=matching.joints_but_feet(),
            undriven_joints=matching.joints_but_feet(driven=False),
            distances=_shared_distances(matching),
            roots=roots,
            parts=part_of_joint(body.skeleton, roots),
        )

    def __len__(self) -> int:
        return len(self.copy)

    def __getitem__(self, frames: slice) -> Clip:
        if frames == slice(0, len(self)):
            return self
        source, copy = self.source[frames], self.copy[frames]
        root, shots, arms = self.root[frames], self.shots[frames], self.raised_arms[frames]
        drops = tuple(replace(drop, frames=drop.frames[frames]) for drop in self.drops)
        return replace(self, source=source, copy=copy, root=root, shots=shots, raised_arms=arms, drops=drops)

    @property
    def leg(self) -> float:
        """The length of the target's leg, or half its body unit where there is none [target file units]."""
        return self.leg_lengths[1] or 0.5 * self.unit

    @property
    def skeleton(self) -> Skeleton:
        """The target's skeleton."""
        return self.copy.skeleton

    @property
    def frame_time(self) -> float:
        """The time between frames [s]."""
        return self.source.frame_time

    def raised(self, by: Array) -> Clip:
        """Return the clip with the root's path displaced by vectors (frames, 3) [target file units]."""
        return replace(self, root=self.root + by)

    def copy_on_path(self, joints: Numbers) -> Array:
        """Return the rotation copy's joints with the root on its path, (frames, joints, 3) [target file units]."""
        places = self.copy.positions_of(joints)
        places += (self.root - self.copy.root_positions)[:, None]
        return places

    def averaged(self, values: Array, time: float) -> Array:
        """Return the moving average of values, (frames, ...), over a time before and after each frame [s], by shot."""
        return by_shot(partial(averaged, reach=round(time / self.frame_time)), self.shots, values)

    def widened(self, values: Array, time: float) -> Array:
        """Return values, (frames, n), `widened` over a time before and after each frame [s], by shot."""
        return by_shot(partial(widened, frames=time / self.frame_time), self.shots, values)

    @cached_property
    def source_floor(self) -> Array:
        """(frames,), the height of the source's lowest joint [source file units]."""
        return lowest_heights(self.source.positions, self.up)

    @property
    def loose_parts(self) -> Numbers:
        """The parts without a driven joint, such as undriven fingers: only the floor moves them."""
        loose = np.ones(self.parts.max() + 1, bool)
        loose[self.parts[[*self.skeleton.with_ancestors(self.driven)]]] = False
        return np.flatnonzero(loose)

    @property
    def driven(self) -> Numbers:
        """The target's joints that have a driver."""
        return np.flatnonzero(self.drivers >= 0)


def raised_arms(body: Body, motion: Motion) -> Array:
    """Return `Clip.raised_arms` for a body in a motion."""
    x, hips, shoulders = motion.positions, [leg.hip for leg in body.legs or ()], [arm.top for arm in body.arms]
    values = np.zeros((len(motion), len(body.skeleton)))
    lasts = partial(opening, frames=SWING / motion.frame_time)
    for arm in body.arms:
        below, hand = body.skeleton.subtree(arm.top), body.skeleton.subtree(arm.end)
        values[:, below] = up = arm_raise(x, arm, hips, body.up_vector)[:, None]
        if hips and len(shoulders) == 2:
            of_hand, of_forearm = (
                in_front_or_behind(x, joints, shoulders, hips)[:, None] for joints in ([*hand], [arm.middle, arm.end])
            )
            values[:, hand] = np.maximum(up, lasts(of_hand))
            values[:, np.setdiff1d(below, hand)] = np.maximum(np.minimum(up, of_forearm), lasts(of_forearm))
    return values


@rig_cached
def _shared_distances(matching: Matching) -> DistanceProblem:
    """The distance problem of the points that both matched bodies have."""
    return distance_problem(matching.source.skeleton, matching.target.skeleton, matching.drivers)


def rigid_part_roots(matching: Matching) -> Numbers:
    """(target joints,), the topmost joint of the rigid part that each joint belongs to.

    A joint belongs to its parent's part if it has no rotation channels, or if nothing drives it, as for most twist
    joints. Every other joint is the root of a part, even if it does not turn in this motion; so is the first joint of
    an undriven finger, which bends at the floor.
    """
    skeleton, anatomy = matching.target.skeleton, matching.target.anatomy
    knuckles = anatomy.knuckles if anatomy else ()
    roots = np.arange(len(skeleton))
    for joint in range(1, len(skeleton)):
        undriven = matching.rotation_sources[joint, 0] < 0 and joint not in knuckles
        if (undriven or not skeleton.rotation_axes(joint)) and skeleton.children[joint]:
            roots[joint] = roots[skeleton.parents[joint]]
    return roots
