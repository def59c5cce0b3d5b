"""Write BVH files; list which other programs cannot read them."""

from __future__ import annotations

import itertools
import math
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from distretarget.checks import check_kind
from distretarget.errors import MotionError, SkeletonError, counted
from distretarget.io.bvh import MAX_DEPTH, is_name
from distretarget.io.files import write_whole
from distretarget.io.number_text import rows_text
from distretarget.motion import Motion
from distretarget.numerics.euler import angle_state, euler_angles, write_channel_angles
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import Array, extent
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

ANGLE_DECIMALS = 6  # decimals of an angle in degrees
SURROGATES = re.compile(r"[\ud800-\udfff]")  # stand for bytes that are not UTF-8


def write_bvh(path: str | Path, motion: Motion, overwrite: bool = False) -> None:
    """Write a motion to a BVH file, complete or not at all.

    Offsets are written with all digits; angles with 6 decimals, continuous from frame to frame; positions with at least
    6 decimals and a resolution of 1e-8 of the body's size. The root's OFFSET is zero where a channel replaces it, since
    readers disagree on whether to add the two. A body that faces -Z, as in VRM 0, is turned to face +Z.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SkeletonError, MotionError: a name that BVH cannot hold; a value that is not finite.
    """
    write_whole(path, bvh_parts(motion), overwrite)


def bvh_parts(motion: Motion) -> Iterator[str]:
    """Return the BVH text of a motion in parts, made one by one; errors as in `write_bvh`."""
    check_kind("motion", motion, Motion)
    motion = _with_channels(motion.facing_forward())  # readers of BVH expect +Z
    size = motion.skeleton.longest_path
    position_decimals = max(6, math.ceil(8 - math.log10(size))) if 0 < size < math.inf else 6  # for 1e-8 of the size
    channels = (channel for joint in motion.skeleton.depth_first for channel in motion.skeleton.channels[joint])
    decimals = [position_decimals if channel in POSITION_CHANNELS else ANGLE_DECIMALS for channel in channels]
    paths = [motion.root_positions, *([motion.moving.translations] if motion.moving else [])]
    if not np.isfinite([extent(path) for path in paths]).all():
        raise MotionError("a position is not finite and cannot be written")
    head = f"{_hierarchy(motion.skeleton)}MOTION\nFrames: {len(motion)}\nFrame Time: {motion.frame_time_text}\n"
    rows = map(rows_text, _channel_values(motion, decimals), itertools.repeat(decimals))
    return itertools.chain([head], rows)


def _with_channels(motion: Motion) -> Motion:
    """The motion with a position channel for each translation component below the root that changes."""
    if motion.moving is None:
        return motion
    skeleton, channels = motion.skeleton, list(motion.skeleton.channels)
    changing = (motion.moving.translations != skeleton.offsets[motion.moving.joints]).any(axis=0)
    for joint, axes in zip(motion.moving.joints.tolist(), changing, strict=True):
        own = channels[joint]
        if not skeleton.end_sites[joint]:
            needed = [each for each, moves in zip(POSITION_CHANNELS, axes, strict=True) if moves]
            channels[joint] = (*(each for each in needed if each not in own), *own)
    return replace(motion, skeleton=replace(skeleton, channels=tuple(channels)))


@lru_cache(maxsize=4)  # clips on one skeleton share the text
def _hierarchy(skeleton: Skeleton) -> str:
    order, depths = skeleton.depth_first, skeleton.depths
    if (deepest := int(depths.max())) > MAX_DEPTH:
        raise SkeletonError(f"a joint is inside {deepest} others; BVH files have {MAX_DEPTH} at most")
    following = [*depths[list(order[1:])], 0]
    lines = ["HIERARCHY"]
    for joint, next_depth in zip(order, following, strict=True):
        lines += ["  " * depths[joint] + line for line in _joint_lines(skeleton, joint)]
        lines += ["  " * depth + "}" for depth in range(depths[joint], next_depth - 1, -1)]
    return "\n".join([*lines, ""])


