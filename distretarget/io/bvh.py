"""BVH files, read and written. Degrees and channels end here: a Motion has quaternions and translations."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.errors import MotionError, SkeletonError
from distretarget.io.bvh_parser import Words, is_name, take_frames, take_hierarchy, take_motion_keyword
from distretarget.io.files import read_text, write_whole
from distretarget.motion import Motion
from distretarget.numerics.euler import euler_angles
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

Array = NDArray[np.float64]

ANGLE_DECIMALS = 6
BLOCK = 1024  # frames of a part of the text
NOISE = 0.01  # of an OFFSET's length: position channels that stay within it say nothing


def read_bvh(path: str | Path) -> Motion:
    """The motion of a BVH file; see `parse_bvh`.

    Raises:
        FileError: the file cannot be read as text.
        BvhError: it is no whole BVH file.
    """
    return parse_bvh(read_text(path), path)


def parse_bvh(text: str, path: str | Path) -> Motion:
    """The motion in the text of a BVH file, whose path is for errors.

    A position channel replaces its component of the OFFSET; where the position channels of most joints hold nothing but
    noise about zero, they are added to it.

    End Sites become joints called `<parent>_End`, `<parent>_End2`, ...

    Raises:
        BvhError: it is no whole BVH file.
    """
    words = Words(path, text)
    skeleton = _take_skeleton(words)
    if not take_motion_keyword(words):
        words.refuse("", "MOTION")
    return _take_motion(words, skeleton)


def parse_bvh_skeleton(text: str, path: str | Path) -> Skeleton:
    """The skeleton in the text of a BVH file, from its HIERARCHY alone; the MOTION may be missing or broken.

    Where joints below the root have position channels, their OFFSETs need not be their bones: then the
    frames are read too, if there are any, and the bones are those of `Motion.rigid_skeleton`.

    Raises:
        BvhError: it has no whole HIERARCHY, or broken frames where they are needed.
    """
    words = Words(path, text)
    skeleton = _take_skeleton(words)
    has_motion = take_motion_keyword(words)
    slides = any(channel in POSITION_CHANNELS for channels in skeleton.channels[1:] for channel in channels)
    return _take_motion(words, skeleton).rigid_skeleton if has_motion and slides else skeleton


def write_bvh(path: str | Path, motion: Motion, overwrite: bool = False) -> None:
    """Write a motion to a BVH file, whole or not at all; see `format_bvh`.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SkeletonError, MotionError: the motion cannot be said in BVH.
    """
    write_whole(path, format_bvh(motion), overwrite)


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
    head = [f"Frames: {len(motion)}", f"Frame Time: {motion.frame_time_text}"]
    lines = [*_hierarchy_lines(motion.skeleton), "MOTION", *head]
    values, words = _channel_values(motion), _frame_words(motion.skeleton)
    blocks = [values[first : first + BLOCK] for first in range(0, len(values), BLOCK)]
    return itertools.chain(["\n".join([*lines, ""])], mapper(_frames_text, blocks, itertools.repeat(words)))


def _take_skeleton(words: Words) -> Skeleton:
    joints = take_hierarchy(words)
    parents = [joint.parent for joint in joints]
    end_sites = [joint.end_site for joint in joints]
    names = joint_names([joint.name for joint in joints], parents, end_sites)
    try:
        return Skeleton(
            names=names,
            parents=np.array(parents),
            offsets=np.array([joint.offset for joint in joints]),
            channels=tuple(joint.channels for joint in joints),
            end_sites=np.array(end_sites),
        )
    except SkeletonError as error:
        raise words.error(str(error), joints[_twin(names, parents)].at) from error


def joint_names(names: Sequence[str], parents: Sequence[int], end_sites: Sequence[bool]) -> tuple[str, ...]:
    """The names of joints as they are, those of End Sites made up: unique, `<parent>_End`, `<parent>_End2`, ...

    All three sequences have an entry per joint, parents before children; the names of End Sites are not used.
    """
    taken = {name for name, end_site in zip(names, end_sites, strict=True) if not end_site}
    unused: dict[str, Iterator[str]] = {}
    complete: list[str] = []
    for name, parent, end_site in zip(names, parents, end_sites, strict=True):
        if end_site:
            made_up = unused.setdefault(complete[parent], _end_names(complete[parent]))
            complete.append(next(name for name in made_up if name not in taken))
        else:
            complete.append(name)
    return tuple(complete)


def _end_names(parent: str) -> Iterator[str]:
    yield f"{parent}_End"
    yield from (f"{parent}_End{number}" for number in itertools.count(2))


def _twin(names: Sequence[str], parents: Sequence[int]) -> int:
    """The first joint whose names from the root down are those of another before it, else the root."""
    ways: list[tuple[str, ...]] = []
    for name, parent in zip(names, parents, strict=True):
        ways.append((*(ways[parent] if parent >= 0 else ()), name))
    first = {way: joint for joint, way in reversed(list(enumerate(ways)))}
    return next((joint for joint, way in enumerate(ways) if first[way] < joint), 0)


def _take_motion(words: Words, skeleton: Skeleton) -> Motion:
    frames = take_frames(words, sum(map(len, skeleton.channels)))
    translations, rotations = _translations(skeleton, frames.values), _rotations(skeleton, frames.values)
    return Motion(skeleton, translations, rotations, frames.frame_time_text)


def _columns(skeleton: Skeleton) -> list[dict[str, int]]:
    """Per joint, the column of the frames in which each of its channels stands."""
    column = itertools.count()
    return [{channel: next(column) for channel in channels} for channels in skeleton.channels]


def _axes(channels: Sequence[str]) -> str:
    """The axes of the rotation channels in their order, as "ZXY"."""
    return "".join(channel[0] for channel in channels if channel not in POSITION_CHANNELS)


def _translations(skeleton: Skeleton, values: Array) -> Array:
    """(frames, joints, 3) from the frames (frames, channels): offsets, or the position channels instead."""
    translations = np.tile(skeleton.offsets, (len(values), 1, 1))
    for joint, columns in enumerate(_columns(skeleton)):
        for component, channel in enumerate(POSITION_CHANNELS):
            if channel in columns:
                translations[:, joint, component] = values[:, columns[channel]]
    added = added_joints(skeleton, translations)
    translations[:, added] += skeleton.offsets[added]
    return translations


def added_joints(skeleton: Skeleton, translations: Array) -> NDArray[np.intp]:
    """The joints whose position channels, here in `translations` (frames, joints, 3), are added to their OFFSETs.

    MakeHuman writes position channels of nothing but rounding noise on all joints: replacing the OFFSETs by them would
    collapse the body into one point. So where several joints below the root have position channels, and most of these
    stay within `NOISE` of zero though their OFFSETs do not, they are all added.
    """
    slides = [j for j, columns in enumerate(_columns(skeleton)) if j and set(POSITION_CHANNELS) <= set(columns)]
    joints = np.array([j for j in slides if skeleton.lengths[j] > 0], dtype=np.intp)
    if len(joints) < 2 or not len(translations):
        return joints[:0]
    largest = np.linalg.norm(translations[:, joints], axis=-1).max(axis=0)
    return joints if np.median(largest / skeleton.lengths[joints]) < NOISE else joints[:0]


def _rotations(skeleton: Skeleton, values: Array) -> Array:
    """(frames, joints, 4) from the frames (frames, channels), all joints of one rotation order at once."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(values), len(skeleton), 1))
    orders: defaultdict[str, list[int]] = defaultdict(list)
    for joint, channels in enumerate(skeleton.channels):
        orders[_axes(channels)].append(joint)
    columns = _columns(skeleton)
    for axes in filter(None, orders):
        chosen = [[columns[joint][f"{axis}rotation"] for axis in axes] for joint in orders[axes]]
        turned = Rotation.from_euler(axes, values[:, chosen], degrees=True)
        rotations[:, orders[axes]] = turned.as_quat()
    return rotations


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


def _frame_words(skeleton: Skeleton) -> str:
    """How a frame is written, for the operator %."""
    return " ".join(f"%.{places}f" for places in _decimals(skeleton))


def _frames_text(values: Array, words: str) -> str:
    """Frames, a line each."""
    return "".join(f"{words % tuple(frame)}\n" for frame in values.tolist())


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
    columns = [np.empty((len(motion), 0))]
    for joint in motion.skeleton.depth_first:
        channels = motion.skeleton.channels[joint]
        axes = _axes(channels)
        angles = np.degrees(euler_angles(motion.rotations[:, joint], axes))
        places = motion.translations[:, joint]
        for channel in channels:
            is_position = channel in POSITION_CHANNELS
            column = places[:, "XYZ".index(channel[0])] if is_position else angles[:, axes.index(channel[0])]
            columns.append(column[:, None])
    values = np.concatenate(columns, axis=1)
    if not np.all(np.isfinite(values)):
        raise MotionError("a position or rotation is not finite and cannot be written")
    values[np.abs(values) <= 0.5 * 10.0 ** -np.array(_decimals(motion.skeleton))] = 0.0
    return values
