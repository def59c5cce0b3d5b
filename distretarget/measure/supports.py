"""Feet and other joints that rest on the world in a source: whether they slide in a result or leave their height.

All is found from positions alone: a resting joint is slow, and near its lowest heights, and the floor is at the heights
of resting soles, without any fitting that could hide an offset of the whole motion. Heights are compared in leg lengths
of each body. Where the target's feet have a mesh, its lowest vertices are the soles. Their height is right anywhere
between the mean height of the source's sole over a rest and the source's floor, if these two are near each other; and
hips may be nearer to an ankle, or farther, by as much as its sole has moved towards the floor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from distretarget.body.body import Body
from distretarget.body.limbs import Leg
from distretarget.body.segments import find_segments
from distretarget.body.soles import Sole
from distretarget.matching.matching import Matching
from distretarget.measure.metrics import Track, Tracks
from distretarget.measure.skin import Surface
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of, lowest_heights, speeds_along
from distretarget.numerics.moving import largest
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.time_series import run_means
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level
from distretarget.skin.capsules import SEGMENTS

SLOW = 0.35  # a joint that rests on the floor is slower than this [leg lengths / s] ...
LOW_FOOT = 0.06  # ... and if it is a foot's, within this [leg lengths] of its lowest heights,
LOWEST = 2.0  # which is this percentile of them [%]; ...
LOW = 0.1  # ... if another's, no higher than this above the lowest joint [leg lengths]
LEAST = 0.1  # feet that rest for less than this in all, and than half of the clip, do not count as resting [s]
NEAR = 0.06  # a sole this near to the floor may be on it, as points below joints wander by half of this ...
THICK = 0.2  # ... and so may the skin about other joints this near to it [both leg lengths]
HOLD = 1.0  # a hand or head that holds on to something stays for this long [s],
PLACE = 0.02  # in a box with a diagonal below this [leg lengths],
SWAY = 8.0  # while the box of the joint where its limb begins is larger by this factor, and ...
FARTHER = 0.04  # ... by this much [leg lengths]
SITS = 0.25  # hips that are no higher than this above the soles carry the body as well [leg lengths]
BETWEEN = 0.5  # the body takes about this long from its feet to other supports [s]
ENDS = ("left hand", "right hand", "head")  # the regions that may hold on to something
BASES = ("trunk", "hips")  # the regions where their limbs begin
TRUNK = ("chest", "belly", "pelvis")  # segments that rest as one


def foot_joints(legs: Sequence[Leg]) -> Numbers:
    """Ankle and toe of each leg in turn, (foot joints,)."""
    return np.array([joint for leg in legs for joint in (leg.ankle, leg.toe)], np.intp)


def feet_rest(motion: Motion, legs: Sequence[Leg], length: float, up: Array) -> Flags:
    """(frames, foot joints), whether each rests, with legs of a `length`; not where it is higher than its hip joint."""
    paths = motion.positions[:, foot_joints(legs)] / length
    heights, hips = paths @ up, motion.positions[:, [leg.hip for leg in legs for _ in range(2)]] @ up / length
    low = (heights - np.percentile(heights, LOWEST, axis=0) < LOW_FOOT) & (heights < hips)
    rests = np.asarray(low & (speeds_along(paths, motion.frame_time) < SLOW))
    count = np.count_nonzero(rests.any(axis=1))
    return rests & (count >= min(LEAST / motion.frame_time, 0.5 * len(rests)))


def height_errors(heights: Array, of_source: Array, floor: float, near: Array | float = NEAR) -> Array:
    """The errors of heights [leg lengths]; all between the source's and its floor are right if the two are `near`."""
    other = np.where(np.abs(of_source - floor) < near, floor, of_source)
    return np.asarray(heights - np.clip(heights, np.minimum(of_source, other), np.maximum(of_source, other)))


