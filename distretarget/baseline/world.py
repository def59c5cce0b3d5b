"""The worlds of source and target: the up axis and floor of each, and the meaning of the root's OFFSET."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import find_root_scale
from distretarget.body.axes import axis_vector
from distretarget.body.body import OFF_FLOOR, Body
from distretarget.body.resting import feet_at_rest, feet_resting
from distretarget.body.soles import floor_height, points_down, sole_height
from distretarget.checks import check_choice
from distretarget.matching.matching import Matching
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import lowest_heights
from distretarget.numerics.rotations import least
from distretarget.numerics.vectors import Array
from distretarget.skeleton import AXES, POSITION_CHANNELS

RootOffset = Literal["replaced", "added"]

ON_FLOOR = 0.1  # feet on the floor are lower than this [leg lengths]
LOW = 0.2  # a floor is sought only within this of height 0 [leg lengths]


@dataclass(frozen=True)
class World:
    """How the source's world maps to the target's.

    Attributes:
        source_up, up: the up axis in the source's file and in the target's, one of `AXES`.
        root_offset: whether the position channels of the source's root replace its OFFSET, or are added to it.
        half_turn: whether bodies of only one file face -Z by convention, so that the source turns by 180 degrees.
    """

    source_up: str
    up: str
    root_offset: RootOffset
    half_turn: bool = False

    def __post_init__(self) -> None:
        check_choice("source_up", self.source_up, AXES)
        check_choice("up", self.up, AXES)
        check_choice("root_offset", self.root_offset, get_args(RootOffset))

    @property
    def up_vector(self) -> Array:
        """(3,), the unit vector up in the target's world."""
        return axis_vector(self.up)

    def to_target_axes(self, source: Body) -> Body:
        """Return the source in the target's world; its rest pose, too, if that stands in the source's."""
        if source.motion is None:
            return source.with_up(self.up)
        motion = with_root_offset(source.motion) if self.root_offset == "added" else source.motion
        rest_stands = source.up_at_rest == self.source_up and source.standing is None
        if not rest_stands or self._is_same:
            return source.with_motion(self.turned(motion), self.up)
        motion = motion.with_rest_turned(self._turn)
        return replace(source, skeleton=motion.rigid_skeleton, motion=motion, known_up=self.up)

    def turned(self, motion: Motion) -> Motion:
        """Return a motion turned to the axes of the target's world, by the least rotation, and by `half_turn`."""
        return motion if self._is_same else motion.rotated_about_origin(self._turn)

    @property
    def _is_same(self) -> bool:
        return self.source_up == self.up and not self.half_turn

    @property
    def _turn(self) -> Rotation:
        """The rotation from the source's world to the target's."""
        up = self.up_vector
        return Rotation.from_rotvec(np.pi * self.half_turn * up) * least(axis_vector(self.source_up)[None], up[None])


def find_world(
    source: Body,
    target: Body,
    *,
    source_up: str | None = None,
    target_up: str | None = None,
    root_offset: RootOffset | None = None,
) -> World:
    """Return the worlds of source and target; the given arguments override what the files show.

    The source's up axis is `Body.up`. The target's is the first of these that is known:

    - the axis stated in its file;
    - the axis of its motion, unless a human body is recognised in the source only;
    - the source's axis, if both rest poses stand along the same axis or the target's stands along none;
    - the axis along which its rest pose stands.
    """
    source_up = source_up or source.up
    motion_counts = target.anatomy is not None or source.anatomy is None
    up = target_up or target.skeleton.up or (target.up_in_motion if motion_counts else None)
    up = up or (source_up if target.up_at_rest in (None, source.up_at_rest) else target.up_at_rest)
    half_turn = source.skeleton.faces_negative_z != target.skeleton.faces_negative_z
    return World(source_up, up, root_offset or find_root_offset(source, axis_vector(source_up)), half_turn)


