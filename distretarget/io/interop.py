"""Convert motions from and to containers of bvhio: a position and a rotation per joint and frame, in float32."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterator
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from distretarget.checks import check_kind
from distretarget.errors import MissingPackageError, MotionError, SkeletonError, quoted
from distretarget.io.bvh import add_offsets, joint_names
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, extent
from distretarget.skeleton import Skeleton

if TYPE_CHECKING:
    import bvhio

LARGEST_FLOAT32 = float(np.finfo(np.float32).max)  # the largest coordinate that bvhio holds [file units]


def from_bvhio(container: bvhio.BvhContainer) -> Motion:
    """Return the motion in a container, such as `bvhio.readAsBvh` returns.

    It equals the motion that `read_bvh` reads from the same file, except for what bvhio does not keep:

    - offsets, positions and rotations have the 7 digits of float32;
    - the frame time is spelled as Python spells the number, 0.0333330 as 0.033333;
    - names end at their first blank;
    - a joint without children has one End Site, the last of several, at (0, 1, 0) where the file has none;
      a joint with children has none.

    Scales of poses, which only programs can set, are ignored.

    Raises:
        MissingPackageError: bvhio is not installed.
        SkeletonError: joints that cannot be told apart, or channels that BVH does not have.
        MotionError: fewer keyframes than frames, a frame time that is not above 0, or a value that is not finite.
    """
    _check_container(container)
    nodes = list(_nodes(container.Root))
    skeleton = _skeleton(nodes)
    translations = np.tile(skeleton.offsets, (container.FrameCount, 1, 1))
    rotations = np.tile(skeleton.rest_rotations, (container.FrameCount, 1, 1))
    for number in np.flatnonzero(~skeleton.end_sites):
        translations[:, number], rotations[:, number] = _poses(nodes[number][0], container.FrameCount)
    add_offsets(skeleton, np.arange(len(skeleton)), translations)
    return Motion.of_translations(skeleton, translations, rotations, repr(float(container.FrameTime)))


def to_bvhio(motion: Motion) -> bvhio.BvhContainer:
    """Return a container with the motion, which `bvhio.writeBvh` writes and `bvhio.convertBvhToHierarchy` turns into
    joints. It has 7 digits, the frame time as a float, and an End Site of length 0 at joints with neither children nor
    End Site.

    `bvhio.writeBvh` computes the angles of each frame on its own: they stay within 180 degrees, jump where those of
    `write_bvh` continue, and give another rotation where the middle one is 90 degrees.

    Raises:
        MissingPackageError: bvhio is not installed.
        SkeletonError: a joint has several End Sites, or an End Site beside other children.
        MotionError: a value that is not finite, or beyond float32.
    """
    check_kind("motion", motion, Motion)
    package = _bvhio()
    skeleton = motion.skeleton
    for joint, children in enumerate(skeleton.children):
        if len(children) > 1 and np.any(skeleton.end_sites[list(children)]):
            name, found = skeleton.names[joint], quoted(skeleton.names[child] for child in children)
            raise SkeletonError(f"bvhio holds an End Site only where a joint has nothing else; {name!r} has {found}")
    if not extent(motion.translations) <= LARGEST_FLOAT32:
        raise MotionError(f"a position is not finite, or beyond {LARGEST_FLOAT32:.3g}, the most that bvhio holds")
    joints = [_joint(package, motion, number) for number in range(len(skeleton))]
    for number, parent in enumerate(skeleton.parents[1:], start=1):
        if skeleton.end_sites[number]:
            joints[parent].EndSite = joints[number].Offset
        else:
            joints[parent].Children.append(joints[number])
    return package.BvhContainer(joints[0], len(motion), motion.frame_time)


def _bvhio() -> ModuleType:
    """The package bvhio; everything else works without it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PendingDeprecationWarning)  # of pyglm, which it imports
            return importlib.import_module("bvhio")
    except ImportError as error:
        raise MissingPackageError(
            "this needs the package bvhio: pip install bvhio, with Python 3.13 or older (it has no builds for 3.14)"
        ) from error


def _check_container(container: bvhio.BvhContainer) -> None:
    """Raise a MotionError unless this is a container with a root, a number of frames and a frame time."""
    package = _bvhio()
    if not isinstance(container, package.BvhContainer):
        found = type(container).__name__
        raise MotionError(f"expected a bvhio.BvhContainer, as bvhio.readAsBvh returns it, found a {found}")
    if not isinstance(container.Root, package.BvhJoint):
        raise MotionError(f"Root is {container.Root!r}, expected a bvhio.BvhJoint")
    count, time = container.FrameCount, container.FrameTime
    if not isinstance(count, int | np.integer) or count < 0:
        raise MotionError(f"FrameCount is {count!r}, expected a whole number")
    if not isinstance(time, int | float | np.floating) or not 0 < time < np.inf:
        raise MotionError(f"FrameTime is {time!r}, expected a number of seconds above 0")


def _nodes(root: bvhio.BvhJoint) -> Iterator[tuple[bvhio.BvhJoint, int, bool]]:
    """Yield, depth first, (joint, parent's index in this order, False), and for End Sites (parent, its index, True)."""
    stack, number = [(root, -1, False)], 0
    while stack:
        joint, parent, is_end_site = stack.pop()
        yield joint, parent, is_end_site
        if not is_end_site:
            children = [(child, number, False) for child in joint.Children]
            stack.extend(reversed(children or [(joint, number, True)]))
        number += 1


def _skeleton(nodes: list[tuple[bvhio.BvhJoint, int, bool]]) -> Skeleton:
    joints, parents, end_sites = zip(*nodes, strict=True)
    return Skeleton(
        names=joint_names([joint.Name for joint in joints], parents, end_sites),
        parents=np.array(parents),
        offsets=np.array([joint.EndSite if is_end_site else joint.Offset for joint, _, is_end_site in nodes]),
        channels=tuple(() if is_end_site else tuple(joint.Channels) for joint, _, is_end_site in nodes),
        end_sites=np.array(end_sites),
    )


def _poses(joint: bvhio.BvhJoint, frames: int) -> tuple[Array, Array]:
    """A joint's translations (frames, 3) and rotations (frames, 4), x y z w."""
    keys = joint.Keyframes[:frames]
    if len(keys) < frames:
        raise MotionError(
            f"{joint.Name!r} has {len(keys)} keyframes, the container {frames} frames; read it with loadKeyFrames=True"
        )
    translations = np.array([key.Position for key in keys], np.float64).reshape(frames, 3)
    quaternions = np.array([key.Rotation for key in keys], np.float64).reshape(frames, 4)[:, [1, 2, 3, 0]]
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    if not (np.all(np.isfinite(translations)) and np.all(np.isfinite(lengths)) and np.all(lengths > 0)):
        raise MotionError(f"a keyframe of {joint.Name!r} has a position or rotation that is not finite, or no rotation")
    return translations, quaternions / lengths


def _joint(package: ModuleType, motion: Motion, number: int) -> bvhio.BvhJoint:
    """A joint with its channels and keyframes, without children."""
    skeleton = motion.skeleton
    joint = package.BvhJoint(skeleton.names[number], skeleton.offsets[number])
    joint.EndSite *= 0  # instead of (0, 1, 0)
    joint.Channels = list(skeleton.channels[number])
    quaternions = motion.rotations[:, number, [3, 0, 1, 2]]  # w x y z
    joint.Keyframes = list(map(package.Pose, motion.translations_of(number), quaternions))
    return joint