class FootPaths(NamedTuple):
    """The feet of one body over time."""

    skate: Array  # (frames, foot joints), horizontal speed [leg lengths / s]
    sole: Array  # (frames, legs), the height of the lowest joint of the foot or of the heel [leg lengths]
    ankle: Array  # (frames, legs), the height of the ankle [leg lengths]
    hip: Array  # (frames, legs), the height of the leg's hip joint [leg lengths]

    def hips_over(self, rests: Flags) -> Array:
        """(frames, legs), the height of the middle of hip joints whose feet rest, `rests`, over each ankle [leg
        lengths]: a tilt of the pelvis on one leg, which moves wide hips more than narrow ones, does not count.
        """
        standing = rests.sum(axis=1, keepdims=True)
        return np.asarray((rests * self.hip).sum(axis=1, keepdims=True) / np.maximum(standing, 1) - self.ankle)


def _paths_of(motion: Motion, feet: Sequence[tuple[Leg, Sole]], length: float, up: Array) -> FootPaths:
    """Measure the feet of a motion, on legs of this length [file units]; `up`, (3,), is the unit vector up."""
    legs, x, heights = [leg for leg, _ in feet], motion.positions, list[list[Array]]()
    for leg, sole in feet:
        lowest = lowest_heights(x, up, sole.joints)
        if sole.known and leg.toe != leg.ankle and leg.toe in sole.joints:
            normals = turned_by(motion.world_rotations_of(leg.ankle), sole.normal)
            lowest = np.minimum(lowest, (x[:, leg.ankle] - sole.ankle * normals) @ up)
        heights.append([lowest, x[:, leg.ankle] @ up, x[:, leg.hip] @ up])
    lengthwise = (np.reshape(heights, (len(feet), 3, len(motion))) / length).transpose(1, 2, 0)
    skate = speeds_along(level(x[:, foot_joints(legs)] / length, up), motion.frame_time)
    return FootPaths(skate, *lengthwise)


@dataclass(frozen=True, eq=False, kw_only=True)
class SourceFeet:
    """The feet of a source, against which those of results are measured. Arrays have no columns without legs."""

    up: Array  # (3,), the unit vector up in source and results
    feet: Sequence[tuple[Leg, Sole]]  # the target's
    leg: float  # the length of the target's legs [file units]
    stance: Flags  # (frames, foot joints), whether each foot joint of the source rests
    paths: FootPaths  # of the source
    floor: float  # the height of the source's floor, the median of resting soles; nan if none rests [leg lengths]
    sole: Array  # (frames, legs), wanted heights of soles; the mean over a rest if meshes are compared [leg lengths]
    surface: Surface | None  # the target's; None if no mesh shows its feet
    thickness: float  # from the lowest joint of a flat foot down to its surface [leg lengths]

    def in_result(self, result: Motion, supports: SupportsMeasured) -> Tracks:
        """The tracks of feet, hips and floor: speeds [leg lengths / s], and errors of heights [% of leg length]."""
        source, own = self.paths, _paths_of(result, self.feet, self.leg, self.up)
        ankle_rests, stands = self.stance[:, ::2], self.stance[:, ::2] | self.stance[:, 1::2]
        sole, off = own.sole, own.sole - self.sole
        if self.surface is not None:
            feet = [result.skeleton.subtree_at(leg.ankle) for leg, _ in self.feet]
            lowest = [self.surface.lowest(result, foot, self.up) for foot in feet]
            sole = np.stack(lowest, axis=1) / self.leg + self.thickness
            off = height_errors(sole, self.sole, self.floor)
        sits = (source.hip < source.sole.min(axis=1, keepdims=True, initial=np.inf) + SITS).any(axis=1)
        on_feet_only = ankle_rests & ~(supports.carry(result.frame_time) | sits)[:, None]
        to_floor = np.where(np.abs(self.floor - source.sole) < NEAR, self.floor - source.sole, 0.0)
        raised = np.clip(own.sole - source.sole, np.minimum(to_floor, 0.0), np.maximum(to_floor, 0.0))
        hips_off = own.hips_over(stands) - source.hips_over(stands)
        hips_off -= np.clip(hips_off, np.minimum(-raised, 0.0), np.maximum(-raised, 0.0))
        keys = result.skeleton.keys_of(foot_joints([leg for leg, _ in self.feet]))
        return {
            "foot_skate": Track(own.skate, self.stance, keys),
            "foot_height": Track(100 * np.abs(off), stands, keys[::2]),
            "hips_height": Track(100 * np.abs(hips_off), on_feet_only, keys[::2]),
            "floor": self._lowest_errors(sole, supports),
        }

    def _lowest_errors(self, sole: Array, supports: SupportsMeasured) -> Track:
        """(frames,), the error of the lowest height of soles and resting skin, while anything rests in the source."""
        on_skin = np.isfinite(supports.lowest)
        joints = np.where(supports.on_floor & on_skin[:, None], supports.height_source, np.inf)
        of_source = np.hstack([self.paths.sole, joints]).min(axis=1, initial=np.inf)
        lowest = np.minimum(sole.min(axis=1, initial=np.inf), supports.lowest)
        rests = (self.stance.any(axis=1) | on_skin) & np.isfinite(lowest) & np.isfinite(self.floor)
        near, errors = np.where(on_skin, THICK, NEAR)[rests], np.zeros(len(rests))
        errors[rests] = 100.0 * np.abs(height_errors(lowest[rests], of_source[rests], self.floor, near))
        return Track(errors, rests)


