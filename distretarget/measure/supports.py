"""What rests on the world in a source, feet and other joints: whether it slides in a result or leaves its height.

All is found from positions alone. Heights are compared in leg lengths of each body. A foot is compared with how the
target's own foot stands on its flat sole, so that a foot of another build is not an error. Where the target's feet have
a mesh, its lowest vertices are their soles, and are right from the mean height of the source's sole over a rest to the
source's floor, if the one is near the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from distretarget.body.body import Body
from distretarget.body.limbs import Leg
from distretarget.body.segments import find_segments
from distretarget.body.soles import Sole
from distretarget.matching.matching import Matching, by_soles
from distretarget.measure.resting import NEAR, SLOW, THICK, Floor, feet_rest, find_floor, foot_joints
from distretarget.measure.surface import Surface
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of, lowest_heights, speeds_along
from distretarget.numerics.moving import largest
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.time_series import over_runs
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level
from distretarget.skin.capsules import SEGMENTS

LOW = 0.1  # joints but the feet's that rest are no higher than this above the lowest joint [leg lengths]
FLAT = 5.0  # a foot within this of the pitch of its flat sole stands flat [degrees]
LEVEL = 0.5  # a sole stands on the floor, not on the tip or the back of the foot, if it is nearer to level [cosine]
HOLD = 1.0  # a hand or head that holds on to something stays in its place for this long [s],
PLACE = 0.02  # which is no larger than this [leg lengths],
SWAY = 8.0  # while the joint where its limb begins goes this many times as far, and ...
FARTHER = 0.04  # ... this much farther [leg lengths]
SITS = 0.25  # hips that are no higher than this above the soles carry the body as well [leg lengths]
BETWEEN = 0.5  # the body takes about this long from its feet to other supports [s]
ENDS = ("left hand", "right hand", "head")  # the regions that hold on to something
BASES = ("trunk", "hips")  # the regions where their limbs begin
TRUNK = ("chest", "belly", "pelvis")  # segments that rest as one


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

    def over_time(self, motion: Motion, up: Array) -> Array:
        """(6, frames), the foot's `_FootTracks` but the first, heights in file units; nan what is unknown; `up`, (3,),
        is the unit vector up.
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
        hip = motion.positions[:, self.leg.hip]
        return np.stack([lowest, normals @ up, pitch - self.flat_pitch, over_sole, ankle @ up, hip @ up])


@dataclass(frozen=True, eq=False, kw_only=True)
class Feet:
    """The feet of a result against those of its source. Arrays have no columns if the bodies have no legs; errors are
    nan in frames in which nothing is to be measured.
    """

    joints: Numbers  # (foot joints,), the target's left ankle and toe, then the right ones
    stance: Flags  # (frames, foot joints), whether each foot joint of the source rests
    skate_source: Array  # (frames, foot joints), horizontal speed [leg lengths / s]
    skate: Array  # the same of the result
    sole: Array  # (frames, legs), the height of its lowest point, less that of a flat foot on the floor [leg lengths]
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
    ankle: Array  # (frames, legs), the height of the ankle [leg lengths]
    hip: Array  # (frames, legs), that of the leg's hip joint [leg lengths]

    @classmethod
    def of(cls, motion: Motion, feet: Sequence[FlatFoot], length: float, up: Array) -> _FootTracks:
        """Follow the feet of a motion, on legs of this length [file units]."""
        tracks = np.reshape([foot.over_time(motion, up) for foot in feet], (len(feet), 6, len(motion)))
        sole, level_by, pitch, flat_ankle, ankle, hip = tracks.transpose(1, 2, 0)
        paths = motion.positions[:, foot_joints([foot.leg for foot in feet])] / length
        skate = speeds_along(level(paths, up), motion.frame_time)
        level_sole, heights = ~(level_by < LEVEL), (each / length for each in (flat_ankle, ankle, hip))
        return cls(skate, sole / length, level_sole, pitch, *heights)

    def hips_over(self, rests: Flags) -> Array:
        """(frames, legs), how high the hips are over each ankle [leg lengths]: the middle of the hip joints of the legs
        that stand on the feet that rest, (frames, legs). Where the pelvis tilts on one leg, wide hips are as high as
        narrow ones by the hip joint of that leg.
        """
        standing = rests.sum(axis=1, keepdims=True)
        return np.asarray((rests * self.hip).sum(axis=1, keepdims=True) / np.maximum(standing, 1) - self.ankle)


