"""A motion: a skeleton, and for each frame where its joints turn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.errors import MotionError
from distretarget.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Motion:
    """A skeleton in motion. Right-handed; quaternions are x y z w, as in scipy.

    Attributes:
        skeleton: the joints.
        translations: (frames, joints, 3), each joint's translation to its parent, for the root its
            position in the world [file units]. Equal to the offset where no channel replaces it.
        rotations: (frames, joints, 4), local rotations as unit quaternions.
        frame_time_text: the time between frames [s] as the file spells it, kept digit for digit.

    Raises:
        MotionError: shapes that do not belong together.
    """

    skeleton: Skeleton
    translations: NDArray[np.float64]
    rotations: NDArray[np.float64]
    frame_time_text: str

    def __post_init__(self) -> None:
        joints = len(self.skeleton)
        for name, width in (("translations", 3), ("rotations", 4)):
            array = np.asarray(getattr(self, name), np.float64).view()
            if array.ndim != 3 or array.shape[1:] != (joints, width):
                raise MotionError(f"{name} has shape {array.shape}, {joints} joints need (frames, {joints}, {width})")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if len(self.translations) != len(self.rotations):
            raise MotionError(f"{len(self.translations)} frames of translations, {len(self.rotations)} of rotations")

    def __len__(self) -> int:
        return len(self.rotations)

    def __repr__(self) -> str:
        return f"<Motion of {len(self)} frames, {self.frame_time_text} s each, on {self.skeleton!r}>"

    @property
    def frame_time(self) -> float:
        """Time between frames [s]."""
        return float(self.frame_time_text)

    @property
    def root_positions(self) -> NDArray[np.float64]:
        """(frames, 3), the root's path [file units]."""
        return self.translations[:, 0]

    @cached_property
    def world_rotations(self) -> NDArray[np.float64]:
        """(frames, joints, 4), each joint's rotation in the world."""
        return world_rotations(self.skeleton, self.rotations)

    @cached_property
    def positions(self) -> NDArray[np.float64]:
        """(frames, joints, 3), each joint's position in the world, by forward kinematics [file units]."""
        positions = np.empty_like(self.translations)
        _positions(self.skeleton.parents, self.translations, self.world_rotations, positions)
        return positions

    @cached_property
    def rigid_skeleton(self) -> Skeleton:
        """The skeleton with the bones that the frames show: offsets where nothing replaces them, elsewhere
        the median translation over the frames at the median length.
        """
        moving = np.any(self.translations != self.skeleton.offsets, axis=(0, 2))
        moving[0] = False
        if not moving.any():
            return self.skeleton
        offsets = np.array(self.skeleton.offsets)
        offsets[moving] = np.median(self.translations[:, moving], axis=0)
        lengths = np.linalg.norm(offsets, axis=1)
        lengths[moving] = np.median(np.linalg.norm(self.translations[:, moving], axis=2), axis=0)
        return self.skeleton.with_offsets(offsets).with_lengths(lengths)


def world_rotations(skeleton: Skeleton, rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """World rotations (frames, joints, 4) from local ones: each joint's is its parent's times its own."""
    world = np.array(rotations)
    _world_rotations(skeleton.parents, world)
    return world


@njit(cache=True)
def _world_rotations(parents: NDArray[np.intp], world: NDArray[np.float64]) -> None:
    """Local rotations turned into world rotations in place."""
    for frame in range(len(world)):
        for joint in range(1, len(parents)):
            p = world[frame, parents[joint]]
            _multiply(p[0], p[1], p[2], p[3], world[frame, joint], world[frame, joint])


@njit(cache=True)
def _local_rotations(parents: NDArray[np.intp], world: NDArray[np.float64], local: NDArray[np.float64]) -> None:
    """Local rotations, written: the inverse of the parent's world rotation times the joint's own."""
    for frame in range(len(world)):
        for joint in range(1, len(parents)):
            p = world[frame, parents[joint]]
            _multiply(-p[0], -p[1], -p[2], p[3], world[frame, joint], local[frame, joint])


def products(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """The products of rotations and others, all (frames, joints, 4)."""
    product = np.empty_like(second)
    _products(first, second, product)
    return product


@njit(cache=True)
def _products(first: NDArray[np.float64], second: NDArray[np.float64], product: NDArray[np.float64]) -> None:
    for frame in range(len(first)):
        for joint in range(first.shape[1]):
            p = first[frame, joint]
            _multiply(p[0], p[1], p[2], p[3], second[frame, joint], product[frame, joint])


@njit(cache=True)
def _multiply(x, y, z, w, q, product):  # type: ignore[no-untyped-def]
    """The product of the quaternion x y z w and q, written; it may be q itself."""
    i, j, k, r = q[0], q[1], q[2], q[3]
    product[0] = w * i + x * r + y * k - z * j
    product[1] = w * j - x * k + y * r + z * i
    product[2] = w * k + x * j - y * i + z * r
    product[3] = w * r - x * i - y * j - z * k


@njit(cache=True)
def _positions(
    parents: NDArray[np.intp],
    translations: NDArray[np.float64],
    world: NDArray[np.float64],
    positions: NDArray[np.float64],
) -> None:
    """Forward kinematics, written: each joint stands from its parent by its translation, turned by the parent."""
    for frame in range(len(world)):
        for i in range(3):
            positions[frame, 0, i] = translations[frame, 0, i]
        for joint in range(1, len(parents)):
            parent = parents[joint]
            q, v = world[frame, parent], translations[frame, joint]
            x, y, z, w = q[0], q[1], q[2], q[3]
            a, b, c = v[0], v[1], v[2]
            # v + 2 w (q x v) + 2 q x (q x v), q the vector part
            i, j, k = y * c - z * b, z * a - x * c, x * b - y * a
            positions[frame, joint, 0] = positions[frame, parent, 0] + a + 2.0 * (w * i + y * k - z * j)
            positions[frame, joint, 1] = positions[frame, parent, 1] + b + 2.0 * (w * j + z * i - x * k)
            positions[frame, joint, 2] = positions[frame, parent, 2] + c + 2.0 * (w * k + x * j - y * i)


def local_rotations(skeleton: Skeleton, world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Local rotations (frames, joints, 4) from world ones; the inverse of `world_rotations`."""
    local = np.array(world)
    _local_rotations(skeleton.parents, world, local)
    return local


def rigid_motion(
    skeleton: Skeleton,
    root_positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
    frame_time_text: str,
) -> Motion:
    """The motion with these local rotations, (frames, joints, 4), and root path on bones that keep their offsets."""
    translations = np.array(np.broadcast_to(skeleton.offsets, (len(rotations), len(skeleton), 3)))
    translations[:, 0] = root_positions
    return Motion(skeleton, translations, rotations, frame_time_text)
