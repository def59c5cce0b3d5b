"""A body: a skeleton, which joint plays which part, a motion of it if there is one, and all that follows from them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.body.axes import FOLDED, STRETCHED, Directions, axis_vector, nearest_axis
from distretarget.body.conventions import by_names
from distretarget.body.legs import Legs, find_legs, foot_bone, leg_length, pelvis_joint
from distretarget.body.reference_pose import bend_axes, standing_frame, stands_at_rest, synthetic_t_pose
from distretarget.body.shape import by_shape
from distretarget.motion import Motion
from distretarget.numerics.rotations import normalised
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

STANDS_IN_MOTION = 0.7  # mean cosine between an axis and a body that stands along it in motion
TELLS_UP = 0.3  # the same cosine, from which a motion tells the axis where the rest pose does not
OFF_FLOOR = 0.25  # lowest joints farther than this from height 0 are not on the floor [leg lengths]
LOWEST_FRAMES = 2.0  # percentile of the lowest joint's heights that counts as the floor under the body
CLEAR_FEET = 0.3  # mean cosine between feet and the body's front, from which feet tell left from right


@dataclass(frozen=True, eq=False)
class Body:
    """One side of a retargeting, source or target.

    Attributes:
        skeleton: its joints and the bones that its motion shows, rigid.
        anatomy: which joint plays which part; None where no human body is recognised.
        motion: any motion of the body, with one frame at least; None where there is none.
        known_up: which of `AXES` points up, where that is decided; else None, and `found_up` tells.
    """

    skeleton: Skeleton
    anatomy: Anatomy | None
    motion: Motion | None = None
    known_up: str | None = None

    def __repr__(self) -> str:
        recognised = f"recognised by {self.anatomy.method}" if self.anatomy else "not recognised as human"
        return f"<Body of {len(self.skeleton)} joints, {recognised}>"

    @classmethod
    def of(cls, skeleton: Skeleton, motion: Motion | None = None) -> Body:
        """The body of a skeleton, recognised by the names of its joints or else by its shape.

        `motion`, any of the same joints, tells what the rest pose does not: the shape, the axes, how limbs bend.
        """
        moving = motion if motion is not None and len(motion) else None
        positions = None if moving is None else moving.positions
        return cls(skeleton, by_names(skeleton) or by_shape(skeleton, positions), moving)

    @classmethod
    def of_motion(cls, motion: Motion) -> Body:
        """The body that moves in a motion, with the bones that its frames show."""
        return cls.of(motion.rigid_skeleton, motion)

    # ---- legs and size

    @cached_property
    def legs(self) -> Legs | None:
        """The two legs; None where the body has none."""
        return find_legs(self.skeleton, self.anatomy)

    @cached_property
    def leg_length(self) -> float:
        """Thigh and shin, the mean of both legs [file units]; 0 without legs."""
        return leg_length(self.skeleton, self.legs) if self.legs else 0.0

    @cached_property
    def unit(self) -> float:
        """The body unit: twice the leg length, which is about the height of a person; without legs the longest path
        [file units].
        """
        return 2.0 * self.leg_length if self.legs else float(self.skeleton.path_lengths.max())

    @cached_property
    def height(self) -> float:
        """How tall the rest pose stands: its extent along the axis of its legs, without legs its largest extent
        [file units].
        """
        rest = self.skeleton.rest_positions
        if self.legs is None:
            return float(np.ptp(rest, axis=0).max())
        return float(np.ptp(rest @ axis_vector(_axis_of_legs(self.legs, rest[None]))))

    @cached_property
    def pelvis_joint(self) -> int | None:
        """The joint from which the legs part; None without legs."""
        return pelvis_joint(self.skeleton, self.legs) if self.legs else None

    # ---- how the body stands

    @cached_property
    def at_rest(self) -> Directions | None:
        """Which way the rest pose points; None without an anatomy."""
        return Directions(self.anatomy, self.skeleton.rest_positions) if self.anatomy else None

    @cached_property
    def moving(self) -> Directions | None:
        """Which way the body points in each frame of its motion; None without an anatomy or a motion."""
        return Directions(self.anatomy, self.motion.positions) if self.anatomy and self.motion else None

    @cached_property
    def stands_at_rest(self) -> bool:
        """Whether a person can stand in the rest pose; false without an anatomy."""
        return self.at_rest is not None and stands_at_rest(self.at_rest)

    @cached_property
    def up_at_rest(self) -> str | None:
        """Which of `AXES` points up in the rest pose; None where no person can stand so."""
        return nearest_axis(self.at_rest.up)[0] if self.at_rest and self.stands_at_rest else None

    @cached_property
    def found_up(self) -> str | None:
        """Which of `AXES` points up in the motion: the one along which the body stands in it, or in its rest pose; None
        where nothing tells.

        Where the two differ, the rest pose is right about a body that lies on the floor. The motion is right if its
        feet are at height 0 along its axis: then the file's world is another than its rest pose's.
        """
        if self.motion is None:
            return None
        if self.moving is None:
            return _axis_of_legs(self.legs, self.motion.positions) if self.legs else None
        axis, cosine = nearest_axis(self.moving.up.mean(axis=0))
        if self.up_at_rest is None and cosine < TELLS_UP:
            return None
        on_floor = abs(self.lowest(axis_vector(axis))) < OFF_FLOOR * self.leg_length
        return axis if self.up_at_rest is None or (cosine > STANDS_IN_MOTION and on_floor) else self.up_at_rest

    @cached_property
    def up(self) -> str:
        """Which of `AXES` points up: as decided, as the file says, as the body stands, else Y."""
        return self.known_up or self.skeleton.up or self.found_up or self.up_at_rest or "Y"

    @cached_property
    def up_vector(self) -> Array:
        """(3,), the unit vector up."""
        return axis_vector(self.up)

    def lowest(self, up: Array) -> float:
        """The height along `up`, (3,), of the lowest joint in the lowest frames of the motion [file units]."""
        if self.motion is None:
            return 0.0
        return float(np.percentile((self.motion.positions @ up).min(axis=1), LOWEST_FRAMES))

    @cached_property
    def reference_pose(self) -> Array:
        """(joints, 4), world rotations in which the body stands, to lay it upon another: those of the rest pose where a
        person can stand so; else of the frame of its motion in which it stands best; else of a synthetic T-pose.
        """
        if self.at_rest is None or self.stands_at_rest:
            return self.skeleton.unturned
        frame = standing_frame(self.moving, self.up_vector, self.unit) if self.moving else None
        if frame is None or self.motion is None:
            return synthetic_t_pose(self.skeleton, self.at_rest)
        return np.array(self.motion.world_rotations[frame])

    @cached_property
    def bend_axes(self) -> dict[str, Array]:
        """The axes about which elbows and knees bend, (3,) vectors in the reference pose by the roles of upper arms and
        thighs; none where the rest pose tells the roll of the limbs, or no motion does.
        """
        if self.anatomy is None or self.motion is None or self.stands_at_rest:
            return {}
        return bend_axes(self.anatomy, self.motion, self.reference_pose)

    # ---- what kind of body it is

    @cached_property
    def left_is_left(self) -> bool | None:
        """Whether the joints named left are on the body's left, as its feet tell; None where they do not tell."""
        if self.anatomy is None:
            return None
        seen = self.at_rest if self.stands_at_rest else self.moving
        feet = [foot_bone(self.skeleton, self.anatomy, side) for side in SIDES]
        if seen is None or None in feet:
            return None
        x = seen.positions
        forward = sum(normalised(x[..., foot[1], :] - x[..., foot[0], :]) for foot in feet if foot)
        cosine = float(np.mean((seen.axes[..., 2] * forward).sum(axis=-1)) / 2)
        return cosine > 0 if abs(cosine) > CLEAR_FEET else None

    @cached_property
    def on_all_fours(self) -> bool:
        """Whether this seems to be no person: trunk and legs stretch neither in the rest pose nor in motion."""
        if self.at_rest is None or not self.at_rest.is_whole or self.at_rest.stretch > STRETCHED:
            return False
        if self.moving is None:
            return bool(self.at_rest.stretch > FOLDED)
        return bool(np.percentile(self.moving.stretch, 99) < STRETCHED)

    # ---- other versions of the body

    @property
    def mirrored(self) -> Body:
        """The same body with left and right exchanged in its anatomy."""
        return replace(self, anatomy=self.anatomy.mirrored if self.anatomy else None)

    def with_motion(self, motion: Motion, up: str) -> Body:
        """The same body in another motion, in which the axis `up` points up."""
        return self.with_up(up) if motion is self.motion else replace(self, motion=motion, known_up=up)

    def with_up(self, up: str) -> Body:
        """The same body, in whose world the axis `up` is known to point up."""
        return self if up == self.up else replace(self, known_up=up)


def _axis_of_legs(legs: Legs, positions: Array) -> str:
    """Which of `AXES` points most from ankles to hips, over positions (frames, joints, 3)."""
    hips = positions[:, [leg.hip for leg in legs]]
    ankles = positions[:, [leg.ankle for leg in legs]]
    legs_up = (hips - ankles).mean(axis=(0, 1))
    axis = int(np.argmax(np.abs(legs_up)))
    return ("" if legs_up[axis] >= 0 else "-") + "XYZ"[axis]