@dataclass(frozen=True, eq=False, kw_only=True)
class SourceFeet:
    """The feet of a source, which those of results are measured against."""

    up: Array  # (3,), the unit vector up in source and results
    feet: Sequence[FlatFoot]  # the target's
    leg: float  # the length of the target's legs [file units]
    stance: Flags  # as in `Feet`
    tracks: _FootTracks  # of the source
    floor: Floor  # the source's
    belongs: Array  # (frames, legs), the height of the sole; its mean over a rest if meshes are compared [leg lengths]
    surface: Surface | None  # the target's; None if no mesh shows its feet
    thickness: float  # how far that is below the lowest joint of a foot that stands flat [leg lengths]

    def in_result(self, result: Motion, others_carry: Flags) -> Feet:
        """Measure the feet of a result; `others_carry`, (frames,), is whether other joints carry the body as well."""
        ankle_rests, toe_rests = self.stance[:, ::2], self.stance[:, 1::2]
        source, own = self.tracks, _FootTracks.of(result, self.feet, self.leg, self.up)
        sole, off = own.sole, own.sole - self.belongs
        if self.surface is not None:
            feet = [result.skeleton.subtree_at(foot.leg.ankle) for foot in self.feet]
            lowest = [self.surface.lowest(result, foot, self.up) for foot in feet]
            sole = np.stack(lowest, axis=1) / self.leg + self.thickness
            off = self.floor.off(sole, self.belongs)
        on_sole = ankle_rests & toe_rests & source.level
        flat = on_sole & (np.abs(source.pitch) <= FLAT)
        sits = (source.hip < source.sole.min(axis=1, keepdims=True, initial=np.inf) + SITS).any(axis=1)
        alone = ankle_rests & ~(others_carry | sits)[:, None]
        stands = ankle_rests | toe_rests
        hips_off = np.abs(own.hips_over(stands) - source.hips_over(stands))
        return Feet(
            joints=foot_joints([foot.leg for foot in self.feet]),
            stance=self.stance,
            skate_source=source.skate,
            skate=own.skate,
            sole=sole,
            foot_height=np.where(stands, 100 * np.abs(off), np.nan),
            foot_pitch=np.where(on_sole, np.abs(own.pitch - source.pitch), np.nan),
            ankle_height=np.where(flat, 100 * np.abs(own.flat_ankle - self.belongs), np.nan),
            hips_height=np.where(alone, 100 * hips_off, np.nan),
        )

    def off_floor(self, feet: Feet, supports: SupportsMeasured) -> tuple[Array, Flags]:
        """(frames,) each: how far the lowest of feet and of skin on which other joints rest is from where the lowest of
        the source is, or from its floor if that is near [% of leg length]; and whether any of these rests there.
        """
        on_skin = np.isfinite(supports.lowest)
        joints = np.where(supports.on_floor & on_skin[:, None], supports.height_source, np.inf)
        of_source = np.hstack([self.tracks.sole, joints]).min(axis=1, initial=np.inf)
        lowest = np.minimum(feet.sole.min(axis=1, initial=np.inf), supports.lowest)
        rests = (self.stance.any(axis=1) | on_skin) & np.isfinite(lowest) & np.isfinite(self.floor.height)
        off = self.floor.off(lowest[rests], of_source[rests], np.where(on_skin, THICK, NEAR)[rests])
        errors = np.zeros(len(rests))
        errors[rests] = 100.0 * np.abs(off)
        return errors, rests


