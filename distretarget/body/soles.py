"""The soles of a body: the pose of each foot while it stands flat on the floor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.axes import axis_vector, nearest_axis
from distretarget.body.body import Body, Pose
from distretarget.body.legs import Leg, Legs, leg_length
from distretarget.body.reference_pose import FOOT_PITCH
from distretarget.body.resting import feet_at_rest
from distretarget.numerics.rotations import least_matrix
from distretarget.numerics.vectors import lengths, normalised

Array = NDArray[np.float64]

HANGING = np.cos(np.radians(30))  # a foot within this angle of straight down hangs instead of standing [cosine]


@dataclass(frozen=True, eq=False)
class Sole:
    """The sole of a foot."""

    normal: Array  # (3,), the unit vector up from the floor while the foot stands flat, in the axes of the ankle joint
    joints: NDArray[np.intp]  # (joints,), the ankle, and the joints and End Sites of the foot below it
    heights: Array  # (joints,), their heights above the sole [file units]
    known: bool  # whether rest pose, motion or the other body show how the foot stands; if not, it has the usual pitch

    @property
    def at_ankle(self) -> Sole:
        """The sole of a leg that ends at the ankle."""
        return replace(self, joints=self.joints[:1], heights=np.zeros(1))

    @property
    def ankle(self) -> float:
        """The height of the ankle above the sole [file units]."""
        return float(self.heights[0])


def find_soles(
    body: Body, legs: Legs, pose: Pose | None = None, normals: tuple[Array, Array] | None = None
) -> tuple[Sole, Sole]:
    """Return the soles of both feet, each level with the lowest of the foot's joints and End Sites; toes are turned as
    in `pose`, the reference pose if not given.

    The rest pose shows how a foot stands if a person can stand in it and the foot does not hang. Otherwise both feet
    get the pitch of the flatter one while it rests in the motion. Without a motion feet stand as in the reference pose,
    hanging ones at the usual pitch. `normals` of the soles, if given, overrule all of this.
    """
    pose = pose or body.reference
    feet = [_reference_foot(body, leg, pose) for leg in legs]
    if not all(foot.known for foot in feet):
        length = leg_length(body.skeleton, legs)
        feet = [_resting_foot(body, leg, length, pose) or foot for leg, foot in zip(legs, feet, strict=True)]
        pitch = max((foot.pitch for foot in feet if foot.known), default=None)
        feet = feet if pitch is None else [foot.pitched(pitch) for foot in feet]
    if normals is not None:
        feet = [replace(foot, up=normal, known=True) for foot, normal in zip(feet, normals, strict=True)]
    left, right = (foot.sole for foot in feet)
    return left, right


@dataclass(frozen=True, eq=False)
class _Foot:
    """A foot in the axes of its ankle: its `joints`, their `points`, (joints, 3), relative to the ankle [file units],
    and the unit vector `up`, (3,); `known` if rest pose or motion show that it stands like this.
    """

    joints: list[int]
    points: Array
    up: Array
    known: bool

    @cached_property
    def direction(self) -> Array:
        """(3,), the unit vector to the point farthest from the ankle; zero for a foot without length."""
        return normalised(self.points[np.argmax(lengths(self.points))])

    @property
    def sole(self) -> Sole:
        """The sole of the foot."""
        heights = self.points @ self.up
        return Sole(self.up, np.array(self.joints, np.intp), heights - heights.min(), self.known)

    @property
    def pitch(self) -> float:
        """How far the foot points upwards [rad]."""
        return float(np.arcsin(np.clip(self.direction @ self.up, -1.0, 1.0)))

    def pitched(self, pitch: float) -> _Foot:
        """The same foot, turned about its sideways axis so that it has another pitch [rad]."""
        across = normalised(self.up - (self.up @ self.direction) * self.direction)
        up = np.cos(pitch) * across + np.sin(pitch) * self.direction if across.any() else self.up
        return replace(self, up=np.asarray(up), known=True)


def _reference_foot(body: Body, leg: Leg, pose: Pose) -> _Foot:
    """The foot in the reference pose; a hanging foot gets the usual pitch."""
    stance = body.reference.directions
    up = body.up_vector if stance is None else axis_vector(nearest_axis(stance.up)[0])
    ankle = Rotation.from_quat(body.reference.rotations[leg.ankle]).as_matrix()
    foot = _foot(body, leg, pose, up @ ankle, body.stands or body.anatomy is None or body.foot_pitch is not None)
    if foot.direction @ foot.up >= -HANGING:
        return foot
    forward = np.zeros(3) if stance is None else stance.axes[:, 2]
    flat = np.cos(FOOT_PITCH) * forward - np.sin(FOOT_PITCH) * up
    hanging = least_matrix((ankle @ foot.direction)[None], flat[None])
    return replace(foot, up=up @ hanging @ ankle, known=False)


def _resting_foot(body: Body, leg: Leg, length: float, pose: Pose) -> _Foot | None:
    """The foot in the median pose of the frames in which it rests; None where it never rests. The legs have a `length`
    [file units].
    """
    motion = body.motion
    if motion is None or len(motion) < 2:
        return None
    resting = np.flatnonzero(feet_at_rest(motion, leg, body.up_vector, length).all(axis=1))
    if not len(resting):
        return None
    to_ankle = Rotation.from_quat(motion[resting].world_rotations_of(leg.ankle)).inv()
    return _foot(body, leg, pose, normalised(np.median(to_ankle.apply(body.up_vector), axis=0)), True)


def _foot(body: Body, leg: Leg, pose: Pose, up: Array, known: bool) -> _Foot:
    """The foot, with its toes as in a pose."""
    below = body.skeleton.subtree(leg.ankle)
    joints = [joint for joint in below if joint == leg.ankle or body.regions.of_joint[joint] >= 0]
    ankle = Rotation.from_quat(pose.rotations[leg.ankle])
    return _Foot(joints, ankle.inv().apply(pose.positions[joints] - pose.positions[leg.ankle]), up, known)
