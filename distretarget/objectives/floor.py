"""The floor while the body rests on something: the heights that joints keep above, and how the root rises for them."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from distretarget.body.anatomy import WITHOUT_SIDE
from distretarget.body.resting import REST_HEIGHT
from distretarget.ik.springs import FloorSprings, no_floor
from distretarget.matching.undersides import Undersides
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.moving import largest
from distretarget.numerics.time_series import by_shot
from distretarget.numerics.vectors import Array, Numbers, level
from distretarget.objectives.clip import Clip
from distretarget.objectives.supports import Supports

STIFFNESS = 500.0  # k, shared by the parts of a region
NEAR_FLOOR = 0.3  # joints that never come closer to the floor than this in the rotation copy are left out [leg lengths]
ROOT_BLEND = 0.2  # the root rises over about twice this time, and sinks back over as long [s]
FLOOR_SPAN = 0.16  # the floor of a frame is the lowest joint within this time before and after it [s]


class Flesh(NamedTuple):
    """Joints of trunk and head whose skin may be near the floor while something rests."""

    joints: Numbers  # (joints,), joints of the target
    heights: Array  # (frames, joints), at which their lowest skin is as low as the soles [target file units]


def find_flesh(clip: Clip, weights: Array, undersides: Undersides | None) -> Flesh:
    """Return the joints of trunk and head near the floor, none without skin; `weights` as in `find_floor_springs`. The
    hip joints are left out: the skin about them is on the thighs, which the feet place.
    """
    if undersides is None or not clip.legs:
        return Flesh(np.zeros(0, np.intp), np.zeros((len(clip), 0)))
    joints = clip.limb_joints[clip.regions.inside(*WITHOUT_SIDE)[clip.limb_joints]]
    joints = joints[~np.isin(joints, [pair.target.hip for pair in clip.legs])]
    floor, rests = _floor_below_skin(clip, undersides), weights.max(axis=1, initial=0.0) > 0.0
    reach = np.array([undersides.target.reach(joint) for joint in joints.tolist()])
    near = (clip.copy_on_path(joints) @ clip.up - floor < reach) & rests[:, None]
    joints, frames = joints[near.any(axis=0)], np.flatnonzero(near.any(axis=1))
    heights = np.repeat(floor, len(joints), axis=1)
    heights[frames] += undersides.target.below(clip.copy[frames], joints, clip.up)
    return Flesh(joints, heights)


def rise_of_flesh(clip: Clip, supports: Supports, flesh: Flesh) -> Array:
    """Return how much the root rises, (frames,), so that the skin of trunk and head is no lower than the soles while
    something other than a foot rests [target file units]: a large head in a cartwheel, a belly in a push-up. It rises
    no farther than the legs of resting feet reach; the trunk has to bend for the remainder. On feet alone it does not
    rise.
    """
    low = flesh.heights - clip.copy_on_path(flesh.joints) @ clip.up
    rise: Array = supports.beside_feet * low.max(axis=1, initial=0.0)
    if not rise.any():
        return rise
    rise = by_shot(partial(largest, reach=round(ROOT_BLEND / clip.frame_time)), clip.shots, rise[:, None])
    stands = supports.weights[:, : supports.feet].reshape(len(clip), -1, 2).max(axis=2)
    beyond = stands * np.maximum(rise - _room_of_legs(clip, supports), 0.0)
    return clip.averaged(rise[:, 0] - beyond.max(axis=1, initial=0.0), ROOT_BLEND)


def _room_of_legs(clip: Clip, supports: Supports) -> Array:
    """(frames, legs), how much the hips can rise until each leg is straight, with its ankle at its support; 0 where the
    leg is too short already [target file units].
    """
    hips = clip.copy_on_path(np.array([pair.target.hip for pair in clip.legs], np.intp))
    legs = hips - supports.places[:, : supports.feet : 2]
    reach = np.maximum(clip.leg_lengths[1] ** 2 - (level(legs, clip.up) ** 2).sum(axis=2), 0.0)
    return np.asarray(np.maximum(np.sqrt(reach) - legs @ clip.up, 0.0))


def find_floor_springs(
    clip: Clip, weights: Array, undersides: Undersides | None = None, flesh: Flesh | None = None
) -> FloorSprings:
    """Return the heights that joints other than the feet's keep above while something rests.

    The floor is at the height of the source's lowest joint around the frame, scaled. A driven joint keeps as high above
    it as the source's joint, scaled, but at most `REST_HEIGHT`; joints of `flesh` at least at the heights given there.
    An undriven joint may be as low as the floor; where the skin is known, its skin may be as low as the soles. The
    parts of a region share `STIFFNESS` (`_shares`). `weights`, (frames, supports), are those of the supports, 0 to 1.
    """
    if not clip.legs:
        return no_floor(len(clip))
    up, leg = clip.up, clip.leg_lengths[1]
    floor, weight = _height_of_floor(clip), weights.max(axis=1, initial=0.0)
    joints = np.concatenate([clip.limb_joints, clip.undriven_joints])
    lowest = np.repeat(floor, len(joints), axis=1)
    high = clip.scale.heights(heights_of(clip.source.positions, clip.drivers[clip.limb_joints], up))
    lowest[:, : len(clip.limb_joints)] += np.minimum(high - floor, REST_HEIGHT * leg)
    if flesh is not None:
        columns = np.searchsorted(clip.limb_joints, flesh.joints)
        lowest[:, columns] = np.maximum(lowest[:, columns], flesh.heights)
    rise = (clip.root - clip.copy.positions[:, 0]) @ up
    over = heights_of(clip.copy.positions, joints, up) + rise[:, None] - lowest
    may_meet = (over < NEAR_FLOOR * leg) & (weight[:, None] > 0.0)
    near = may_meet.any(axis=0)
    free = near & (np.arange(len(joints)) >= len(clip.limb_joints))
    if undersides is not None and free.any():
        frames = np.flatnonzero(may_meet[:, free].any(axis=1))
        below = undersides.target.below(clip.copy[frames], joints[free], up)
        lowest[np.ix_(frames, free)] += below - undersides.soles[1]
    joints, lowest = joints[near], lowest[:, near]
    stiffness = STIFFNESS * weight[:, None] / _shares(clip, joints)
    return FloorSprings(joints, np.ascontiguousarray(lowest / clip.unit), stiffness, up)


def _shares(clip: Clip, joints: Numbers) -> Array:
    """(joints,), the divisor of `STIFFNESS` for each joint: the number of parts that carry joints of its region, since
    a part may lie on any one of its joints, as a palm on the knuckle of the little finger. For fingers that only the
    floor moves, which yield, it is the number of the region's joints.
    """
    regions, parts = clip.regions.of_joint[joints], clip.parts[clip.skeleton.parents[joints]]
    loose, shares = np.isin(parts, clip.loose_parts), np.empty(len(joints))
    for region in np.unique(regions):
        own = regions == region
        shares[own] = np.where(loose[own], own.sum(), len(np.unique(parts[own & ~loose])))
    return shares


def _height_of_floor(clip: Clip) -> Array:
    """(frames, 1), the height of the source's lowest joint around each frame, scaled [target file units]."""
    return clip.scale.heights(_least_around(clip, clip.source_floor))


def _floor_below_skin(clip: Clip, undersides: Undersides) -> Array:
    """(frames, 1), the height of the floor below soles at the source's lowest joint [target file units]; if the source
    has a mesh, below its skin where that is lower, as in a body that lies.
    """
    lowest, (sole, own_sole) = clip.source_floor, undersides.soles
    if undersides.source.mesh is not None:
        sources = np.unique(clip.drivers[clip.limb_joints])
        lowest = np.minimum(lowest, undersides.source.lowest(clip.source, sources, clip.up) + sole)
    return clip.scale.heights(_least_around(clip, lowest)) - own_sole


def _least_around(clip: Clip, heights: Array) -> Array:
    """(frames, 1), the least of heights, (frames,), within `FLOOR_SPAN` of each frame. So neither feet that leave the
    floor for a moment nor a faulty frame raise the floor.
    """
    return -largest(-heights[:, None], round(FLOOR_SPAN / clip.frame_time))
