"""The skeleton: a tree of joints as arrays, and the lengths of its bones and paths."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from distretarget.errors import SkeletonError, closest, quoted
from distretarget.numerics import kinematics
from distretarget.numerics.vectors import extent
from distretarget.stick_figures import likely_up, stick_figures

POSITION_CHANNELS = ("Xposition", "Yposition", "Zposition")
ROTATION_CHANNELS = ("Xrotation", "Yrotation", "Zrotation")
ALL_CHANNELS = POSITION_CHANNELS + ROTATION_CHANNELS
DEFAULT_ROTATIONS = ("Zrotation", "Xrotation", "Yrotation")  # of joints for which a file states no channels
DEFAULT_ROOT = POSITION_CHANNELS + DEFAULT_ROTATIONS  # of a root for which it states none
AXES = ("X", "Y", "Z", "-X", "-Y", "-Z")  # possible up axes of a file
HALF_TURN = np.array([-1.0, 1.0, -1.0])  # factors that turn a vector by 180 degrees about Y
METRES = {"mm": 0.001, "cm": 0.01, "m": 1.0, "dm": 0.1, "in": 0.0254, "ft": 0.3048}  # length units [m]
UNITS = tuple(METRES)  # length units a file may state
MOST_LETTERS = 1_000_000  # all keys together may have this many letters more than 20 times the names
FLAT_JOINTS, FLAT = 8, 0.8  # a tree of so many joints is flat if more than this share hangs from the root [0 to 1]
# Bounds within which all computations stay finite and exact to a few digits [file units].
SAME_RIG = 1e-3  # rest poses of the same rig differ by less [their largest coordinate]
LARGEST = 1e12  # largest coordinate of an offset or position; also the largest scale
SMALLEST = 1e-12  # least length of the longest bone; also the least scale

JointMap = Mapping[str, str | None]
"""Target joint key to the key of the source joint that drives it, or to None if nothing drives it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Skeleton:
    """A tree of joints with the offsets of its rest pose.

    Parents come before children; joint 0 is the root. End Sites are joints without channels or children.

    Attributes:
        names: joint names as in the file; not always unique, see `keys`.
        parents: (joints,), parent indices, -1 for the root.
        offsets: (joints, 3), translations from the parent in the rest pose [file units].
        channels: the BVH channels of each joint, in file order.
        end_sites: (joints,), true for End Sites.
        units: unit of the offsets, one of `UNITS`; None if the file does not state it.
        up: up axis, one of `AXES`; None if the file does not state it.
        humanoid: pairs of a bone, by its name in VRM 1.0, such as "leftUpperArm", and its joint; empty if the file
            states none. If it does, names and shape of the skeleton are not used to recognise the body.
        faces_negative_z: whether bodies in its file face -Z by convention, as in VRM 0; all others face +Z.
        floor_at_zero: whether the rest pose, with the root at its offset, stands on a floor at height 0, as in files of
            characters.

    Raises:
        SkeletonError: the arrays are not numbers or not such a tree, a name is not text, a channel is unknown or
            repeated in a joint, an End Site has channels or children, the unit or axis is unknown, two joints have the
            same key, or a bone of the humanoid is there twice or at no joint.
    """

    names: tuple[str, ...]
    parents: NDArray[np.intp]
    offsets: NDArray[np.float64]
    channels: tuple[tuple[str, ...], ...]
    end_sites: NDArray[np.bool_]
    units: str | None = None
    up: str | None = None
    humanoid: tuple[tuple[str, int], ...] = ()
    faces_negative_z: bool = False
    floor_at_zero: bool = False

    def __post_init__(self) -> None:
        self._check_names()
        self._check_arrays()
        self._check_tree()
        self._check_humanoid()
        for name, value, known in (("units", self.units, UNITS), ("up", self.up, AXES)):
            if value is not None and value not in known:
                raise SkeletonError(f"{name} is {value!r}; expected one of {quoted(known)} or None")
        if wrong := [self.names[joint] for joint in np.flatnonzero(~(np.abs(self.offsets) <= LARGEST).all(axis=1))]:
            raise SkeletonError(f"the offset of {quoted(wrong)} is not finite, or beyond {LARGEST:g}")
        if twins := [key for key, times in Counter(self.keys).items() if times > 1]:
            raise SkeletonError(f"joints that cannot be told apart: {quoted(twins)}; rename all but one of each")

    def _check_names(self) -> None:
        """Check names and channels, and store them as tuples."""
        try:
            object.__setattr__(self, "names", tuple(self.names))
            object.__setattr__(self, "channels", tuple(map(tuple, self.channels)))
        except TypeError as error:
            raise SkeletonError(f"names and channels need an entry for each joint: {error}") from error
        if wrong := [name for name in self.names if not isinstance(name, str)]:
            raise SkeletonError(f"{wrong[0]!r} is not a name; expected a text")
        if len(self.channels) != len(self.names):
            raise SkeletonError(f"channels are given for {len(self.channels)} of {len(self.names)} joints")
        for name, channels in zip(self.names, self.channels, strict=True):
            if unknown := [channel for channel in channels if channel not in ALL_CHANNELS]:
                near = closest(str(unknown[0]), ALL_CHANNELS)
                raise SkeletonError(f"{name!r} has the unknown channel {unknown[0]!r}; {near}")
            if len(set(channels)) < len(channels):
                raise SkeletonError(f"{name!r} has a channel twice: {quoted(channels)}")

    def _check_arrays(self) -> None:
        """Check types and shapes of the arrays, and store read-only copies."""
        count = len(self.names)
        layout = {"parents": (np.intp, ()), "offsets": (np.float64, (3,)), "end_sites": (np.bool_, ())}
        for name, (dtype, width) in layout.items():
            shape = (count, *width)
            try:
                array = np.array(getattr(self, name))
                if array.dtype.kind not in "biuf":
                    raise ValueError(f"found {array.dtype} values")
                exact: NDArray[np.generic] = array.astype(dtype)
                if (exact != array).any() and np.isfinite(array).all():
                    raise ValueError("found fractions")
            except (TypeError, ValueError) as error:
                raise SkeletonError(f"{name} is not an array of {np.dtype(dtype).name} values: {error}") from error
            if exact.shape != shape:
                raise SkeletonError(f"{name} has shape {exact.shape}, {count} joints need {shape}")
            exact.flags.writeable = False
            object.__setattr__(self, name, exact)

    def _check_tree(self) -> None:
        """Check that the root is first, parents come before children, and End Sites are leaves."""
        count = len(self.names)
        if not count or self.parents[0] != -1:
            raise SkeletonError("a skeleton needs a root as its first joint")
        if np.any(self.parents[1:] < 0) or np.any(self.parents[1:] >= np.arange(1, count)):
            raise SkeletonError("parents must come before their children, and only the root has none")
        inner = np.isin(np.arange(count), self.parents)
        for joint in np.flatnonzero(self.end_sites):
            if not joint or inner[joint] or self.channels[joint]:
                name = self.names[joint]
                raise SkeletonError(f"{name!r} is an End Site, but it is the root, or has channels or children")

    def _check_humanoid(self) -> None:
        joints = self.joints
        try:
            pairs = tuple((str(bone), joints[joints.index(joint)]) for bone, joint in self.humanoid)
        except (TypeError, ValueError) as error:
            raise SkeletonError(f"humanoid is not made of pairs of a bone and its joint: {error}") from error
        for entries in zip(*pairs, strict=True):
            if twice := [entry for entry, times in Counter(entries).items() if times > 1]:
                raise SkeletonError(f"the humanoid has {twice[0]!r} twice")
        object.__setattr__(self, "humanoid", pairs)

    def __eq__(self, other: object) -> bool:
        """Return whether another skeleton is the same in all attributes."""
        return self is other or (isinstance(other, Skeleton) and self._content == other._content)

    def __hash__(self) -> int:
        return hash(self._content[:2])

    @cached_property
    def _content(self) -> tuple[object, ...]:
        arrays = (array.tobytes() for array in (self.offsets, self.parents, self.end_sites))
        others = self.channels, self.units, self.up, self.humanoid, self.faces_negative_z, self.floor_at_zero
        return self.names, *arrays, *others

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return f"<Skeleton of {np.sum(~self.end_sites)} joints and {np.sum(self.end_sites)} End Sites>"

    def _repr_html_(self) -> str:
        up = likely_up(self.rest_positions, self.up)
        return stick_figures(self.parents, self.rest_positions[None], up, repr(self)) + f"<p>{escape(repr(self))}</p>"

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Unique joint names: `name` if it is unique, else `parent/name`, and so on up the tree."""
        keys = list(self.names)
        tops = self.parents.tolist()
        while True:
            times = Counter(keys)
            again = [j for j, key in enumerate(keys) if times[key] > 1 and tops[j] >= 0]
            if not again:
                return tuple(keys)
            if sum(map(len, keys)) > MOST_LETTERS + 20 * sum(map(len, self.names)):
                raise SkeletonError(f"too many joints have the same names: {quoted(dict.fromkeys(keys))}; rename them")
            for j in again:
                keys[j] = f"{self.names[tops[j]]}/{keys[j]}"
                tops[j] = self.parents.item(tops[j])

    def keys_of(self, joints: Iterable[int]) -> tuple[str, ...]:
        """The keys of some joints."""
        return tuple(self.keys[joint] for joint in joints)

    def index(self, key: str) -> int:
        """Return the index of the joint with this key, or raise a SkeletonError with the closest keys."""
        try:
            return self._numbers[key]
        except KeyError:
            raise SkeletonError(f"no joint {key!r}; {closest(str(key), self.keys)}") from None

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {key: joint for joint, key in enumerate(self.keys)}

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """The children of each joint, in file order."""
        return kinematics.children_of(self.parents.tolist())

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """All joints except End Sites."""
        return tuple(np.flatnonzero(~self.end_sites).tolist())

    @cached_property
    def depth_first(self) -> tuple[int, ...]:
        """The joints in the order of a BVH file: depth first, children in file order."""
        return kinematics.depth_first_order(self.children)

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """(joints,), the length of the bone from the parent to each joint; 0 for the root [file units]."""
        return np.asarray(np.linalg.norm(self.offsets, axis=1) * (self.parents >= 0))

    def paths_from(self, joint: int) -> NDArray[np.float64]:
        """Return the lengths of the tree paths from a joint to all joints, (joints,) [file units]."""
        found: dict[int, NDArray[np.float64]] = vars(self).setdefault("_paths_from", {})
        if joint not in found:
            found[joint] = kinematics.paths_from(joint, self.parents.tolist(), self.lengths.tolist())
        return found[joint]

    def paths_among(self, joints: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return tau, the lengths of the tree paths between some joints, (some, some) [file units]."""
        return kinematics.paths_among(joints, self.parents, self.lengths)

    def path_sizes(self, joints: NDArray[np.intp], counted: NDArray[np.intp] | None = None) -> NDArray[np.intp]:
        """Return |P|, (some, some), the number of joints on each path, of those `counted` if given."""
        bones = np.ones(len(self)) if counted is None else np.isin(np.arange(len(self)), counted).astype(np.float64)
        return kinematics.paths_among(joints, self.parents, bones).astype(np.intp) + 1

    @cached_property
    def longest_path(self) -> float:
        """The length of the longest path [file units]."""
        return self.longest_path_among(np.arange(len(self)))

    def longest_path_among(self, joints: NDArray[np.intp]) -> float:
        """Return the length of the longest path between two of some joints [file units]."""
        end = joints[self.paths_from(int(joints[0]))[joints].argmax()]
        return float(self.paths_from(int(end))[joints].max())

    @cached_property
    def _reaches(self) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        return kinematics.reaches(self.parents.tolist(), self.lengths.tolist())

    @property
    def reach(self) -> NDArray[np.float64]:
        """(joints,), the length of the path from each joint to its `farthest` [file units]."""
        return self._reaches[0]

    @property
    def farthest(self) -> NDArray[np.intp]:
        """(joints,), the joint below each joint, or itself, that is farthest from it along the bones."""
        return self._reaches[1]

    @cached_property
    def depths(self) -> NDArray[np.intp]:
        """(joints,), the number of joints above each joint."""
        return kinematics.paths_from(0, self.parents.tolist(), [1.0] * len(self)).astype(np.intp)

    @cached_property
    def coincident(self) -> NDArray[np.intp]:
        """(joints,), the topmost joint that coincides with each joint, across bones of length 0."""
        topmost = list(range(len(self)))
        for joint in np.flatnonzero(self.lengths[1:] == 0.0) + 1:
            topmost[joint] = topmost[self.parents[joint]]
        return np.array(topmost)

    def on_longest_branches(self, joints: NDArray[np.intp], most: int) -> NDArray[np.intp]:
        """Return up to `most` of some joints, ascending: those on the longest branches (chains of bones to a leaf)."""
        branches = np.zeros(len(self))
        np.maximum.at(branches, self.farthest, self.lengths + self.reach)
        return np.sort(joints[np.argsort(-branches[self.farthest[joints]], kind="stable")[:most]])

    @property
    def is_flat(self) -> bool:
        """Whether nearly all joints of a larger skeleton hang from the root, so that the tree shows no anatomy."""
        joints = self.joints[1:]
        return len(joints) >= FLAT_JOINTS and float(np.mean(self.parents[[*joints]] == 0)) > FLAT

    def common_ancestor(self, joints: Iterable[int]) -> int:
        """Return the lowest common ancestor of some joints, which may be one of them."""
        return max(set.intersection(*({*self.to_root(joint)} for joint in joints)))

    @cached_property
    def rest_positions(self) -> NDArray[np.float64]:
        """(joints, 3), joint positions in the rest pose with the root at the origin [file units]."""
        return self.posed(self.rest_rotations)

    @property
    def rest_rotations(self) -> NDArray[np.float64]:
        """(joints, 4), the world rotations of the rest pose: the identity."""
        return np.tile([0.0, 0.0, 0.0, 1.0], (len(self), 1))

    def posed(self, world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint positions, (joints, 3), for world rotations (joints, 4), the root at the origin [file units]."""
        return np.asarray(
            kinematics.joint_positions(self.parents, np.zeros((1, 3)), self.offsets[None], world[None])[0]
        )

    def to_root(self, joint: int) -> list[int]:
        """Return the joints from `joint` up to the root, both included."""
        up = [joint]
        while up[-1]:
            up.append(self.parents.item(up[-1]))
        return up

    def with_ancestors(self, joints: Iterable[int]) -> set[int]:
        """Return these joints and all their ancestors."""
        found = {-1}
        for joint in map(int, joints):
            while joint not in found:
                found.add(joint)
                joint = self.parents.item(joint)
        return found - {-1}

    def subtree(self, joint: int) -> list[int]:
        """Return `joint` and all its descendants."""
        below = [joint]
        for upper in below:
            below.extend(self.children[upper])
        return below

    def subtree_at(self, joint: int) -> list[int]:
        """Return the subtree of a joint; for an End Site that of its parent, which moves the skin there."""
        return self.subtree(self.parents.item(joint) if self.end_sites[joint] else joint)

    def rotation_axes(self, joint: int) -> str:
        """Return the Euler order of a joint's rotation channels, such as "ZXY"."""
        return "".join(channel[0] for channel in self.channels[joint] if channel in ROTATION_CHANNELS)

    def moves_freely(self, joint: int) -> bool:
        """Return whether a joint has all six channels."""
        return {*POSITION_CHANNELS, *ROTATION_CHANNELS} <= set(self.channels[joint])

    @property
    def without_namespaces(self) -> Skeleton:
        """The same skeleton without namespaces, `Hips` for `mixamorig:Hips`; a SkeletonError if keys become equal."""
        return replace(self, names=tuple(name.rpartition(":")[2].strip() or name for name in self.names))

    def with_offsets(self, offsets: ArrayLike) -> Skeleton:
        """Return the same tree with other offsets, (joints, 3) [file units]; errors as in `Skeleton`."""
        return replace(self, offsets=cast(NDArray[np.float64], offsets))  # checked by the constructor

    def turned_round(self) -> Skeleton:
        """Return the skeleton turned by 180 degrees about Y, which changes whether it faces -Z (`faces_negative_z`)."""
        return replace(self, offsets=self.offsets * HALF_TURN, faces_negative_z=not self.faces_negative_z)

    def with_lengths(self, lengths: ArrayLike) -> Skeleton:
        """Return the same tree and bone directions with other bone lengths, (joints,), at least 0. Bones of length 0
        keep this length. A SkeletonError for other lengths.
        """
        if np.shape(lengths) != self.lengths.shape or not np.all(np.asarray(lengths) >= 0):
            raise SkeletonError(f"lengths have to be {len(self)} numbers, from 0")
        factors = np.divide(lengths, self.lengths, out=np.ones(len(self)), where=self.lengths > 0)
        return self.with_offsets(self.offsets * factors[:, None])


def same_up_to_scale(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether two arrays of places or distances at rest, not all 0, are the same up to a factor, within `SAME_RIG`."""
    sizes = extent(one), extent(other)
    return bool(min(sizes) > 0.0 and extent(one / sizes[0] - other / sizes[1]) < SAME_RIG)