def find_feet(source: Motion, matching: Matching, up: Array, surface: Surface | None = None) -> SourceFeet:
    """Measure the feet of a source; `up`, (3,), is the unit vector up, `surface` the target's, if known."""
    legs = matching.legs or ((), ())
    source_feet, feet = ([*zip(legs[k], (soles[k] for soles in matching.soles), strict=True)] for k in (0, 1))
    length, target_length = matching.leg_lengths
    stance = feet_rest(source, legs[0], length, up)
    paths, rests = _paths_of(source, source_feet, length, up), stance[:, ::2] | stance[:, 1::2]
    skin = surface if feet else None
    below = 0.0 if skin is None else np.mean([skin.below_sole(sole) for _, sole in feet]) / target_length
    carried = [matching.target.skeleton.subtree_at(leg.ankle) for leg in legs[1]]
    shown = skin is not None and skin.of_mesh and all(len(skin.on(foot)) for foot in carried)
    columns = zip(paths.sole.T, rests.T, strict=True)
    means = [run_means(sole[:, None], rest.astype(float)) for sole, rest in columns] if shown else []
    return SourceFeet(
        up=up,
        feet=feet,
        leg=target_length,
        stance=stance,
        paths=paths,
        floor=float(np.median(paths.sole[rests])) if rests.any() else np.nan,
        sole=np.concatenate(means, axis=1) if shown else paths.sole,
        surface=skin if shown else None,
        thickness=float(below),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class SupportsMeasured:
    """The joints that rest on the world in a source, apart from feet, and their measurements in a result."""

    joints: Numbers  # (joints,), of the target, that rest in some frame of the source
    on_floor: Flags  # (frames, joints), whether each rests on the floor in the source
    holds: Flags  # (frames, joints), whether each holds on to something that stands still
    skate: Array  # (frames, joints), horizontal speed [leg lengths / s]
    height: Array  # (frames, joints), error of the height in the result [% of leg length]
    height_source: Array  # (frames, joints), over the origin, in the source [leg lengths]
    lowest_source: Array  # (frames,), the height of the source's lowest joint [leg lengths]
    lowest: Array  # (frames,), the height of the lowest skin about resting joints; infinite if none [leg lengths]
    up: Array  # (3,), the unit vector up
    leg: float  # the length of the target's leg [file units]; 1 without legs
    parts: tuple[tuple[int, ...], ...]  # for each joint, the target's joints that carry the skin it rests on
    surface: Surface | None  # of the target's skin; None if it is not known, or without legs
    thickness: float  # from the lowest joint of a flat foot down to its skin [leg lengths]

    @property
    def rest(self) -> Flags:
        """(frames, joints), whether each rests on the floor or on something else."""
        return self.on_floor | self.holds

    def carry(self, frame_time: float) -> Flags:
        """(frames,), whether one of them rests within `BETWEEN` before or after, and so may carry part of the body."""
        rests = np.asarray(self.rest.any(axis=1))
        reach = int(min(BETWEEN / frame_time, len(rests)))
        return largest(rests[:, None].astype(np.float64), reach)[:, 0] > 0

    def in_result(self, result: Motion) -> SupportsMeasured:
        """The same joints, measured in a result. With skin, a height is right anywhere between the source's and the one
        at which the lowest skin of the part is as high as the source's lowest joint.
        """
        paths = result.positions[:, self.joints] / self.leg
        skate = speeds_along(level(paths, self.up), result.frame_time)
        off, lowest = paths @ self.up - self.height_source, np.full(len(result), np.inf)
        for part, skin in self._skins(result):
            on = np.flatnonzero([each == part for each in self.parts])
            rests = self.on_floor[:, on] & np.isfinite(skin)[:, None]
            joint, of_skin = off[:, on], (skin - self.lowest_source)[:, None]
            lesser = np.where(np.abs(joint) < np.abs(of_skin), joint, of_skin)  # 0 between, as one is too high
            off[:, on] = np.where(rests, np.where(joint * of_skin > 0.0, lesser, 0.0), joint)
            lowest = np.where(rests.any(axis=1), np.minimum(lowest, skin), lowest)
        return replace(self, skate=skate, height=100.0 * np.abs(off), lowest=lowest)

    def _skins(self, result: Motion) -> Iterator[tuple[tuple[int, ...], Array]]:
        """Each of the `parts`, and the height of its lowest skin plus the `thickness` of a foot, (frames,)."""
        if self.surface is not None:
            for part in dict.fromkeys(self.parts):
                yield part, self.surface.lowest(result, part, self.up) / self.leg + self.thickness


def find_supports(
    source: Motion, matching: Matching, up: Array, surface: Surface | None = None, thickness: float = 0.0
) -> SupportsMeasured:
    """Find the joints that rest in a source, measured in it until `in_result`; arguments as in `find_feet`."""
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
    known = surface.without_gear if surface and matching.legs else None
    return SupportsMeasured(
        joints=joints[some],
        on_floor=on_floor[:, some],
        holds=holds[:, some],
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


def _parts(body: Body, joints: list[int]) -> tuple[tuple[int, ...], ...]:
    """For each joint, the joints that carry the skin of its segment; the trunk is one."""
    segments = find_segments(body).of_joint
    trunk = [SEGMENTS.index(name) for name in TRUNK]
    one = np.where(np.isin(segments, trunk), trunk[0], segments)
    return tuple(tuple(np.flatnonzero((one == one[joint]) & (one >= 0)).tolist()) for joint in joints)


def _holds(source: Motion, matching: Matching, joints: Numbers, leg: float) -> Flags:
    """(frames, joints), whether each stays in its place while the base of its limb moves."""
    names, of_joint, drivers = matching.regions.names, matching.regions.of_joint, matching.drivers
    reach = max(int(min(0.5 * HOLD / source.frame_time, len(source))), 1)
    holds = np.zeros((len(source), len(joints)), bool)

    def extents_of(some: Numbers) -> Array:
        """(frames, some), the diagonal of the bounding box of each joint's path within `reach` frames on each side."""
        paths = source.positions[:, drivers[some]] / leg
        return lengths(largest(paths, reach) + largest(-paths, reach))

    def base_of(joint: int) -> int:
        above = [each for each in matching.target.skeleton.to_root(joint) if drivers[each] >= 0]
        return next((each for each in above if names[of_joint[each]] in BASES), joint)

    ends = np.flatnonzero([names[region] in ENDS for region in of_joint[joints].tolist()])
    extents = extents_of(joints[ends])
    stay = extents < PLACE
    some = stay.any(axis=0)
    bases, at = np.unique([base_of(joint) for joint in joints[ends[some]].tolist()], return_inverse=True)
    base_extents = extents_of(bases.astype(np.intp))[:, at]
    holds[:, ends[some]] = stay[:, some] & (base_extents > SWAY * extents[:, some] + FARTHER)
    return holds
