"""A motion: a skeleton, and the translations and rotations of its joints in each frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypedDict, get_args

import numpy as np
from numpy.typing import NDArray

from distretarget.arguments import check_kind
from distretarget.errors import MotionError, quoted
from distretarget.numerics.blocks import in_blocks
from distretarget.numerics.kinematics import forward_kinematics, local_rotations, world_rotations
from distretarget.numerics.rotations import RotationKind, represented
from distretarget.numerics.vectors import lengths
from distretarget.skeleton import Skeleton

SHORTEST_FRAME, LONGEST_FRAME = 1e-5, 1e3  # the times between frames that a recording may have [s]
UNIT_ERROR = 1e-6  # how far the length of a unit quaternion may be off
NUMERALS = frozenset("0123456789.+-eE")


def is_frame_time(text: str) -> bool:
    """Return whether a text is a time between frames: a decimal number from 1e-5 to 1e3 [s]."""
    try:
        return NUMERALS.issuperset(text) and SHORTEST_FRAME <= float(text) <= LONGEST_FRAME
    except ValueError:
        return False


class MotionArrays(TypedDict):
    """A motion as arrays that numpy stores and loads without pickle.

    Attributes:
        names: (joints,), the unique names of the joints (`Skeleton.keys`).
        parents: (joints,), the number of each joint's parent, -1 for the root.
        offsets: (joints, 3), each joint's translation from its parent in the rest pose [file units].
        end_sites: (joints,), true for End Sites.
        frame_time: the time between frames [s].
        root_path: (frames, 3), the positions of the root in the world [file units].
        positions: (frames, joints, 3), the positions of the joints in the world [file units].
        local_rotations, world_rotations: rotations relative to the parent and in the world, (frames, joints, 4),
            (frames, joints, 3, 3) or (frames, joints, 6).
    """

    names: NDArray[np.str_]
    parents: NDArray[np.intp]
    offsets: NDArray[np.float64]
    end_sites: NDArray[np.bool_]
    frame_time: float
    root_path: NDArray[np.float64]
    positions: NDArray[np.float64]
    local_rotations: NDArray[np.float64]
    world_rotations: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """A skeleton in motion. Axes are right-handed; quaternions are x y z w, as in scipy.

    Attributes:
        skeleton: the skeleton.
        translations: (frames, joints, 3), each joint's translation from its parent, for the root its
            position in the world [file units]. It equals the offset where no channel replaces that.
        rotations: (frames, joints, 4), rotations relative to the parent, as unit quaternions.
        frame_time_text: the time between frames [s] as the file spells it, digit for digit.

    Raises:
        MotionError: the shapes of the arrays do not fit the skeleton or each other, a rotation is not a unit
            quaternion, or the frame time is not a number from 1e-5 to 1e3.
        SettingsError: `skeleton` is something else.
    """

    skeleton: Skeleton
    translations: NDArray[np.float64]
    rotations: NDArray[np.float64]
    frame_time_text: str

    def __post_init__(self) -> None:
        check_kind("skeleton", self.skeleton, Skeleton)
        joints = len(self.skeleton)
        for name, width in (("translations", 3), ("rotations", 4)):
            try:
                array = np.asarray(getattr(self, name), np.float64).view()
            except (TypeError, ValueError) as error:
                raise MotionError(f"{name} is not an array of numbers: {error}") from error
            if array.ndim != 3 or array.shape[1:] != (joints, width):
                raise MotionError(f"{name} has shape {array.shape}, {joints} joints need (frames, {joints}, {width})")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if len(self.translations) != len(self.rotations):
            raise MotionError(f"{len(self.translations)} frames of translations, {len(self.rotations)} of rotations")
        wrong = in_blocks(lambda block: ~(np.abs(lengths(self.rotations[block]) - 1.0) < UNIT_ERROR), len(self))
        if wrong.any():
            frame, joint = np.argwhere(wrong)[0]
            where = f"of {self.skeleton.keys[joint]!r} in frame {frame}"
            raise MotionError(f"the rotation {where} is not a unit quaternion: {self.rotations[frame, joint].tolist()}")
        if not isinstance(self.frame_time_text, str) or not is_frame_time(self.frame_time_text):
            wanted = f"a number of seconds from {SHORTEST_FRAME:g} to {LONGEST_FRAME:g}, as text"
            raise MotionError(f"frame_time_text is {self.frame_time_text!r}; expected {wanted}")

    def __len__(self) -> int:
        return len(self.rotations)

    def __getitem__(self, frames: slice | NDArray[np.intp]) -> Motion:
        """Return the motion of some frames, by a slice or an array of their numbers, at the same frame time."""
        return replace(self, translations=self.translations[frames], rotations=self.rotations[frames])

    def __repr__(self) -> str:
        return f"<Motion of {len(self)} frames, {self.frame_time_text} s each, on {self.skeleton!r}>"

    @property
    def frame_time(self) -> float:
        """The time between frames [s]."""
        return float(self.frame_time_text)

    @property
    def root_positions(self) -> NDArray[np.float64]:
        """(frames, 3), the root's path [file units]."""
        return self.translations[:, 0]

    @property
    def world_rotations(self) -> NDArray[np.float64]:
        """(frames, joints, 4), each joint's rotation in the world; computed whenever it is asked for."""
        return world_rotations(self.skeleton.parents, self.rotations)

    def world_rotations_of(self, joint: int) -> NDArray[np.float64]:
        """(frames, 4), the rotation of one joint in the world."""
        line = self.skeleton.line(joint)[::-1]
        return world_rotations(np.arange(len(line)) - 1, np.take(self.rotations, line, axis=1))[:, -1]

    @cached_property
    def positions(self) -> NDArray[np.float64]:
        """(frames, joints, 3), each joint's position in the world, by forward kinematics [file units]."""
        return forward_kinematics(self.skeleton.parents, self.translations, self.world_rotations)

    def to_dict(self, rotations: RotationKind = "quaternion") -> MotionArrays:
        """Return the motion as arrays.

        Rotations are given as "quaternion" (x y z w), "matrix", or "6d" (the first two columns of the matrix).

        Raises:
            MotionError: `rotations` is none of these.
        """
        if not isinstance(rotations, str) or rotations not in get_args(RotationKind):
            raise MotionError(f"rotations is {rotations!r}; expected one of {quoted(get_args(RotationKind))}")
        return MotionArrays(
            names=np.array(self.skeleton.keys),
            parents=self.skeleton.parents,
            offsets=self.skeleton.offsets,
            end_sites=self.skeleton.end_sites,
            frame_time=self.frame_time,
            root_path=self.root_positions,
            positions=self.positions,
            local_rotations=represented(self.rotations, rotations),
            world_rotations=represented(self.world_rotations, rotations),
        )

    @cached_property
    def rigid_skeleton(self) -> Skeleton:
        """The skeleton with rigid bones as the frames show them.

        Bones whose translation is their offset in all frames keep it. The others have the direction of their median
        translation over the frames, and their median length.
        """
        rows = self.translations.reshape(len(self), 3 * len(self.skeleton))  # numpy is fast along rows
        moving = (rows != self.skeleton.offsets.ravel()).any(axis=0).reshape(-1, 3).any(axis=1)
        moving[0] = False
        if not moving.any():
            return self.skeleton
        offsets = np.array(self.skeleton.offsets)
        offsets[moving] = np.median(self.translations[:, moving], axis=0)
        bones = lengths(offsets)
        bones[moving] = np.median(lengths(self.translations[:, moving]), axis=0)
        return self.skeleton.with_offsets(offsets).with_lengths(bones)


def rigid_motion(
    skeleton: Skeleton,
    root_positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
    frame_time_text: str,
) -> Motion:
    """Return the motion with a root path, (frames, 3), and local rotations, (frames, joints, 4), on rigid bones."""
    translations = np.array(np.broadcast_to(skeleton.offsets, (len(rotations), len(skeleton), 3)))
    translations[:, 0] = root_positions
    return Motion(skeleton, translations, rotations, frame_time_text)


def motion_of_world(
    skeleton: Skeleton,
    root_positions: NDArray[np.float64],
    world: NDArray[np.float64],
    frame_time_text: str,
) -> Motion:
    """Return the motion with a root path, (frames, 3), and world rotations, (frames, joints, 4), on rigid bones."""
    motion = rigid_motion(skeleton, root_positions, local_rotations(skeleton.parents, world), frame_time_text)
    # What `positions` would compute, without turning local rotations back into those of the world.
    vars(motion)["positions"] = forward_kinematics(skeleton.parents, motion.translations, world)
    return motion
