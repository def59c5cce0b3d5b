"""Writing BVH files."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget.checks import check_kind
from distretarget.errors import MotionError, SkeletonError
from distretarget.io.bvh import rotation_axes
from distretarget.io.bvh_parser import is_name
from distretarget.io.decimals import rows_text
from distretarget.io.files import write_whole
from distretarget.motion import Motion
from distretarget.numerics.euler import euler_angles
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

Array = NDArray[np.float64]

ANGLE_DECIMALS = 6  # decimals of an angle in degrees
TEXT_FRAMES = 1024  # length of each part of the text [frames]


def write_bvh(path: str | Path, motion: Motion, overwrite: bool = False) -> None:
    """Write a motion to a BVH file, whole or not at all; see `format_bvh`.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SkeletonError, MotionError: the motion cannot be said in BVH.
    """
    write_whole(path, bvh_parts(motion), overwrite)


def format_bvh(motion: Motion) -> str:
    """The BVH text of a motion.

    Offsets have all their digits, angles 6 decimals, positions as many as 1e-8 of the body needs, at least
    6. The root's OFFSET is zero where a channel replaces it: readers disagree on whether to add the two.
    Angles are continuous from frame to frame.

    Raises:
        SkeletonError: a name that BVH cannot hold.
        MotionError: a value that is not finite.
    """
    return "".join(bvh_parts(motion))


def bvh_parts(motion: Motion, mapper: Callable[..., Iterable[str]] = map) -> Iterable[str]:
    """The text of `format_bvh`, in parts.

    `mapper` is like `map`; that of an executor has the parts made while the caller does something else.
    """
    check_kind("motion", motion, Motion)
    head = [f"Frames: {len(motion)}", f"Frame Time: {motion.frame_time_text}"]
    lines = [*_hierarchy_lines(motion.skeleton), "MOTION", *head]
    values, decimals = _channel_values(motion), _decimals(motion.skeleton)
    blocks = [values[first : first + TEXT_FRAMES] for first in range(0, len(values), TEXT_FRAMES)]
    return itertools.chain(["\n".join([*lines, ""])], mapper(rows_text, blocks, itertools.repeat(decimals)))


def _hierarchy_lines(skeleton: Skeleton) -> Iterator[str]:
    """The HIERARCHY, joints depth first."""
    depths = np.zeros(len(skeleton), np.intp)
    for joint, parent in enumerate(skeleton.parents[1:], start=1):
        depths[joint] = depths[parent] + 1
    order = skeleton.depth_first
    yield "HIERARCHY"
    for joint, closing in zip(order, _closings([int(depths[joint]) for joint in order]), strict=True):
        yield from ("  " * depths[joint] + line for line in _joint_lines(skeleton, joint))
        yield from ("  " * (depths[joint] - up) + "}" for up in range(closing))


def _closings(depths: Sequence[int]) -> list[int]:
    """How many braces close after each joint, joints being listed depth first."""
    return [depth + 1 - following for depth, following in zip(depths, [*depths[1:], 0], strict=True)]


def _joint_lines(skeleton: Skeleton, joint: int) -> Iterator[str]:
    """A joint up to its children."""
    yield _header(skeleton, joint)
    yield "{"
    yield "  OFFSET " + " ".join(map(_offset_word, _written_offset(skeleton, joint)))
    if not skeleton.end_sites[joint]:
        yield "  " + " ".join(["CHANNELS", str(len(skeleton.channels[joint])), *skeleton.channels[joint]])


def _header(skeleton: Skeleton, joint: int) -> str:
    name = skeleton.names[joint]
    if skeleton.end_sites[joint]:
        return "End Site"
    if not is_name(name):
        raise SkeletonError(f"BVH cannot hold the joint name {name!r}; rename it")
    return f"{'JOINT' if joint else 'ROOT'} {name}"


def _written_offset(skeleton: Skeleton, joint: int) -> Array:
    """(3,), the joint's offset; for the root zero where a channel replaces it."""
    replaced = [not joint and channel in skeleton.channels[joint] for channel in POSITION_CHANNELS]
    return np.where(replaced, 0.0, skeleton.offsets[joint])


def _offset_word(value: float) -> str:
    return np.format_float_positional(value + 0.0, unique=True, min_digits=6)


def _decimals(skeleton: Skeleton) -> list[int]:
    """How many decimals each channel gets, depth first."""
    channels = [channel for joint in skeleton.depth_first for channel in skeleton.channels[joint]]
    fine = _position_decimals(skeleton)
    return [fine if channel in POSITION_CHANNELS else ANGLE_DECIMALS for channel in channels]


def _position_decimals(skeleton: Skeleton) -> int:
    """How many decimals tell 1e-8 of the longest path apart, at least 6."""
    longest = float(np.max(skeleton.path_lengths))
    return max(6, math.ceil(8 - math.log10(longest))) if 0 < longest < math.inf else 6


def _channel_values(motion: Motion) -> Array:
    """(frames, channels) as they are written, depth first: positions, and angles in degrees.

    What would be written as minus zero is zero.
    """
    values = np.empty((len(motion), sum(map(len, motion.skeleton.channels))))
    columns, decimals = itertools.count(), iter(_decimals(motion.skeleton))
    for joint in motion.skeleton.depth_first:
        channels = motion.skeleton.channels[joint]
        axes = rotation_axes(channels)
        angles = np.degrees(euler_angles(motion.rotations[:, joint], axes))
        places = motion.translations_of(joint)
        for channel in channels:
            is_position = channel in POSITION_CHANNELS
            column = places[:, "XYZ".index(channel[0])] if is_position else angles[:, axes.index(channel[0])]
            if not np.all(np.isfinite(column)):
                raise MotionError("a position or rotation is not finite and cannot be written")
            values[:, next(columns)] = np.where(np.abs(column) <= 0.5 * 10.0 ** -next(decimals), 0.0, column)
    return values
