"""Skeletons with joints added, left out, turned and resized."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.named_anatomy import by_names
from distretarget.skeleton import Skeleton


def roles(skeleton: Skeleton) -> Mapping[str, int]:
    """The joint of each role, such as "leftFoot", found by the names of the joints.

    Raises:
        ValueError: the names are not those of a person.
    """
    anatomy = by_names(skeleton)
    if anatomy is None:
        raise ValueError("the names of the joints are not those of a person")
    return anatomy.roles


def places(skeleton: Skeleton) -> NDArray[np.float64]:
    """(joints, 3), the positions of the joints in the rest pose, the root at its OFFSET [cm]."""
    return np.asarray(skeleton.rest_positions + skeleton.offsets[0])


def with_chain(skeleton: Skeleton, parent: int, offsets: Mapping[str, ArrayLike], end: ArrayLike | None) -> Skeleton:
    """The skeleton with a chain of joints below `parent`, each the child of the one before, with its offset (3,) [cm];
    the last has an End Site at `end`, (3,), or none.
    """
    names = list(offsets)
    rows = [*offsets.values(), *([end] if end is not None else [])]
    first = len(skeleton)
    rotations = skeleton.channels[0][-3:]
    return replace(
        skeleton,
        names=(*skeleton.names, *names, *([f"{names[-1]}_End"] if end is not None else [])),
        parents=np.append(skeleton.parents, [parent, *range(first, first + len(rows) - 1)]),
        offsets=np.append(skeleton.offsets, np.array(rows, float), axis=0),
        channels=(*skeleton.channels, *[rotations] * len(names), *([()] if end is not None else [])),
        end_sites=np.append(skeleton.end_sites, np.arange(len(rows)) >= len(names)),
    )


def with_end(skeleton: Skeleton, parent: int, offset: ArrayLike) -> Skeleton:
    """The skeleton with an End Site below a joint, at this offset (3,) [cm]."""
    return replace(
        skeleton,
        names=(*skeleton.names, f"{skeleton.names[parent]}_End"),
        parents=np.append(skeleton.parents, parent),
        offsets=np.append(skeleton.offsets, [np.asarray(offset, float)], axis=0),
        channels=(*skeleton.channels, ()),
        end_sites=np.append(skeleton.end_sites, True),
    )


def without(skeleton: Skeleton, joints: Iterable[int]) -> Skeleton:
    """The skeleton without these joints and all joints below them."""
    gone = {below for joint in joints for below in skeleton.subtree(joint)}
    kept = [joint for joint in range(len(skeleton)) if joint not in gone]
    number = {joint: place for place, joint in enumerate(kept)}
    return replace(
        skeleton,
        names=tuple(skeleton.names[joint] for joint in kept),
        parents=np.array([number.get(int(skeleton.parents[joint]), -1) for joint in kept]),
        offsets=skeleton.offsets[kept],
        channels=tuple(skeleton.channels[joint] for joint in kept),
        end_sites=skeleton.end_sites[kept],
    )


def bare(skeleton: Skeleton, joint: int) -> Skeleton:
    """The skeleton without anything below a joint."""
    return without(skeleton, skeleton.children[joint])


def with_offset(skeleton: Skeleton, joint: int, offset: ArrayLike) -> Skeleton:
    """The skeleton with another offset of a joint, (3,) [cm]."""
    offsets = np.array(skeleton.offsets)
    offsets[joint] = offset
    return skeleton.with_offsets(offsets)


def resized(skeleton: Skeleton, joints: Iterable[int], factor: ArrayLike) -> Skeleton:
    """The skeleton with the offsets of joints multiplied by a number, or by one for each axis, (3,)."""
    offsets = np.array(skeleton.offsets)
    offsets[list(joints)] *= np.asarray(factor)
    return skeleton.with_offsets(offsets)


def turned_below(skeleton: Skeleton, joint: int, turn: Rotation) -> Skeleton:
    """The skeleton with all that is below a joint turned about it."""
    offsets = np.array(skeleton.offsets)
    below = skeleton.subtree(joint)[1:]
    offsets[below] = turn.apply(offsets[below])
    return skeleton.with_offsets(offsets)
