"""The skeleton: a tree of joints as arrays, and the lengths of its bones and paths."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import shortest_path

from distretarget.errors import SkeletonError, closest, quoted
from distretarget.numerics.kinematics import forward_kinematics

POSITION_CHANNELS = ("Xposition", "Yposition", "Zposition")
ROTATION_CHANNELS = ("Xrotation", "Yrotation", "Zrotation")
AXES = ("X", "Y", "Z", "-X", "-Y", "-Z")  # that may point up in a file
UNITS = ("mm", "cm", "m", "dm", "in", "ft")  # of the lengths in a file
# Bounds within which all computations stay finite and exact to a few digits [file units].
LARGEST = 1e12  # largest coordinate of an offset or a position; also the largest scale
SMALLEST = 1e-12  # least length of a body's longest bone; also the least scale


JointMap = Mapping[str, str | None]
"""For keys of target joints, the key of the source joint that drives each; None where nothing does."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Skeleton:
    """A tree of joints with the offsets of its rest pose.

    Joints are numbered so that parents come before children; joint 0 is the root. End Sites are joints
    without channels or children, marked in `end_sites`.

    Attributes:
        names: the names of the joints, as in the file; not always unique, see `keys`.
        parents: (joints,), the number of each joint's parent, -1 for the root.
        offsets: (joints, 3), each joint's translation from its parent in the rest pose [file units].
        channels: the BVH channels of each joint, in file order.
        end_sites: (joints,), true for End Sites.
        units: the unit of the offsets, one of `UNITS`; None where the file does not state it.
        up: the axis that points up, one of `AXES`; None where the file does not state it.

    Raises:
        SkeletonError: the arrays are not a tree in that order or hold no numbers, a name is not text, a channel is
            unknown or occurs twice in a joint, an End Site has channels or children, unit or axis are unknown, or two
            joints cannot be told apart.
    """

    names: tuple[str, ...]
    parents: NDArray[np.intp]
    offsets: NDArray[np.float64]
    channels: tuple[tuple[str, ...], ...]
    end_sites: NDArray[np.bool_]
    units: str | None = None
    up: str | None = None

    def __post_init__(self) -> None:
        self._check_names()
        self._check_arrays()
        self._check_tree()
        self._check_channels()
        for name, value, known in (("units", self.units, UNITS), ("up", self.up, AXES)):
            if value is not None and value not in known:
                raise SkeletonError(f"{name} is {value!r}; expected one of {quoted(known)} or None")
        valid = np.abs(self.offsets) <= LARGEST
        if not np.all(valid):
            raise SkeletonError(f"the offset of {quoted(self._where(~valid))} is not finite, or beyond {LARGEST:g}")
        twins = [key for key, times in Counter(self.keys).items() if times > 1]
        if twins:
            raise SkeletonError(f"joints that cannot be told apart: {quoted(twins)}; rename all but one of each")

    def _check_names(self) -> None:
        """Check that names and channels are texts for each joint, and keep them as tuples."""
        try:
            object.__setattr__(self, "names", tuple(self.names))
            object.__setattr__(self, "channels", tuple(map(tuple, self.channels)))
        except TypeError as error:
            raise SkeletonError(f"names and channels need an entry for each joint: {error}") from error
        if wrong := [name for name in self.names if not isinstance(name, str)]:
            raise SkeletonError(f"{wrong[0]!r} is not a name; expected a text")
        if len(self.channels) != len(self.names):
            raise SkeletonError(f"channels are given for {len(self.channels)} of {len(self.names)} joints")

    def _check_arrays(self) -> None:
        """Check the shapes of the arrays, and keep them read-only."""
        count = len(self.names)
        for name, dtype, shape in (
            ("parents", np.intp, (count,)),
            ("offsets", np.float64, (count, 3)),
            ("end_sites", np.bool_, (count,)),
        ):
            try:
                array = np.array(getattr(self, name))
                if array.dtype.kind not in "biuf":
                    raise ValueError(f"found {array.dtype} values")
                exact = array.astype(dtype)
                if (exact != array).any() and np.isfinite(array).all():
                    raise ValueError("found fractions")
            except (TypeError, ValueError) as error:
                raise SkeletonError(f"{name} is not an array of {np.dtype(dtype).name} values: {error}") from error
            if exact.shape != shape:
                raise SkeletonError(f"{name} has shape {exact.shape}, {count} joints need {shape}")
            exact.flags.writeable = False
            object.__setattr__(self, name, exact)

    def _check_tree(self) -> None:
        """Check that the root is the first joint, that parents come before children, and that End Sites are leaves."""
        count = len(self.names)
        if not count or self.parents[0] != -1:
            raise SkeletonError("a skeleton needs a root as its first joint")
        if np.any(self.parents[1:] < 0) or np.any(self.parents[1:] >= np.arange(1, count)):
            raise SkeletonError("parents must come before their children, and only the root has none")
        inner = np.isin(np.arange(count), self.parents)
        for joint in np.flatnonzero(self.end_sites):
            if not joint or inner[joint] or self.channels[joint]:
                raise SkeletonError(
                    f"{self.names[joint]!r} is an End Site, but it is the root, or has channels or children"
                )

    def _check_channels(self) -> None:
        """Check that the channels of each joint are known, and different."""
        for name, channels in zip(self.names, self.channels, strict=True):
            if unknown := [channel for channel in channels if channel not in POSITION_CHANNELS + ROTATION_CHANNELS]:
                known = closest(str(unknown[0]), POSITION_CHANNELS + ROTATION_CHANNELS)
                raise SkeletonError(f"{name!r} has the unknown channel {unknown[0]!r}; {known}")
            if len(set(channels)) < len(channels):
                raise SkeletonError(f"{name!r} has a channel twice: {quoted(channels)}")

    def _where(self, mask: NDArray[np.bool_]) -> list[str]:
        """The names of the joints that a mask (joints, ...) marks."""
        return [name for name, hit in zip(self.names, mask, strict=True) if hit.any()]

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return f"<Skeleton of {np.sum(~self.end_sites)} joints and {np.sum(self.end_sites)} End Sites>"

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """The unique names of the joints: `name` where it is unique, else `parent/name`, and so on up the tree."""
        keys = list(self.names)
        tops = [int(parent) for parent in self.parents]
        while True:
            times = Counter(keys)
            again = [j for j, key in enumerate(keys) if times[key] > 1 and tops[j] >= 0]
            if not again:
                return tuple(keys)
            for j in again:
                keys[j] = f"{self.names[tops[j]]}/{keys[j]}"
                tops[j] = int(self.parents[tops[j]])

    def index(self, key: str) -> int:
        """Return the number of the joint with this key.

        Raises:
            SkeletonError: no joint has this key; the message lists the closest ones.
        """
        try:
            return self.keys.index(key)
        except ValueError:
            raise SkeletonError(f"no joint {key!r}; {closest(str(key), self.keys)}") from None

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """The numbers of each joint's children, in file order."""
        below: list[list[int]] = [[] for _ in self.names]
        for child, parent in enumerate(self.parents[1:], start=1):
            below[parent].append(child)
        return tuple(map(tuple, below))

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """The numbers of the joints without End Sites."""
        return tuple(np.flatnonzero(~self.end_sites).tolist())

    @cached_property
    def depth_first(self) -> tuple[int, ...]:
        """The joints in the order in which a BVH file lists them: each before its children, children in file order."""
        order: list[int] = []
        stack = [0]
        while stack:
            order.append(joint := stack.pop())
            stack.extend(reversed(self.children[joint]))
        return tuple(order)

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """(joints,), the length of the bone from each joint's parent to the joint; 0 for the root [file units]."""
        lengths = np.asarray(np.linalg.norm(self.offsets, axis=1))
        lengths[0] = 0.0
        return lengths

    @cached_property
    def path_lengths(self) -> NDArray[np.float64]:
        """tau: (joints, joints), the sum of the bone lengths on the path between two joints [file units]."""
        edges = (self.lengths[1:], (np.arange(1, len(self)), self.parents[1:]))
        graph = coo_array(edges, shape=(len(self), len(self))).tocsr()
        return np.asarray(shortest_path(graph, method="D", directed=False))

    @cached_property
    def path_sizes(self) -> NDArray[np.intp]:
        """|P|: (joints, joints), the number of joints on the path between two joints, both ends included."""
        return self.path_counts(np.ones(len(self), bool)) + 1

    def path_counts(self, counted: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return how many bones between two joints are `counted`, (joints, joints); (joints,) flags, each for the bone
        that ends at the joint.
        """
        above = counted.astype(np.intp)
        for joint in range(1, len(self)):
            above[joint] += above[self.parents[joint]]
        return np.asarray(above[:, None] + above - 2 * above[self.meets])

    @cached_property
    def meets(self) -> NDArray[np.intp]:
        """(joints, joints), the lowest common ancestor of two joints."""
        meets = np.diag(np.arange(len(self)))
        for joint in range(1, len(self)):
            meets[joint, :joint] = meets[:joint, joint] = meets[self.parents[joint], :joint]
        return meets

    @cached_property
    def rest_positions(self) -> NDArray[np.float64]:
        """(joints, 3), the positions of the joints in the rest pose, with the root at the origin [file units]."""
        return self.posed(self.unturned)

    @property
    def unturned(self) -> NDArray[np.float64]:
        """(joints, 4), the world rotations of the rest pose: the identity for every joint."""
        return np.tile([0.0, 0.0, 0.0, 1.0], (len(self), 1))

    def posed(self, world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions of the joints, (joints, 3), for world rotations (joints, 4), with the root at the origin
        [file units].
        """
        translations = np.array(self.offsets)
        translations[0] = 0.0
        return np.asarray(forward_kinematics(self.parents, translations[None], world[None])[0])

    def line(self, joint: int) -> list[int]:
        """Return the joints from a joint up to the root, both included."""
        up = [joint]
        while up[-1]:
            up.append(self._parents[up[-1]])
        return up

    def lines(self, joints: Iterable[int]) -> set[int]:
        """Return all joints on the lines from some joints up to the root."""
        return {above for joint in joints for above in self.line(int(joint))}

    @cached_property
    def _parents(self) -> tuple[int, ...]:
        return tuple(map(int, self.parents))

    def subtree(self, joint: int) -> list[int]:
        """Return a joint and all joints below it."""
        below = [joint]
        for upper in below:
            below.extend(self.children[upper])
        return below

    def rotation_axes(self, joint: int) -> str:
        """Return the axes of a joint's rotation channels in file order, such as "ZXY"."""
        return "".join(channel[0] for channel in self.channels[joint] if channel in ROTATION_CHANNELS)

    def moves_freely(self, joint: int) -> bool:
        """Return whether a joint has all six channels."""
        return {*POSITION_CHANNELS, *ROTATION_CHANNELS} <= set(self.channels[joint])

    @property
    def without_namespaces(self) -> Skeleton:
        """The same skeleton with names from the last colon on: `Hips` for `mixamorig:Hips`.

        Raises:
            SkeletonError: joints cannot be told apart without their namespaces.
        """
        return replace(self, names=tuple(name.rpartition(":")[2].strip() or name for name in self.names))

    def with_offsets(self, offsets: ArrayLike) -> Skeleton:
        """Return the same tree with other offsets, (joints, 3).

        Raises:
            SkeletonError: they are not such an array, or not finite.
        """
        return replace(self, offsets=cast(NDArray[np.float64], offsets))  # checked as it is made

    def with_lengths(self, lengths: ArrayLike) -> Skeleton:
        """Return the same tree and rest directions with other bone lengths, (joints,); bones of length 0 stay so.

        Raises:
            SkeletonError: they are not such an array, or one is negative or not finite.
        """
        if np.shape(lengths) != self.lengths.shape or not np.all(np.asarray(lengths) >= 0):
            raise SkeletonError(f"lengths have to be {len(self)} numbers, from 0")
        factors = np.divide(lengths, self.lengths, out=np.ones(len(self)), where=self.lengths > 0)
        return self.with_offsets(self.offsets * factors[:, None])