def _joint_lines(skeleton: Skeleton, joint: int) -> Iterator[str]:
    """The lines of a joint, without children. The root's offset is zero where a channel replaces it."""
    name, channels = skeleton.names[joint], skeleton.channels[joint]
    if not skeleton.end_sites[joint] and not is_name(name):
        raise SkeletonError(f"BVH cannot hold the joint name {name!r}; rename it")
    yield "End Site" if skeleton.end_sites[joint] else f"{'JOINT' if joint else 'ROOT'} {name}"
    yield "{"
    replaced = [not joint and channel in channels for channel in POSITION_CHANNELS]
    offset = np.where(replaced, 0.0, skeleton.offsets[joint]) + 0.0  # no minus zero
    yield "  OFFSET " + " ".join(np.format_float_positional(value, unique=True, min_digits=6) for value in offset)
    if not skeleton.end_sites[joint]:
        yield "  " + " ".join(["CHANNELS", str(len(channels)), *channels])


def _channel_values(motion: Motion, decimals: Sequence[int]) -> Iterator[Array]:
    """Yield the channel values, positions and angles [degrees], in blocks, (frames, channels), without minus zero."""
    skeleton, columns = motion.skeleton, itertools.count()
    paths: list[tuple[list[int], Array]] = []  # some columns, and their values in the whole clip
    by_order: defaultdict[str, list[tuple[int, list[int]]]] = defaultdict(list)  # joints and their columns
    for joint in skeleton.depth_first:
        column = {channel: next(columns) for channel in skeleton.channels[joint]}
        places = motion.translations_of(joint)
        for axis, channel in enumerate(POSITION_CHANNELS):
            if channel in column:
                paths.append(([column[channel]], places[:, [axis]]))
        axes = skeleton.rotation_axes(joint)
        own = [column[f"{axis}rotation"] for axis in axes]
        if len(axes) == 3:
            by_order[axes].append((joint, own))
        elif axes:
            paths.append((own, np.degrees(euler_angles(motion.rotations[:, joint], axes))))
    groups = []
    for axes, pairs in by_order.items():
        joints, angles = (np.array(each, np.intp) for each in zip(*pairs, strict=True))
        groups.append((joints, axes, angles, angle_state(len(pairs))))
    half_digit = np.array([0.5 * 10.0**-places for places in decimals])
    for block in blocks_of(len(motion)):
        values = np.empty((block.stop - block.start, len(decimals)))
        for own, path in paths:
            values[:, own] = path[block]
        for group in groups:
            write_channel_angles(motion.rotations[block], *group, values)
        values[np.abs(values) <= half_digit] = 0.0
        yield values


def refusals(skeleton: Skeleton) -> Iterator[str]:
    """Yield a line if three.js cannot play a skeleton with these joint names, with the cure; see docs/interop.md."""
    if namespaced := [name for name in _names(skeleton) if ":" in name]:
        plain = namespaced[0].rpartition(":")[2]
        yield f"three.js cannot play joints with names like {namespaced[0]!r}; --strip-namespace writes {plain!r}"


def python_refusals(skeleton: Skeleton) -> Iterator[str]:
    """Yield a line for each reason why bvhio or pybvh cannot read a skeleton; see docs/interop.md."""
    if unknown := [name for name in _names(skeleton) if SURROGATES.search(name)]:
        yield f"bvhio and pybvh cannot read names that are not UTF-8, as {unknown[0]!r}; rename the target's joints"
    for joint in skeleton.joints:
        positions = {*skeleton.channels[joint]} & {*POSITION_CHANNELS}
        if len(skeleton.rotation_axes(joint)) != 3 or len(positions) != (0 if joint else 3):
            found = f"{skeleton.names[joint]!r} has {counted(len(skeleton.channels[joint]), 'channel')}"
            rule = "it expects three rotations of each joint and positions of the root alone"
            yield f"pybvh cannot read the result: {rule}, and {found}"
            return


def _names(skeleton: Skeleton) -> list[str]:
    return [skeleton.names[joint] for joint in skeleton.joints]
