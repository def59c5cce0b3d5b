"""Reading BVH files: from degrees and channels to the quaternions and translations of a Motion."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import BvhError, SkeletonError
from distretarget.io.bvh_parser import Words, take_frame_count, take_frames, take_hierarchy, take_motion_keyword
from distretarget.io.files import read_text
from distretarget.motion import Motion, MovingBones
from distretarget.numerics.euler import write_channel_rotations
from distretarget.numerics.vectors import lengths
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

Array = NDArray[np.float64]

NOISE = 0.01  # position channels that stay this close to zero are noise [length of the OFFSET]


def read_bvh(path: str | Path) -> Motion:
    """The motion of a BVH file; see `parse_bvh`.

    Raises:
        FileError: the file cannot be read as text.
        BvhError: it is not a whole BVH file.
    """
    return parse_bvh(read_text(path), path)


def parse_bvh(text: str, path: str | Path) -> Motion:
    """The motion in the text of a BVH file; `path` is for errors.

    A position channel replaces its component of the OFFSET, or is added to it; see `add_offsets`. End Sites become
    joints called `<parent>_End`, `<parent>_End2`, ...

    Raises:
        BvhError: it is not a whole BVH file.
    """
    words = Words(path, text)
    skeleton = _take_skeleton(words)
    if not take_motion_keyword(words):
        words.refuse("", "MOTION")
    return _take_motion(words, skeleton)


def parse_bvh_skeleton(text: str, path: str | Path) -> Skeleton:
    """The skeleton in the text of a BVH file, from its HIERARCHY; the MOTION may be missing or broken.

    Where joints below the root have position channels, their OFFSETs need not be their bones: then the frames are read
    too, if there are any, and the bones are those of `Motion.rigid_skeleton`.

    Raises:
        BvhError: it has no whole HIERARCHY, or broken frames where they are needed.
    """
    words = Words(path, text)
    skeleton = _take_skeleton(words)
    has_motion = take_motion_keyword(words)
    return _take_motion(words, skeleton).rigid_skeleton if has_motion and _sliding(skeleton).size else skeleton


def declared_frames(text: str) -> int | None:
    """The number of frames that a text declares, 0 if it ends after its HIERARCHY; None if that is not BVH."""
    words = Words("", text)
    try:
        _take_skeleton(words)
        return take_frame_count(words) if take_motion_keyword(words) else 0
    except BvhError:
        return None


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
    """The names of joints, with unique names for End Sites: `<parent>_End`, `<parent>_End2`, ...

    Parents come before children. The given names of End Sites are not used.
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
    """The first joint whose names from the root down are those of an earlier joint, else the root."""
    paths: list[tuple[str, ...]] = []
    for name, parent in zip(names, parents, strict=True):
        path = (*(paths[parent] if parent >= 0 else ()), name)
        if path in paths:
            return len(paths)
        paths.append(path)
    return 0


def _take_motion(words: Words, skeleton: Skeleton) -> Motion:
    frame_time_text, values = take_frames(words, sum(map(len, skeleton.channels)))
    columns = _columns(skeleton)
    rotations, joints = _rotations(skeleton, columns, values), np.append(0, _sliding(skeleton))
    translations = _translations(skeleton, columns, joints, values)
    moving = MovingBones.among(skeleton, joints, translations)
    return Motion(skeleton, np.ascontiguousarray(translations[:, 0]), rotations, frame_time_text, moving)


def _sliding(skeleton: Skeleton) -> NDArray[np.intp]:
    """The joints below the root that have position channels."""
    slides = [not set(POSITION_CHANNELS).isdisjoint(channels) for channels in skeleton.channels[1:]]
    return np.flatnonzero(slides) + 1


def _columns(skeleton: Skeleton) -> list[dict[str, int]]:
    """Per joint, the column of each of its channels in the frames."""
    column = itertools.count()
    return [{channel: next(column) for channel in channels} for channels in skeleton.channels]


def rotation_axes(channels: Sequence[str]) -> str:
    """The axes of the rotation channels in their order, such as "ZXY"."""
    return "".join(channel[0] for channel in channels if channel not in POSITION_CHANNELS)


def _translations(
    skeleton: Skeleton, columns: Sequence[Mapping[str, int]], joints: NDArray[np.intp], values: Array
) -> Array:
    """(frames, joints, 3) from the frames (frames, channels): the offsets, replaced by position channels."""
    translations = np.tile(skeleton.offsets[joints], (len(values), 1, 1))
    for row, joint in enumerate(joints):
        for component, channel in enumerate(POSITION_CHANNELS):
            if channel in columns[joint]:
                translations[:, row, component] = values[:, columns[joint][channel]]
    add_offsets(skeleton, joints, translations)
    return translations


def add_offsets(skeleton: Skeleton, joints: NDArray[np.intp], translations: Array) -> None:
    """Add OFFSETs to `translations` (frames, joints, 3), which have the position channels, where these hold only noise.

    MakeHuman writes position channels with nothing but rounding noise on all joints; if they replaced the OFFSETs, the
    body would collapse into one point. So where several joints below the root have position channels, and most of these
    stay within `NOISE` of zero though their OFFSETs do not, all of them are added.
    """
    sizes = skeleton.lengths[joints]
    slides = [joint > 0 and set(POSITION_CHANNELS) <= set(skeleton.channels[joint]) for joint in joints]
    rows = np.flatnonzero(slides & (sizes > 0))
    if len(rows) < 2 or not len(translations):
        return
    largest = lengths(translations[:, rows]).max(axis=0)
    if np.median(largest / sizes[rows]) < NOISE:
        translations[:, rows] += skeleton.offsets[joints[rows]]


def _rotations(skeleton: Skeleton, columns: Sequence[Mapping[str, int]], values: Array) -> Array:
    """(frames, joints, 4) from the frames (frames, channels), all joints of one rotation order at once."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(values), len(skeleton), 1))
    orders: defaultdict[str, list[int]] = defaultdict(list)
    for joint, channels in enumerate(skeleton.channels):
        orders[rotation_axes(channels)].append(joint)
    for axes in filter(None, orders):
        chosen = np.array([[columns[joint][f"{axis}rotation"] for axis in axes] for joint in orders[axes]], np.intp)
        write_channel_rotations(values, chosen, axes, np.array(orders[axes], np.intp), rotations)
    return rotations
