"""What rests on the world in a source, feet and other joints: whether it slides in a result or leaves its height.

All is found from positions alone. Heights are compared in leg lengths of each body. A foot is compared with how the
target's own foot stands on its flat sole, so that a foot of another build is not an error. Where the target's feet have
a mesh, its lowest vertices are their soles, and belong at the mean height of the source's sole over a rest, on a level
floor (`level_on_floor`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from distretarget.body.anatomy import TRUNK_REGIONS
from distretarget.body.body import Body
from distretarget.body.limbs import Leg
from distretarget.body.soles import Sole, floor_height, level_on_floor
from distretarget.matching.matching import Matching, by_soles
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of, lowest_heights, speeds_along
from distretarget.numerics.moving import largest
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.time_series import over_runs
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level

SLOW = 0.35  # a joint that rests on the floor is slower than this [leg lengths / s] ...
LOW_FOOT = 0.06  # ... and if it is a foot's, within this [leg lengths] of its lowest heights,
LOWEST = 2.0  # which is this percentile of them [%];
LOW = 0.1  # other joints are no higher than this above the lowest joint [leg lengths]
FLAT = 5.0  # a foot within this of the pitch of its flat sole stands flat [degrees]
LEVEL = 0.5  # a sole stands on the floor, not on the tip or the back of the foot, if it is nearer to level [cosine]
HOLD = 1.0  # a hand or head that holds on to something stays in its place for this long [s],
PLACE = 0.02  # which is no larger than this [leg lengths],
SWAY = 8.0  # while the joint where its limb begins goes this many times as far, and ...
FARTHER = 0.04  # ... this much farther [leg lengths]
BETWEEN = 0.5  # the body takes about this long from its feet to other supports [s]
ENDS = ("left hand", "right hand", "head")  # the regions that hold on to something


@dataclass(frozen=True, eq=False)
class FlatFoot:
    """A foot, and how it stands on its flat sole."""

    leg: Leg
    points: Numbers  # (points,), the ankle and all joints below it; only the ankle if there is no toe
    flat_pitch: float = np.nan  # elevation of the bone from ankle to toe on the flat sole [degrees]; nan if unknown
    flat_height: float = np.nan  # of the ankle over the lowest point on the flat sole [file units]; nan if unknown
    normal: Array | None = None  # (3,), the unit vector up from the flat sole in the ankle's axes; None if unknown

    @classmethod
    def of(cls, body: Body, leg: Leg, sole: Sole) -> FlatFoot:
        """Return the foot of a leg: on its flat sole as in the rest pose if a person can stand in that pose and the
        foot does not hang there, else as the motion shows.
        """
        toe = np.flatnonzero(sole.joints == leg.toe)
        bone = np.linalg.norm(body.reference.positions[leg.toe] - body.reference.positions[leg.ankle])
        if not (len(toe) and bone and sole.known):
            return cls(leg, sole.joints)
        sine = (sole.heights[toe[0]] - sole.ankle) / bone
        pitch = float(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))
        return cls(leg, sole.joints, pitch, sole.ankle, sole.normal)

    def over_time(self, motion: Motion, hips: Array, up: Array) -> Array:
        """(5, frames), the foot's `_FootTracks` but the first, heights in file units; nan what is unknown. `hips`,
        (frames, 3), is the middle of the hip joints, `up`, (3,), the unit vector up.
        """
        ankle, normals = motion.positions[:, self.leg.ankle], np.full((len(motion), 3), np.nan)
        if self.normal is not None:
            normals = turned_by(motion.world_rotations_of(self.leg.ankle), self.normal)
        heel, bone = ankle - self.flat_height * normals, motion.positions[:, self.leg.toe] - ankle
        length = lengths(bone)
        sine = np.divide(bone @ up, length, out=np.full_like(length, np.nan), where=length > 0)
        pitch = np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0)))
        lowest = np.fmin(lowest_heights(motion.positions, up, self.points), heel @ up)
        over_sole = ankle @ up - self.flat_height
        return np.stack([lowest, normals @ up, pitch - self.flat_pitch, over_sole, (hips - ankle) @ up])


@dataclass(frozen=True, eq=False, kw_only=True)
class Feet:
    """The feet of a result against those of its source. Arrays have no columns if the bodies have no legs; errors are
    nan in frames in which nothing is to be measured.
    """

    joints: Numbers  # (foot joints,), the target's left ankle and toe, then the right ones
    stance: Flags  # (frames, foot joints), whether each foot joint of the source rests
    skate_source: Array  # (frames, foot joints), horizontal speed [leg lengths / s]
    skate: Array  # the same of the result
    foot_height: Array  # (frames, legs), of the sole while ankle or toe rests [% of leg length]
    foot_pitch: Array  # (frames, legs), from the flat sole, while ankle and toe rest and the sole is down [degrees]
    ankle_height: Array  # (frames, legs), over the source's floor, while the foot rests flat [% of leg length]
    hips_height: Array  # (frames, legs), over a resting ankle, while only feet carry the body [% of leg length]


@dataclass(frozen=True, eq=False)
class _FootTracks:
    """The feet of one body over time."""

    skate: Array  # (frames, foot joints), horizontal speed [leg lengths / s]
    sole: Array  # (frames, legs), the height of the lowest joint of the foot or of the heel [leg lengths]
    level: Flags  # (frames, legs), whether the sole, not the tip or the back of the foot, faces the floor
    pitch: Array  # (frames, legs), of the foot from its flat sole [degrees]
    flat_ankle: Array  # (frames, legs), the height of the ankle less that over a flat sole [leg lengths]
    hips: Array  # (frames, legs), the height of the middle of the hip joints over the ankle [leg lengths]

    @classmethod
    def of(cls, motion: Motion, feet: Sequence[FlatFoot], length: float, up: Array) -> _FootTracks:
        """Follow the feet of a motion, on legs of this length [file units]."""
        hips = motion.positions[:, [foot.leg.hip for foot in feet]].mean(axis=1) if feet else np.zeros((len(motion), 3))
        tracks = np.reshape([foot.over_time(motion, hips, up) for foot in feet], (len(feet), 5, len(motion)))
        sole, level_by, pitch, flat_ankle, over_ankle = tracks.transpose(1, 2, 0)
        skate = speeds_along(level(_foot_paths(motion, feet, length), up), motion.frame_time)
        return cls(skate, sole / length, ~(level_by < LEVEL), pitch, flat_ankle / length, over_ankle / length)


@dataclass(frozen=True, eq=False, kw_only=True)
class SourceFeet:
    """The feet of a source, which those of results are measured against."""

    up: Array  # (3,), the unit vector up in source and results
    feet: Sequence[FlatFoot]  # the target's
    leg: float  # the length of the target's legs [file units]
    stance: Flags  # as in `Feet`
    tracks: _FootTracks  # of the source
    belongs: Array  # (frames, legs), the height at which the sole belongs [leg lengths]
    undersides: Undersides | None  # the skins of source and target; None if no mesh shows the target's feet

    def in_result(self, result: Motion, others_carry: Flags) -> Feet:
        """Measure the feet of a result; `others_carry`, (frames,), is whether other joints carry the body as well."""
        ankle_rests, toe_rests = self.stance[:, ::2], self.stance[:, 1::2]
        source, own = self.tracks, _FootTracks.of(result, self.feet, self.leg, self.up)
        sole = own.sole
        if self.undersides is not None:  # of the lowest vertices, less what is below a flat foot
            lowest = [self.undersides.target.lowest_of_foot(result, foot.leg.ankle, self.up) for foot in self.feet]
            sole = (np.stack(lowest, axis=1) + self.undersides.soles[1]) / self.leg
        on_sole = ankle_rests & toe_rests & source.level
        flat = on_sole & (np.abs(source.pitch) <= FLAT)
        alone = ankle_rests & ~others_carry[:, None]
        return Feet(
            joints=_foot_joints(self.feet),
            stance=self.stance,
            skate_source=source.skate,
            skate=own.skate,
            foot_height=np.where(ankle_rests | toe_rests, 100 * np.abs(sole - self.belongs), np.nan),
            foot_pitch=np.where(on_sole, np.abs(own.pitch - source.pitch), np.nan),
            ankle_height=np.where(flat, 100 * np.abs(own.flat_ankle - self.belongs), np.nan),
            hips_height=np.where(alone, 100 * np.abs(own.hips - source.hips), np.nan),
        )


def find_feet(source: Motion, matching: Matching, up: Array, undersides: Undersides | None = None) -> SourceFeet:
    """Measure the feet of a source; `up`, (3,), is the unit vector up in source and results, `undersides` are the skins
    of both bodies, if known.
    """
    on_mesh = undersides if undersides is not None and undersides.feet_have_mesh else None
    source_feet, feet = _flat_feet(matching)
    length, target_length = matching.leg_lengths
    stance, tracks = _stance(source, source_feet, length, up), _FootTracks.of(source, source_feet, length, up)
    return SourceFeet(
        up=up,
        feet=feet,
        leg=target_length,
        stance=stance,
        tracks=tracks,
        belongs=tracks.sole if on_mesh is None else _on_floor(tracks.sole, stance[:, ::2] | stance[:, 1::2]),
        undersides=on_mesh,
    )


@by_soles
def _flat_feet(matching: Matching) -> tuple[Sequence[FlatFoot], Sequence[FlatFoot]]:
    """The feet of source and target."""
    legs = zip(*matching.legs, matching.soles, strict=True) if matching.legs else ()
    both = [
        (FlatFoot.of(matching.source, one, sole), FlatFoot.of(matching.target, other, own_sole))
        for one, other, (sole, own_sole) in legs
    ]
    source_feet, feet = zip(*both, strict=True) if both else ((), ())
    return source_feet, feet


def _on_floor(soles: Array, rests: Flags) -> Array:
    """(frames, legs), the heights at which soles belong that rest, or not, at these heights in the source."""
    if not rests.any():
        return soles
    means = [over_runs(sole[:, None], rest.astype(float))[:, 0] for sole, rest in zip(soles.T, rests.T, strict=True)]
    return level_on_floor(np.stack(means, axis=1), floor_height(soles, rests), rests, 1.0)


def _stance(motion: Motion, feet: Sequence[FlatFoot], length: float, up: Array) -> Flags:
    """(frames, foot joints), whether each foot joint rests: it is slow, and near its lowest heights."""
    paths = _foot_paths(motion, feet, length)
    heights = paths @ up
    low = heights - np.percentile(heights, LOWEST, axis=0) < LOW_FOOT
    return np.asarray(low & (speeds_along(paths, motion.frame_time) < SLOW))


def _foot_paths(motion: Motion, feet: Sequence[FlatFoot], length: float) -> Array:
    """(frames, foot joints, 3), positions of the foot joints [leg lengths]."""
    return motion.positions[:, _foot_joints(feet)] / length


def _foot_joints(feet: Sequence[FlatFoot]) -> Numbers:
    """Ankle and toe of each foot in turn."""
    return np.array([joint for foot in feet for joint in (foot.leg.ankle, foot.leg.toe)], np.intp)


@dataclass(frozen=True, eq=False, kw_only=True)
class SupportsMeasured:
    """The joints that rest on the world in a source, apart from feet, and how they do so in a result."""

    joints: Numbers  # (joints,), of the target, that rest in some frame of the source
    on_floor: Flags  # (frames, joints), whether each rests on the floor in the source
    holds: Flags  # (frames, joints), whether each holds on to something that stands still
    skate_source: Array  # (frames, joints), horizontal speed in the source [leg lengths / s]
    skate: Array  # the same in the result
    height: Array  # (frames, joints), error of the height in the result [% of leg length]
    height_source: Array  # (frames, joints), over the origin [leg lengths]
    skin_source: Array  # (frames, joints), how far the skin reaches below each, less than below soles [leg lengths]
    up: Array  # (3,), the unit vector up
    leg: float  # the length of the target's leg [file units]; 1 without legs
    undersides: Undersides | None  # the skins of source and target; None if they are not known, or without legs

    @property
    def rest(self) -> Flags:
        """(frames, joints), whether each rests on the floor or on something else."""
        return self.on_floor | self.holds

    def carry(self, frame_time: float) -> Flags:
        """(frames,), whether they carry part of the body: one of them rests within `BETWEEN` before or after."""
        rests = np.asarray(self.rest.any(axis=1))
        reach = int(min(BETWEEN / frame_time, len(rests)))
        return largest(rests[:, None].astype(np.float64), reach)[:, 0] > 0

    def in_result(self, result: Motion) -> SupportsMeasured:
        """The same joints, measured in a result.

        Where the skin is known, a height is right between the source's and the one at which the skin below the joint
        is as high over the floor as the source's.
        """
        paths = result.positions[:, self.joints] / self.leg
        skate = speeds_along(level(paths, self.up), result.frame_time)
        off = paths @ self.up - self.height_source
        if self.undersides is not None:
            below = self.undersides.target.below(result, self.joints, self.up) - self.undersides.soles[1]
            thicker = below / self.leg - self.skin_source
            off -= np.clip(off, np.minimum(thicker, 0.0), np.maximum(thicker, 0.0)) * self.on_floor
        return replace(self, skate=skate, height=100.0 * np.abs(off))


def find_supports(
    source: Motion, matching: Matching, up: Array, undersides: Undersides | None = None
) -> SupportsMeasured:
    """Find the joints that rest in a source, which is its own result until `in_result`; arguments as in `find_feet`."""
    joints = matching.joints_but_feet()
    drivers = matching.drivers[joints]
    source_leg, leg = matching.leg_lengths if matching.legs else (1.0, 1.0)
    height = heights_of(source.positions, drivers, up) / source_leg
    low = height - lowest_heights(source.positions, up)[:, None] / source_leg < LOW
    on_floor = low & (speeds_along(source.positions, source.frame_time, drivers) < SLOW * source_leg)
    holds = _holds(source, matching, joints, source_leg) & ~on_floor
    some = (on_floor | holds).any(axis=0)
    skate = speeds_along(level(source.positions[:, drivers[some]] / source_leg, up), source.frame_time)
    known, skin = undersides if matching.legs else None, np.zeros_like(skate)
    if known is not None:
        skin = (known.source.below(source, drivers[some], up) - known.soles[0]) / source_leg
    return SupportsMeasured(
        joints=joints[some],
        on_floor=on_floor[:, some],
        holds=holds[:, some],
        skate_source=skate,
        skate=skate,
        height=np.zeros_like(skate),
        height_source=height[:, some],
        skin_source=skin,
        up=up,
        leg=leg,
        undersides=known,
    )


def _holds(source: Motion, matching: Matching, joints: Numbers, leg: float) -> Flags:
    """(frames, joints), whether each keeps its place while the base of its limb moves."""
    names, of_joint, drivers = matching.regions.names, matching.regions.of_joint, matching.drivers
    reach = max(int(min(0.5 * HOLD / source.frame_time, len(source))), 1)
    holds = np.zeros((len(source), len(joints)), bool)

    def ways_of(some: Numbers) -> Array:
        """(frames, some), the diagonal of the box that each joint's path fills within `reach` frames on each side."""
        paths = source.positions[:, drivers[some]] / leg
        return lengths(largest(paths, reach) + largest(-paths, reach))

    def base_of(joint: int) -> int:
        above = [each for each in matching.target.skeleton.line(joint) if drivers[each] >= 0]
        return next((each for each in above if names[of_joint[each]] in TRUNK_REGIONS), joint)

    ends = np.flatnonzero([names[region] in ENDS for region in of_joint[joints].tolist()])
    ways = ways_of(joints[ends])
    stay = ways < PLACE
    some = stay.any(axis=0)
    bases, at = np.unique([base_of(joint) for joint in joints[ends[some]].tolist()], return_inverse=True)
    holds[:, ends[some]] = stay[:, some] & (ways_of(bases.astype(np.intp))[:, at] > SWAY * ways[:, some] + FARTHER)
    return holds
