"""A motion: a skeleton, and the translations and rotations of its joints in each frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from html import escape
from types import NoneType
from typing import TypedDict, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.checks import check_kind, check_number
from distretarget.errors import MotionError, counted, quoted
from distretarget.numerics.kinematics import joint_positions, line_rotations, make_local, world_rotations
from distretarget.numerics.parallel import in_blocks, over_blocks
from distretarget.numerics.quaternions import first_not_unit
from distretarget.numerics.rotations import RotationKind, represented
from distretarget.numerics.vectors import Array, extent, lengths, normalised, read_only
from distretarget.skeleton import HALF_TURN, LARGEST, SMALLEST, Skeleton
from distretarget.stick_figures import likely_up, stick_figures

SHORTEST_FRAME, LONGEST_FRAME = 1e-5, 1e3  # bounds of the frame time [s]
SLOWEST, FASTEST = 1e-3, 1e5  # the same bounds as frame rates [frames/s]
UNIT_ERROR = 1e-6  # tolerance of the length of a unit quaternion
ROUNDING = 1e-9  # quaternions off length 1 by more are normalised: float32 is off by 1e-7, float64 by 1e-15
MOST_SAMPLES = 20  # resampling makes at most this many frames of each frame ...
FREE_SAMPLES = 1_000_000  # ... unless the result is smaller than this [frames x joints]
SAME_TIME = 1e-6  # tolerance within which two frame times are the same [of the frame time]
SHOWN = 7  # postures in a picture of a motion
NUMERALS = frozenset("0123456789.+-eE")


def _check_frame_time(text: object) -> None:
    if not isinstance(text, str) or not is_frame_time(text):
        wanted = f"a number of seconds from {SHORTEST_FRAME:g} to {LONGEST_FRAME:g}, as text"
        raise MotionError(f"frame_time_text is {text!r}; expected {wanted}")


def is_frame_time(text: str) -> bool:
    """Return whether a text is a valid frame time: a decimal number from 1e-5 to 1e3 [s]."""
    try:
        return NUMERALS.issuperset(text) and SHORTEST_FRAME <= float(text) <= LONGEST_FRAME
    except ValueError:
        return False


def same_time(one: float, other: float) -> bool:
    """Return whether two frame times [s] differ in their last digits at most."""
    return abs(one - other) <= SAME_TIME * one


class MotionArrays(TypedDict):
    """A motion as arrays that numpy stores and loads without pickle.

    Attributes:
        names: (joints,), unique joint names (`Skeleton.keys`).
        parents, offsets, end_sites: as in `Skeleton`.
        frame_time: time between frames [s].
        root_path, positions: (frames, 3) and (frames, joints, 3), world positions of root and joints [file units].
        local_rotations, world_rotations: relative to the parent and in the world, (frames, joints, 4),
            (frames, joints, 3, 3) or (frames, joints, 6).
    """

    names: NDArray[np.str_]
    parents: NDArray[np.intp]
    offsets: Array
    end_sites: NDArray[np.bool_]
    frame_time: float
    root_path: Array
    positions: Array
    local_rotations: Array
    world_rotations: Array


@dataclass(frozen=True, eq=False)
class MovingBones:
    """Bones that stretch or slide: in some frame their translation differs from their offset.

    Attributes:
        joints: (bones,), the lower joint of each bone, in ascending order; never the root.
        translations: (frames, bones, 3), each joint's translation from its parent [file units].

    Raises:
        MotionError: the shapes do not match, or the joints are not in order.
    """

    joints: NDArray[np.intp]
    translations: Array

    def __post_init__(self) -> None:
        joints = np.asarray(self.joints)
        whole = joints.ndim == 1 and joints.dtype.kind == "i" and len(joints) > 0
        if not whole or not (np.diff(joints, prepend=0) > 0).all():
            raise MotionError(f"joints is {joints.tolist()}; expected numbers of joints from 1, in ascending order")
        exact = _as_array("translations", self.translations, ("frames", len(joints), 3))
        object.__setattr__(self, "joints", read_only(joints.astype(np.intp)))
        object.__setattr__(self, "translations", read_only(exact))

    @classmethod
    def among(cls, skeleton: Skeleton, joints: NDArray[np.intp], translations: Array) -> MovingBones | None:
        """Return the bones of `joints` that move, by `translations`, (frames, joints, 3); None if none does."""
        moving = (translations != skeleton.offsets[joints]).any(axis=(0, 2)) & (joints > 0)
        return cls(joints[moving], translations[:, moving]) if moving.any() else None

    def __getitem__(self, frames: slice | NDArray[np.intp]) -> MovingBones:
        return MovingBones(self.joints, self.translations[frames])


@dataclass(frozen=True, eq=False)
class Motion:
    """A skeleton in motion. Axes are right-handed; quaternions are x y z w, as in scipy.

    Attributes:
        skeleton: the skeleton.
        root_positions: (frames, 3), world positions of the root [file units].
        rotations: (frames, joints, 4), rotations relative to the parent, as unit quaternions; rounding to float32 is
            corrected.
        frame_time_text: the time between frames [s], with the digits of the file.
        moving: the bones that stretch or slide; None if all keep their offset.

    Raises:
        MotionError: shapes do not match the skeleton or each other, a rotation is not a unit quaternion, or the frame
            time is not a number from 1e-5 to 1e3.
        SettingsError: `skeleton` or `moving` is of another type.
    """

    skeleton: Skeleton
    root_positions: Array
    rotations: Array
    frame_time_text: str
    moving: MovingBones | None = None

    def __post_init__(self) -> None:
        check_kind("skeleton", self.skeleton, Skeleton)
        check_kind("moving", self.moving, MovingBones, NoneType)
        joints = len(self.skeleton)
        for name, shape in (("root_positions", ("frames", 3)), ("rotations", ("frames", joints, 4))):
            object.__setattr__(self, name, read_only(_as_array(name, getattr(self, name), shape)))
        frames = len(self.rotations)
        if len(self.root_positions) != frames:
            raise MotionError(f"{len(self.root_positions)} frames of root_positions, {frames} of rotations")
        if self.moving is not None and (len(self.moving.translations) != frames or self.moving.joints[-1] >= joints):
            found = f"{len(self.moving.translations)} frames of joints {self.moving.joints.tolist()}"
            raise MotionError(f"moving has {found}; expected {frames} frames of joints below {joints}")
        every = np.ascontiguousarray(self.rotations).reshape(-1, 4)
        if (wrong := first_not_unit(every, UNIT_ERROR)) >= 0:
            where = f"of {self.skeleton.keys[wrong % joints]!r} in frame {wrong // joints}"
            raise MotionError(f"the rotation {where} is not a unit quaternion: {every[wrong].tolist()}")
        if first_not_unit(every, ROUNDING) >= 0:
            object.__setattr__(self, "rotations", read_only(normalised(self.rotations)))
        _check_frame_time(self.frame_time_text)

    @classmethod
    def of_translations(cls, skeleton: Skeleton, translations: Array, rotations: Array, frame_time_text: str) -> Motion:
        """Return the motion with given `translations` (see the property); other arguments and errors as in `Motion`."""
        check_kind("skeleton", skeleton, Skeleton)
        exact = _as_array("translations", translations, ("frames", len(skeleton), 3))
        moving = MovingBones.among(skeleton, np.arange(len(skeleton)), exact)
        return cls(skeleton, np.ascontiguousarray(exact[:, 0]), rotations, frame_time_text, moving)

    def __len__(self) -> int:
        return len(self.rotations)

    def __getitem__(self, frames: int | slice | NDArray[np.intp]) -> Motion:
        """Return the motion of one frame, a slice of frames or an array of frame indices; else an IndexError."""
        if isinstance(frames, slice) and frames == slice(0, len(self)):
            return self
        if isinstance(frames, int | np.integer):
            frames = np.arange(len(self))[[frames]]
        path, moving = self.root_positions[frames], None if self.moving is None else self.moving[frames]
        part = replace(self, root_positions=path, rotations=self.rotations[frames], moving=moving)
        if "positions" in vars(self):
            vars(part)["positions"] = np.ascontiguousarray(self.positions[frames])
        return part

    def __repr__(self) -> str:
        return f"<Motion of {len(self)} frames, {self.frame_time_text} s each, on {self.skeleton!r}>"

    def _repr_html_(self) -> str:
        text = f"<p>{escape(repr(self))}</p>"
        if not len(self):
            return text
        some = self.positions[np.linspace(0, len(self) - 1, min(len(self), SHOWN)).astype(int)]
        return stick_figures(self.skeleton.parents, some, likely_up(some[0], self.skeleton.up), repr(self)) + text

    @property
    def frame_time(self) -> float:
        """The time between frames [s]."""
        return float(self.frame_time_text)

    @property
    def translations(self) -> Array:
        """(frames, joints, 3), translations from the parent, for the root from the origin [file units]; not cached."""
        return self._translations_in(slice(None))

    def _translations_in(self, frames: slice) -> Array:
        path = self.root_positions[frames]
        translations = np.tile(self.skeleton.offsets, (len(path), 1, 1))
        translations[:, 0] = path
        if self.moving is not None:
            translations[:, self.moving.joints] = self.moving.translations[frames]
        return translations

    def translations_of(self, joint: int) -> Array:
        """(frames, 3), the `translations` of one joint."""
        if joint == 0:
            return self.root_positions
        if self.moving is not None and joint in self.moving.joints:
            return np.asarray(self.moving.translations[:, self.moving.joints.searchsorted(joint)])
        return np.broadcast_to(self.skeleton.offsets[joint], (len(self), 3))

    @property
    def world_rotations(self) -> Array:
        """(frames, joints, 4), the rotation of each joint in the world; not cached."""
        return self.world_rotations_in(slice(None))

    def world_rotations_in(self, frames: slice) -> Array:
        """(frames, joints, 4), the world rotations in some frames."""
        return world_rotations(self.skeleton.parents, self.rotations[frames])

    def world_rotations_of(self, joint: int) -> Array:
        """(frames, 4), the world rotations of one joint; cached."""
        cache: dict[int, Array] = vars(self).setdefault("_rotation_cache", {})
        if joint not in cache:
            line = np.array(self.skeleton.to_root(joint)[::-1], np.intp)
            cache[joint] = read_only(line_rotations(line, self.rotations))
        return cache[joint]

    @cached_property
    def positions(self) -> Array:
        """(frames, joints, 3), the world positions of the joints, by forward kinematics [file units]."""
        positions = np.empty((len(self), len(self.skeleton), 3))

        def place(block: slice) -> None:
            positions[block] = self._placed(block)

        over_blocks(place, *positions.shape[:2])
        return positions

    def positions_in(self, frames: slice) -> Array:
        """(frames, joints, 3), the `positions` in some frames; only those are computed unless all are cached."""
        return self.positions[frames] if "positions" in vars(self) else self._placed(frames)

    def positions_of(self, joints: NDArray[np.intp]) -> Array:
        """(frames, some joints, 3), the `positions` of some joints; not cached."""
        return in_blocks(lambda block: np.take(self.positions_in(block), joints, axis=1), len(self))

    def _placed(self, frames: slice) -> Array:
        bones = self.skeleton.offsets[None] if self.moving is None else self._translations_in(frames)
        world = self.world_rotations_in(frames)
        return joint_positions(self.skeleton.parents, self.root_positions[frames], bones, world)

    def clear_cache(self) -> None:
        """Free the cached positions and world rotations; they are computed again when needed."""
        for name in ("positions", "_rotation_cache"):
            vars(self).pop(name, None)

    @property
    def bones(self) -> Array:
        """(frames, joints, 3), from each joint's parent to it in the world [file units]; not cached."""
        bones = np.take(self.positions, self.skeleton.parents, axis=1)
        return np.subtract(self.positions, bones, out=bones)

    def facing_forward(self) -> Motion:
        """Return the motion of the body facing +Z by convention: turned if it faced -Z, see `Skeleton`."""
        return self.turned_round() if self.skeleton.faces_negative_z else self

    def turned_round(self) -> Motion:
        """Return the motion turned by 180 degrees about Y, rest pose included (`Skeleton.turned_round`)."""
        rotations = self.rotations * np.append(HALF_TURN, 1.0)
        return self._with_vectors(lambda each: each * HALF_TURN, self.skeleton.turned_round(), rotations)

    def _with_vectors(self, change: Callable[[Array], Array], skeleton: Skeleton, rotations: Array) -> Motion:
        """The motion on another skeleton, with the positions of the root and the translations of bones changed."""
        moving = self.moving and MovingBones(self.moving.joints, change(self.moving.translations))
        return Motion(skeleton, change(self.root_positions), rotations, self.frame_time_text, moving)

    def rotated_about_origin(self, turn: Rotation) -> Motion:
        """Return the motion rotated about the origin of the world: by one rotation, or by one for each frame."""
        rotations = np.array(self.rotations)
        rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
        return replace(self, root_positions=turn.apply(np.array(self.root_positions)), rotations=rotations)

    def with_rest_turned(self, turn: Rotation) -> Motion:
        """Return the motion rotated about the origin of the world, rest pose included; no axis is stated to be up."""
        around = Rotation.from_quat(np.array(self.rotations).reshape(-1, 4))
        skeleton = replace(self.skeleton, offsets=_turned(self.skeleton.offsets, turn), up=None)
        rotations = (turn * around * turn.inv()).as_quat().reshape(self.rotations.shape)
        return self._with_vectors(partial(_turned, turn=turn), skeleton, rotations)

    def moved(self, by: Array) -> Motion:
        """Return the motion displaced by a vector, (3,), or by one in each frame, (frames, 3) [file units]."""
        return replace(self, root_positions=self.root_positions + by) if by.any() else self

    def scaled(self, factor: float) -> Motion:
        """Return the motion with body and path scaled by a factor; a SettingsError if it is not above 0."""
        check_number("factor", factor, SMALLEST, LARGEST)
        skeleton = self.skeleton.with_offsets(factor * self.skeleton.offsets)
        return self._with_vectors(lambda each: factor * each, skeleton, self.rotations)

    def resampled_frames(self, frame_time_text: str) -> int:
        """Return the number of frames at another frame time."""
        step = float(frame_time_text)
        if not len(self) or same_time(self.frame_time, step):
            return len(self)
        return int((len(self) - 1) * self.frame_time / step + SAME_TIME) + 1

    def resampled(self, frame_time_text: str, most: int | None = None) -> Motion:
        """Return the motion at another frame time, interpolated linearly; if given, only the first `most` frames. A
        MotionError if the frame time is invalid, or makes far more frames than the motion has.
        """
        _check_frame_time(frame_time_text)
        step = float(frame_time_text)
        if same_time(self.frame_time, step):
            return self if most is None or most >= len(self) else self[:most]
        frames, last, joints = self.resampled_frames(frame_time_text), len(self) - 1, len(self.skeleton)
        if most is None and frames * joints > max(FREE_SAMPLES, MOST_SAMPLES * len(self) * joints):
            raise MotionError(
                f"lasts {last * self.frame_time:g} s, which are {frames:,} frames of {step:g} s; expected at most "
                f"{MOST_SAMPLES} for each of its {counted(len(self), 'frame')}; choose a lower frame rate"
            )
        times = np.arange(min(frames, frames if most is None else most)) * step / self.frame_time  # [frames]
        before = np.minimum(times.astype(int), last)
        after, share = np.minimum(before + 1, last), (times - before)[:, None, None]
        start, end = (Rotation.from_quat(self.rotations[frames]) for frames in (before, after))
        turns = (start.inv() * end).as_rotvec() * share
        every = self.translations
        translations = every[before] + share * (every[after] - every[before])
        rotations = (start * Rotation.from_rotvec(turns)).as_quat()
        return Motion.of_translations(self.skeleton, translations, rotations, frame_time_text)

    def to_dict(self, rotations: RotationKind = "quaternion") -> MotionArrays:
        """Return the motion as arrays; rotations as "quaternion" (x y z w), "matrix", or "6d", its first columns."""
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
        """The skeleton with rigid bones: moving bones get their median direction and length over the frames."""
        if self.moving is None:
            return self.skeleton
        joints, offsets = self.moving.joints, np.array(self.skeleton.offsets)
        offsets[joints] = np.median(self.moving.translations, axis=0)
        bones = lengths(offsets)
        bones[joints] = np.median(lengths(self.moving.translations), axis=0)
        return self.skeleton.with_offsets(offsets).with_lengths(bones)


