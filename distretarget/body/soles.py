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
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.rotations import least_matrix
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import lengths, normalised

Array = NDArray[np.float64]

PITCH = np.radians(10)  # feet that rest with heel or toes lifted by up to this on average lie flat [rad]
ROLL = np.radians(30)  # feet that rest leaning to the side by up to this on average lie flat [rad]
LEVEL = 0.03  # a sole that rests nearer to a level floor than this lies on it; from twice this on not [leg lengths]
GROUND = 0.15  # soles that rest within this of the floor show whether it is level [leg lengths]:
SURELY = 0.65  # it is if this share of them is nearer to it than `LEVEL`, and
HARDLY = 0.4  # it is not if it is no more than this
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


def resting_normals(motion: Motion, legs: Legs, soles: tuple[Sole, ...], up: Array) -> tuple[Array, Array]:
    """Return the normals of the soles of both legs as feet rest in a motion, (3,) each, in the axes of the ankles.

    Feet rest on the floor, but rest poses do not always show how: rigs whose legs are splayed there stand on the edges
    of their feet. The median of up while ankle and toe rest is taken, as far as it is up to `PITCH` and `ROLL` off the
    `soles` as known otherwise; of more, less is, and nothing from twice that on: feet may stand on their toes.
    """
    left, right = (
        _resting_normal(motion, leg, sole.normal, up, leg_length(motion.skeleton, legs))
        for leg, sole in zip(legs, soles, strict=True)
    )
    return left, right


def _resting_normal(motion: Motion, leg: Leg, normal: Array, up: Array, length: float) -> Array:
    """The normal of the sole of one leg, (3,)."""
    resting = np.flatnonzero(feet_at_rest(motion, leg, up, length).all(axis=1))
    if not len(resting):
        return normal
    to_ankle = Rotation.from_quat(motion[resting].world_rotations_of(leg.ankle)).inv()
    positions = motion.positions[resting]
    found = normalised(np.median(to_ankle.apply(up), axis=0))
    toe = np.median(to_ankle.apply(positions[:, leg.toe] - positions[:, leg.ankle]), axis=0)
    axes = np.stack([aside := normalised(np.cross(normal, toe)), np.cross(aside, normal)])
    axis = np.cross(normal, found)
    angles = axes @ normalised(axis) * np.arctan2(np.linalg.norm(axis), normal @ found)
    angles *= 1.0 - smoothstep(np.abs(angles) / [PITCH, ROLL] - 1.0)
    return np.asarray(Rotation.from_rotvec(angles @ axes).apply(normal))


def sole_height(motion: Motion, sole: Sole, up: Array) -> Array:
    """Return the height of the lowest point of a sole over a motion, (frames,) [file units]. The points are beneath the
    joints of the foot, as far as while it stands flat; a foot on its back has its joints.
    """
    upwards = Rotation.from_quat(motion.world_rotations_of(sole.joints.item(0))).apply(sole.normal) @ up
    points = heights_of(motion.positions, sole.joints, up) - np.outer(np.maximum(upwards, 0.0), sole.heights)
    return np.asarray(points.min(axis=1))


def floor_height(heights: Array, rests: NDArray[np.bool_]) -> float:
    """Return the height of the floor from those of soles, which rest or not, (frames, legs) each: the mean of the
    medians of both legs; infinite where none rests.
    """
    medians = [np.median(sole[on]) for sole, on in zip(heights.T, rests.T, strict=True) if on.any()]
    return float(np.mean(medians)) if medians else np.inf


def level_on_floor(heights: Array, floor: float, rests: NDArray[np.bool_], length: float) -> Array:
    """Return the heights of soles, (frames, legs), with those on a floor of this height where it is level:
    floor + f(height - floor), f(d) = d smoothstep(|d| / `LEVEL` - 1). On a slope nothing changes, nor on steps.
    `rests`, (frames, legs), says which soles rest; `length` is that of a leg.
    """
    off = np.abs(heights - floor) / length
    near = off[rests & (off <= GROUND)]
    if not len(near):
        return heights
    is_level = smoothstep((np.mean(near <= LEVEL, keepdims=True) - HARDLY) / (SURELY - HARDLY))
    return np.asarray(heights - is_level * (heights - floor) * (1.0 - smoothstep(off / LEVEL - 1.0)))


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
