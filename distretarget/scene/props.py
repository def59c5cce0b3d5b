"""Props that performers touch, hold or sit on, and where they go.

A prop keeps its shape: in each frame, a similarity takes it and the source's world around it to the target's world.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import NoneType
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.checks import check_kind, check_number
from distretarget.errors import MotionError, SettingsError
from distretarget.motion import Motion, check_reach
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.vectors import Array, extent
from distretarget.scene.prop_surface import PropSurface
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, ROTATION_CHANNELS, SMALLEST

PropScale = Literal["world"] | int | float

FREE_WEIGHT = 1e-6  # least weight of a prop's free place against the joints that hold it


@dataclass(frozen=True)
class Grip:
    """A joint that holds a prop while it is near the prop.

    Attributes:
        performer: the number of the performer, from 0.
        joint: the key of the joint in the performer's source.
    """

    performer: int
    joint: str

    def __post_init__(self) -> None:
        check_kind("performer", self.performer, int)
        check_kind("joint", self.joint, str)


@dataclass(frozen=True, eq=False, kw_only=True)
class Prop:
    """A prop in the world of the performers; performers may touch its joints.

    Attributes:
        name: its name.
        motion: its motion in the source; one frame for a prop that stands still.
        scale: target units per source unit: "world", the scale of the world along the floor; the number of a performer
            (an int), the scale of that performer's heights; or a factor (a float), 1.0 for a prop that keeps its size.
        held_by: the joints that hold it. The prop follows them while they are near it.
        surface: its surface, which the skins of performers lie on; None for the lines of the bones of its skeleton.

    Raises:
        SettingsError: the scale is none of these, or another argument has the wrong type.
        MotionError: positions are too large to compute with.
    """

    name: str
    motion: Motion
    scale: PropScale = "world"
    held_by: tuple[Grip, ...] = ()
    surface: PropSurface | None = None

    def __post_init__(self) -> None:
        check_kind("name", self.name, str)
        check_kind(f"the motion of {self.name!r}", self.motion, Motion)
        check_kind(f"held_by of {self.name!r}", self.held_by, tuple, list)
        for grip in self.held_by:
            check_kind(f"a joint that holds {self.name!r}", grip, Grip)
        check_kind(f"the surface of {self.name!r}", self.surface, PropSurface, NoneType)
        if isinstance(self.scale, float):
            check_number(f"the scale of {self.name!r}", self.scale, SMALLEST, LARGEST)
        elif isinstance(self.scale, bool) or not (isinstance(self.scale, int) or str(self.scale) == "world"):
            raise SettingsError(
                f"the scale of {self.name!r} is {self.scale!r}; expected 'world', the number of a performer or a factor"
            )
        check_reach(self.motion, repr(self.name))
        if isinstance(self.scale, float):
            self.check_size(self.scale, 0.0)

    def check_size(self, scale: float, farthest: float) -> None:
        """Raise a MotionError if with a scale the prop is too large to compute with, or gets as far as `farthest`."""
        size = extent(self.motion.positions - self.motion.root_positions[:, None])
        if not max(farthest, scale * size) <= LARGEST:
            raise MotionError(
                f"{self.name!r} reaches beyond {LARGEST:g} with a scale of {scale:g}; choose a smaller scale"
            )


def prop_of(motion: Motion, joint: str) -> Motion:
    """Return the motion of a joint and all joints below it, such as a sword in a hand, as a motion of its own.

    Raises:
        SkeletonError: there is no such joint.
        SettingsError: `motion` is not a motion.
    """
    check_kind("motion", motion, Motion)
    skeleton = motion.skeleton
    root = skeleton.index(joint)
    joints = np.sort([*skeleton.subtree(root)])
    channels = [skeleton.channels[each] for each in joints]
    channels[0] = (*POSITION_CHANNELS, *(channels[0][-3:] if len(channels[0]) >= 3 else ROTATION_CHANNELS))
    parents = np.searchsorted(joints, skeleton.parents[joints])
    parents[0] = -1
    below = replace(
        skeleton,
        names=tuple(skeleton.names[each] for each in joints),
        parents=parents,
        offsets=skeleton.offsets[joints],
        channels=tuple(channels),
        end_sites=np.append(False, skeleton.end_sites[joints[1:]]),
        humanoid=(),
    )
    translations, rotations = np.array(motion.translations[:, joints]), np.array(motion.rotations[:, joints])
    translations[:, 0], rotations[:, 0] = motion.positions[:, root], motion.world_rotations_of(root)
    return Motion.of_translations(below, translations, rotations, motion.frame_time_text)


@dataclass(frozen=True, eq=False)
class PropResult:
    """A prop among the retargeted performers.

    Attributes:
        name: its name.
        motion: its motion in the target's world, scaled.
        source: its motion in the source, in the target's axes.
        scale: target units per source unit of its size.
        copy: its motion among the rotation copies of the performers.
    """

    name: str
    motion: Motion
    source: Motion
    scale: float
    copy: Motion


@dataclass(frozen=True, eq=False)
class Placement:
    """The similarity that takes a prop, and the source's world around it, to the target's world in each frame."""

    centre: Array  # (frames, 3), the centre of the prop in the source [source file units]
    place: Array  # (frames, 3), where the centre goes [target file units]
    turn: Array  # (frames, 3, 3), the rotation about the centre
    scale: float  # target units per source unit

    def __call__(self, points: Array) -> Array:
        """The places of points (frames, points, 3)."""
        around = self.scale * (points - self.centre[:, None])
        return np.asarray(self.place[:, None] + around @ self.turn.swapaxes(1, 2))

    def moved(self, motion: Motion) -> Motion:
        """The motion of the prop in the target's world."""
        translations, rotations = self.scale * motion.translations, np.array(motion.rotations)
        translations[:, 0] = self(motion.positions[:, :1])[:, 0]
        rotations[:, 0] = (Rotation.from_matrix(self.turn) * Rotation.from_quat(rotations[:, 0])).as_quat()
        skeleton = motion.skeleton.with_offsets(self.scale * motion.skeleton.offsets)
        return Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)


