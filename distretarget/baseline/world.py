"""Where a motion is in the world: which axis points up, where the floor is, what the root's OFFSET means."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import Anatomy
from distretarget.body.axes import is_pose, upwards
from distretarget.body.legs import find_legs, leg_length, up_axis
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.rotations import least_rotation
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

Array = NDArray[np.float64]
RootOffset = Literal["replaced", "added"]

AXES = ("X", "Y", "Z", "-X", "-Y", "-Z")
STANDS = 0.7  # mean cosine between an axis and a body that stands along it in motion
TELLS = 0.3  # the same, from which a body without a rest pose tells it at all
ON_FLOOR = 0.1  # [leg lengths] feet so near to height 0 are on the floor ...
OFF_FLOOR = 0.25  # ... and so far from it they are not


def axis_vector(axis: str) -> Array:
    """(3,), the unit vector of one of `AXES`."""
    vector = np.zeros(3)
    vector["XYZ".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return vector


def up_of_motion(motion: Motion, anatomy: Anatomy | None) -> str | None:
    """Which of `AXES` points up: the one along which the body stands in motion, or in its rest pose; None where there
    is no body to tell.

    Where the two differ, the rest pose is right about who lies on the floor, and the motion if its feet are on the
    floor, at height 0 along its axis: then the file's world is another than its rest pose's.
    """
    if anatomy is None or not len(motion):
        legs = find_legs(motion.rigid_skeleton)
        return _axis(up_axis(motion.positions, legs))[0] if legs and len(motion) else None
    axis, cosine = _axis(upwards(anatomy, motion.positions).mean(axis=0))
    rest = up_of_rest(motion.rigid_skeleton, anatomy)
    if rest is None and cosine < TELLS:
        return None
    stands = cosine > STANDS and abs(_lowest(motion, axis_vector(axis))) < OFF_FLOOR * _leg(motion.rigid_skeleton)
    return axis if rest is None or stands else rest


def up_of_rest(skeleton: Skeleton, anatomy: Anatomy | None) -> str | None:
    """Which of `AXES` points up in the rest pose; None where that is no pose in which a body stands."""
    if anatomy is None or not is_pose(skeleton, anatomy):
        return None
    return _axis(upwards(anatomy, skeleton.rest_positions))[0]


def _axis(direction: Array) -> tuple[str, float]:
    """The axis nearest to a direction (3,), and the direction's component along it."""
    signed = np.concatenate([direction, -direction])
    return AXES[int(np.argmax(signed))], float(signed.max())


@dataclass(frozen=True)
class World:
    """How a source's world becomes the target's.

    Attributes:
        source_up, up: which of `AXES` points up in the source's file, and in the target's.
        root_offset: what the position channels of the source's root do to its OFFSET.
    """

    source_up: str
    up: str
    root_offset: RootOffset

    @property
    def up_vector(self) -> Array:
        """(3,), up in the target's world."""
        return axis_vector(self.up)

    def enter(self, source: Motion) -> Motion:
        """The source's motion in the target's world."""
        return turned(with_root_offset(source) if self.root_offset == "added" else source, self.source_up, self.up)


def find_world(
    source: Motion,
    matching: Matching,
    source_up: str | None,
    up: str | None,
    offset: RootOffset | None,
    target_motion: Motion | None = None,
) -> World:
    """The world of source and target, as far as it is not given.

    Up in the source is as its motion tells. Up in the target is what its file says; else as a motion of it tells, but
    not where it is no body and the source is one; else, if both rest poses stand along the same axis, as in the source;
    else the axis along which the target's rest pose stands. Where nothing tells, Y is up.
    """
    s, t = matching.anatomies
    source_up = source_up or up_of_motion(source, s) or "Y"
    stands, rest = up_of_rest(source.rigid_skeleton, s), up_of_rest(matching.target, t)
    tells = target_motion if t or not s else None
    up = up or matching.target.up or (up_of_motion(tells, t) if tells else None)
    up = up or (source_up if rest in (None, stands) else rest)
    return World(source_up, up, offset or root_offset_of(source, axis_vector(source_up)))


def turned(motion: Motion, up: str, onto: str) -> Motion:
    """The motion in a world where the axis `onto` points up instead of `up`, turned there by the least rotation: so
    what faces Z with Y up faces -Y with Z up.
    """
    if up == onto:
        return motion
    turn = Rotation.from_quat(least_rotation(axis_vector(up)[None], axis_vector(onto)[None])[0])
    translations, rotations = np.array(motion.translations), np.array(motion.rotations)
    translations[:, 0] = turn.apply(translations[:, 0])
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    return replace(motion, translations=translations, rotations=rotations)


def root_offset_of(motion: Motion, up: Array) -> RootOffset:
    """Whether the root's position channels replace its OFFSET or are added to it, which nothing in a file says.

    They are added if that puts the feet on the floor, at height 0, and replacing leaves them clearly off it. `up` is
    (3,).
    """
    length = _leg(motion.rigid_skeleton)
    rise = float(motion.skeleton.offsets[0] @ up)
    if not length or not len(motion) or not set(POSITION_CHANNELS) <= set(motion.skeleton.channels[0]):
        return "replaced"
    lowest = _lowest(motion, up)
    return "added" if abs(lowest) > OFF_FLOOR * length and abs(lowest + rise) < ON_FLOOR * length else "replaced"


def _leg(skeleton: Skeleton) -> float:
    """The length of the legs; 0 without [file units]."""
    legs = find_legs(skeleton)
    return leg_length(skeleton, legs) if legs else 0.0


def _lowest(motion: Motion, up: Array) -> float:
    """The height of the lowest joint in the lowest frames, the 2nd percentile of them [file units]."""
    return float(np.percentile((motion.positions @ up).min(axis=1), 2))


def with_root_offset(motion: Motion) -> Motion:
    """The motion with the root's OFFSET added to its positions."""
    translations = np.array(motion.translations)
    translations[:, 0] += motion.skeleton.offsets[0]
    return replace(motion, translations=translations)