def find_root_offset(body: Body, up: Array) -> RootOffset:
    """Return whether the root's channels replace its OFFSET or are added, if only this puts feet on the floor."""
    motion, length = body.motion, body.leg_length
    if motion is None or not length or not set(POSITION_CHANNELS) <= set(motion.skeleton.channels[0]):
        return "replaced"
    rise = float(motion.skeleton.offsets[0] @ up)
    if not rise:
        return "replaced"
    lowest = body.lowest(up)
    return "added" if abs(lowest) > OFF_FLOOR * length and abs(lowest + rise) < ON_FLOOR * length else "replaced"


def with_root_offset(motion: Motion) -> Motion:
    """Return the motion with the root's OFFSET added to its positions."""
    return motion.moved(motion.skeleton.offsets[0])


def raised_onto_soles(matching: Matching, scale: float | None = None, undersides: Undersides | None = None) -> Matching:
    """Return the matching with the source raised by `rise_onto_soles`."""
    rise = rise_onto_soles(matching, scale or find_root_scale(matching), undersides)
    if not rise:
        return matching
    target = matching.target
    raised = matching.source_motion.moved(rise * target.up_vector)
    return replace(matching, source=matching.source.with_motion(raised, target.up))


def rise_onto_soles(matching: Matching, scale: float, undersides: Undersides | None = None) -> float:
    """Return the height by which to raise the source, so that the target's flat feet stand on the floor at height 0
    [source file units]: on the soles of its mesh, or at their height in the bind pose of a character
    (`Skeleton.floor_at_zero`). 0 if resting feet are not near height 0, or both are the same rig.
    """
    target, (source_leg, leg) = matching.target, matching.leg_lengths
    if matching.is_same_rig:
        return 0.0
    on_mesh = undersides is not None and undersides.feet_on_mesh
    if undersides is not None and on_mesh:
        own = undersides.soles[1]
    elif matching.legs is not None and target.skeleton.floor_at_zero and target.stands_at_rest:
        places = target.skeleton.rest_positions + target.skeleton.offsets[0]
        own = float(np.mean([(places[sole.joints] @ target.up_vector).min() for _, sole in matching.soles]))
    else:
        return 0.0
    found = _floor_of_source(matching, undersides if on_mesh else None)
    if abs(found) > LOW * source_leg or not (-LOW * leg if on_mesh else 0.0) <= own <= LOW * leg:
        return 0.0
    return own / scale - found


def _floor_of_source(matching: Matching, undersides: Undersides | None) -> float:
    """The height of the source's floor: the median of flat feet, or infinite; or with `undersides`, for feet on their
    mesh, the floor under soles, or without any on the floor that under the lowest skin.
    """
    motion, up, length = matching.source_motion, matching.target.up_vector, matching.leg_lengths[0]
    legs = matching.legs[0] if matching.legs else ()
    feet = [(leg, sole) for leg, (sole, _) in zip(legs, matching.soles, strict=True)]
    if undersides is None:
        flat = [motion.positions[feet_at_rest(motion, leg, up, length).all(axis=1)] for leg, _ in feet]
        places = zip(flat, feet, strict=True)
        resting = np.concatenate([lowest_heights(x, up, sole.joints) for x, (_, sole) in places])
        return float(np.median(resting)) if len(resting) else np.inf
    shots = matching.source.shots_of(motion)
    rests = [feet_resting(motion, leg, up, length, shots).max(axis=1) == 1.0 for leg, _ in feet]
    rests = [rest & points_down(motion, sole, up) for rest, (_, sole) in zip(rests, feet, strict=True)]
    heights = [sole_height(motion, sole, up) for _, sole in feet]
    if np.any(rests):
        return floor_height(np.stack(heights, axis=1), np.stack(rests, axis=1))
    joints = np.unique(matching.drivers[matching.joints_but_feet()])
    return float(np.median(undersides.source.lowest(motion, joints, up))) + undersides.soles[0]