@dataclass(frozen=True, eq=False)
class PlacedProp:
    """A prop in the world of the performers."""

    name: str
    motion: Motion  # in the source, in the target's axes
    free: Placement  # where it goes while nobody holds it
    grips: Mapping[int, tuple[int, ...]]  # the target joints that hold it, by the numbers of their performers
    surface: PropSurface | None = None  # None for its bones


class Hold(NamedTuple):
    """A joint that holds a prop."""

    weight: Array  # (frames,), 1 while it holds the prop, blended to 0
    source: Array  # (frames, 3), where its driver is [source file units]
    place: Array  # (frames, 3), where it is on the target [target file units]
    turn: Array  # (frames, 3, 3), its rotation against the rotation copy, which turns as the source does
    lever: float  # its rotation weighs as much as a point at this distance [target file units]


def held_placement(free: Placement, holds: Sequence[Hold]) -> Placement:
    """Place a prop that joints hold by the best fit, in place and rotation, to all of them (Kabsch)."""
    loose = np.maximum(1.0 - np.max([hold.weight for hold in holds], axis=0), FREE_WEIGHT)
    weights = np.stack([loose, *(hold.weight for hold in holds)])[..., None]
    a = np.stack([0.0 * free.centre, *(free.scale * (hold.source - free.centre) for hold in holds)])
    b = np.stack([free.place, *(hold.place for hold in holds)])
    middle_a, middle_b = ((weights * x).sum(axis=0) / weights.sum(axis=0) for x in (a, b))
    H = np.einsum("hfi,hfj->fij", weights * (b - middle_b), a - middle_a)
    lever = max(hold.lever for hold in holds)
    H += (lever**2 * loose)[:, None, None] * np.eye(3)
    for hold in holds:
        H += (hold.lever**2 * hold.weight)[:, None, None] * hold.turn
    turn = nearest_rotations(H)
    return Placement(free.centre, middle_b - np.einsum("fij,fj->fi", turn, middle_a), turn, free.scale)
