"""Joints that rest on the world, apart from feet: when they do, and whether they slide or leave their height.

Found from positions alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import TRUNK_REGIONS
from distretarget.matching.matching import Matching
from distretarget.matching.undersides import Underside, Undersides
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of, lowest_heights, speeds_along
from distretarget.numerics.time_series import largest
from distretarget.numerics.vectors import lengths, level

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SLOW = 0.35  # a joint that rests on the floor is slower than this [leg lengths / s] ...
LOW = 0.1  # ... and no higher than this above the lowest joint [leg lengths]
HOLD = 1.0  # a hand or head that holds on to something stays in its place for this long [s],
PLACE = 0.02  # which is no larger than this [leg lengths],
SWAY = 8.0  # while the joint where its limb begins goes this many times as far, and ...
FARTHER = 0.04  # ... this much farther [leg lengths]
BETWEEN = 0.5  # the body takes about this long from its feet to other supports [s]
ENDS = ("left hand", "right hand", "head")  # the regions that hold on to something


@dataclass(frozen=True, eq=False, kw_only=True)
class SupportsMeasured:
    """The joints that rest on the world in a source, apart from feet, and how they do so in a result."""

    joints: NDArray[np.intp]  # (joints,), of the target, that rest in some frame of the source
    on_floor: Flags  # (frames, joints), whether each rests on the floor in the source
    holds: Flags  # (frames, joints), whether each holds on to something that stands still
    skate_source: Array  # (frames, joints), horizontal speed in the source [leg lengths / s]
    skate: Array  # the same in the result
    height: Array  # (frames, joints), error of the height in the result [% of leg length]
    height_source: Array  # (frames, joints), over the origin [leg lengths]
    skin_source: Array  # (frames, joints), how far the skin reaches below each, less than below soles [leg lengths]
    up: Array  # (3,), the unit vector up
    leg: float  # the length of the target's leg [file units]; 1 without legs
    underside: Underside | None  # the target's skin; None if it is not known
    soles: float  # how far the target's skin reaches below the lowest joint of a foot that stands flat [file units]

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
        if self.underside is not None:
            thicker = (self.underside.below(result, self.joints, self.up) - self.soles) / self.leg - self.skin_source
            off -= np.clip(off, np.minimum(thicker, 0.0), np.maximum(thicker, 0.0)) * self.on_floor
        return replace(self, skate=skate, height=100.0 * np.abs(off))


def find_supports(
    source: Motion, matching: Matching, up: Array, undersides: Undersides | None = None
) -> SupportsMeasured:
    """Find the joints that rest in a source, which is its own result until `in_result`.

    `up`, (3,), is the unit vector up in source and results; `undersides` are the skins of both bodies, if known.
    """
    joints = matching.joints_but_feet()
    drivers = matching.drivers[joints]
    source_leg, leg = matching.leg_lengths if matching.legs else (1.0, 1.0)
    height = heights_of(source.positions, drivers, up) / source_leg
    low = height - lowest_heights(source.positions, up)[:, None] / source_leg < LOW
    on_floor = low & (speeds_along(source.positions, source.frame_time, drivers) < SLOW * source_leg)
    holds = _holds(source, matching, joints, source_leg) & ~on_floor
    some = (on_floor | holds).any(axis=0)
    skate = speeds_along(level(source.positions[:, drivers[some]] / source_leg, up), source.frame_time)
    soles, skin, underside = 0.0, np.zeros_like(skate), None
    if undersides is not None and matching.legs:
        underside, (source_sole, soles) = undersides.target, undersides.soles
        skin = (undersides.source.below(source, drivers[some], up) - source_sole) / source_leg
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
        underside=underside,
        soles=soles,
    )


def _holds(source: Motion, matching: Matching, joints: NDArray[np.intp], leg: float) -> Flags:
    """(frames, joints), whether each keeps its place while the base of its limb moves."""
    names, of_joint, drivers = matching.regions.names, matching.regions.of_joint, matching.drivers
    reach = max(int(min(0.5 * HOLD / source.frame_time, len(source))), 1)
    holds = np.zeros((len(source), len(joints)), bool)

    @cache
    def way_of(joint: int) -> Array:
        return _extent(source.positions[:, drivers[joint]] / leg, reach)

    for column, joint in enumerate(joints.tolist()):
        if names[of_joint[joint]] in ENDS:
            above = [each for each in matching.target.skeleton.line(joint) if drivers[each] >= 0]
            base = next((each for each in above if names[of_joint[each]] in TRUNK_REGIONS), joint)
            way = way_of(joint)
            stays = way < PLACE
            holds[:, column] = stays & (way_of(base) > SWAY * way + FARTHER) if stays.any() else stays
    return holds


def _extent(path: Array, reach: int) -> Array:
    """(frames,), the diagonal of the box that a path (frames, 3) fills within `reach` frames before and after."""
    return lengths(largest(path, reach) + largest(-path, reach))