def check_reach(motion: Motion, name: str) -> None:
    """Raise a MotionError if positions of a motion are not finite, or too large to compute with; `name` names it."""
    if not np.isfinite(reach := extent(motion.positions)):
        raise MotionError(f"{name} has positions that are not finite; every number has to be")
    if reach > LARGEST:
        raise MotionError(f"{name} has positions beyond {LARGEST:g}; its OFFSETs or position channels must be wrong")


def check_usable(motion: Motion, name: str) -> None:
    """Raise a MotionError if a motion has no frames, no bone with a length, or positions as in `check_reach`."""
    if not len(motion):
        raise MotionError(f"{name} has no frames; expected one or more")
    check_reach(motion, name)
    if not motion.rigid_skeleton.lengths.max() >= SMALLEST:
        raise MotionError(f"no bone of {name} has a length, at least {SMALLEST:g}; export it with its bones")


def motion_of_world(
    skeleton: Skeleton, frames: int, frame_time_text: str, pose: Callable[[slice, Array], Array]
) -> Motion:
    """Return a motion on rigid bones. `pose(block, world)` writes the world rotations of a block of frames to `world`,
    (frames, joints, 4), and returns the root positions, (frames, 3) [file units]; several threads call it at once.
    """
    joints = len(skeleton)
    path, rotations, positions = (np.empty((frames, *shape)) for shape in ((3,), (joints, 4), (joints, 3)))

    def make(block: slice) -> None:
        world = rotations[block]
        path[block] = pose(block, world)
        positions[block] = joint_positions(skeleton.parents, path[block], skeleton.offsets[None], world)
        make_local(skeleton.parents, world)

    over_blocks(make, frames, joints)
    motion = Motion(skeleton, path, rotations, frame_time_text)
    vars(motion)["positions"] = positions  # fill the cached property
    return motion


def single_precision(motion: Motion) -> Motion:
    """Return a motion with positions and rotations rounded to float32, about seven digits."""
    return motion._with_vectors(in_float32, motion.skeleton, normalised(in_float32(motion.rotations)))


def in_float32(values: Array) -> Array:
    """Return numbers rounded to float32."""
    return values.astype(np.float32).astype(np.float64)


def _as_array(name: str, values: Array, shape: tuple[int | str, ...]) -> Array:
    """Return the values as an array of this shape, "frames" being any number, or raise a MotionError."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise MotionError(f"{name} is not an array of numbers: {error}") from error
    if array.ndim != len(shape) or array.shape[1:] != shape[1:]:
        raise MotionError(f"{name} has shape {array.shape}; expected ({', '.join(map(str, shape))})")
    return array


def _turned(vectors: Array, turn: Rotation) -> Array:
    """Vectors, (..., 3), turned by one rotation."""
    return np.asarray(turn.apply(np.array(vectors).reshape(-1, 3)).reshape(vectors.shape))