def find_feet(source: Motion, matching: Matching, up: Array, surface: Surface | None = None) -> SourceFeet:
    """Measure the feet of a source; `up`, (3,), is the unit vector up in source and results, `surface` that of the
    target's skin, if known.
    """
    legs = [*zip(*matching.legs, matching.soles, strict=True)] if matching.legs else []
    source_feet, feet = _flat_feet(matching)
    length, target_length = matching.leg_lengths
    stance = feet_rest(source, [foot.leg for foot in source_feet], length, up)
    tracks, rests = _FootTracks.of(source, source_feet, length, up), stance[:, ::2] | stance[:, 1::2]
    skin = surface if legs else None
    soles = _soles_of_mesh(skin, matching.target, [leg for _, leg, _ in legs])
    thickness = 0.0 if skin is None else np.mean([skin.below_sole(own) for _, _, (_, own) in legs]) / target_length
    return SourceFeet(
        up=up,
        feet=feet,
        leg=target_length,
        stance=stance,
        tracks=tracks,
        floor=find_floor(tracks.sole, rests),
        belongs=tracks.sole if soles is None else _means(tracks.sole, rests),
        surface=soles,
        thickness=float(thickness),
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


def _soles_of_mesh(surface: Surface | None, body: Body, legs: Sequence[Leg]) -> Surface | None:
    """The surface of a body if it is of a mesh that shows the soles of both its legs."""
    if surface is None or not surface.of_mesh:
        return None
    return surface if all(len(surface.on(body.skeleton.subtree_at(leg.ankle))) for leg in legs) else None


def _means(soles: Array, rests: Flags) -> Array:
    """(frames, legs), the mean heights of soles over each of their rests, (frames, legs) each."""
    means = [over_runs(sole[:, None], rest.astype(float)) for sole, rest in zip(soles.T, rests.T, strict=True)]
    return np.concatenate(means, axis=1)


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
    lowest_source: Array  # (frames,), the height of the lowest joint [leg lengths]
    lowest: Array  # (frames,), that of the lowest skin about joints that rest; infinite without [leg lengths]
    up: Array  # (3,), the unit vector up
    leg: float  # the length of the target's leg [file units]; 1 without legs
    parts: tuple[tuple[int, ...], ...]  # for each joint, those of the target that carry the skin it rests on
    surface: Surface | None  # of the target's skin; None if it is not known, or without legs
    thickness: float  # of that below a foot that stands flat [leg lengths]

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

        Where the skin is known, a height is right from the source's to the one at which the lowest skin of that part of
        the body is on what the source's lowest joint is on.
        """
        paths = result.positions[:, self.joints] / self.leg
        skate = speeds_along(level(paths, self.up), result.frame_time)
        off, lowest = paths @ self.up - self.height_source, np.full(len(result), np.inf)
        for part, skin in self._skins(result):
            on = np.flatnonzero([each == part for each in self.parts])
            rests = self.on_floor[:, on] & np.isfinite(skin)[:, None]
            off[:, on] = np.where(rests, _least(off[:, on], (skin - self.lowest_source)[:, None]), off[:, on])
            lowest = np.where(rests.any(axis=1), np.minimum(lowest, skin), lowest)
        return replace(self, skate=skate, height=100.0 * np.abs(off), lowest=lowest)

    def _skins(self, result: Motion) -> Iterator[tuple[tuple[int, ...], Array]]:
        """Each part of the body that rests, and the height of its lowest skin over that of a flat foot, (frames,)."""
        if self.surface is not None:
            for part in dict.fromkeys(self.parts):
                yield part, self.surface.lowest(result, part, self.up) / self.leg + self.thickness


def find_supports(
    source: Motion, matching: Matching, up: Array, surface: Surface | None = None, thickness: float = 0.0
) -> SupportsMeasured:
    """Find the joints that rest in a source, which is its own result until `in_result`; arguments as in `find_feet`,
    and how far the skin is below a foot that stands flat [leg lengths].
    """
    joints = matching.joints_but_feet()
    drivers = matching.drivers[joints]
    source_leg, leg = matching.leg_lengths if matching.legs else (1.0, 1.0)
    height = heights_of(source.positions, drivers, up) / source_leg
    lowest = lowest_heights(source.positions, up) / source_leg
    on_floor = height - lowest[:, None] < LOW
    on_floor &= speeds_along(source.positions, source.frame_time, drivers) < SLOW * source_leg
    holds = _holds(source, matching, joints, source_leg) & ~on_floor
    some = (on_floor | holds).any(axis=0)
    skate = speeds_along(level(source.positions[:, drivers[some]] / source_leg, up), source.frame_time)
    known = surface if matching.legs else None
    return SupportsMeasured(
        joints=joints[some],
        on_floor=on_floor[:, some],
        holds=holds[:, some],
        skate_source=skate,
        skate=skate,
        height=np.zeros_like(skate),
        height_source=height[:, some],
        lowest_source=lowest,
        lowest=np.full(len(source), np.inf),
        up=up,
        leg=leg,
        parts=_parts(matching.target, joints[some].tolist()) if known is not None else (),
        surface=known,
        thickness=thickness,
    )


def _least(joint: Array, skin: Array) -> Array:
    """The lesser of the errors of a joint's height and of its skin's; 0 where one is too high and the other too low."""
    nearer = np.where(np.abs(joint) < np.abs(skin), joint, skin)
    return np.asarray(np.where(joint * skin > 0.0, nearer, 0.0))


def _parts(body: Body, joints: list[int]) -> tuple[tuple[int, ...], ...]:
    """For each joint, the joints that carry the skin of its segment; the trunk is one."""
    segments = find_segments(body).of_joint
    trunk = [SEGMENTS.index(name) for name in TRUNK]
    one = np.where(np.isin(segments, trunk), trunk[0], segments)
    return tuple(tuple(np.flatnonzero((one == one[joint]) & (one >= 0)).tolist()) for joint in joints)


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
        return next((each for each in above if names[of_joint[each]] in BASES), joint)

    ends = np.flatnonzero([names[region] in ENDS for region in of_joint[joints].tolist()])
    ways = ways_of(joints[ends])
    stay = ways < PLACE
    some = stay.any(axis=0)
    bases, at = np.unique([base_of(joint) for joint in joints[ends[some]].tolist()], return_inverse=True)
    holds[:, ends[some]] = stay[:, some] & (ways_of(bases.astype(np.intp))[:, at] > SWAY * ways[:, some] + FARTHER)
    return holds
