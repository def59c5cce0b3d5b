"""Skeletons with joints added, left out, turned and resized."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from distretarget import Motion, Skeleton
from distretarget.body.recognition import by_names
from distretarget.numerics.rotations import least

NO_BONE = 0.1  # a joint this near to its parent shows no bone [cm]


def roles(skeleton: Skeleton) -> Mapping[str, int]:
    """The joint of each role, such as "leftFoot", found by name."""
    anatomy = by_names(skeleton)
    if anatomy is None:
        raise ValueError("the names of the joints are not those of a person")
    return anatomy.roles


def places(skeleton: Skeleton) -> NDArray[np.float64]:
    """(joints, 3), the positions of the joints in the rest pose, the root at its OFFSET."""
    return np.asarray(skeleton.rest_positions + skeleton.offsets[0])


def with_chain(
    skeleton: Skeleton, parent: int, offsets: Mapping[str, ArrayLike], end: ArrayLike | None = None
) -> Skeleton:
    """The skeleton with a chain of new joints below the joint `parent`, with `offsets`, (3,), by name and the root's
    rotation channels, and an End Site at the offset `end` after the last, if given.
    """
    ends = [] if end is None else [end]
    rows = [*offsets.values(), *ends]
    names = [*offsets, *(f"{[skeleton.names[parent], *offsets][-1]}_End" for _ in ends)]
    first = len(skeleton)
    return replace(
        skeleton,
        names=(*skeleton.names, *names),
        parents=np.append(skeleton.parents, [parent, *range(first, first + len(rows) - 1)]),
        offsets=np.append(skeleton.offsets, np.array(rows, float), axis=0),
        channels=(*skeleton.channels, *[skeleton.channels[0][-3:]] * len(offsets), *[() for _ in ends]),
        end_sites=np.append(skeleton.end_sites, np.arange(len(rows)) >= len(offsets)),
    )


def below_root(skeleton: Skeleton, name: str, place: ArrayLike, channels: tuple[str, ...]) -> Skeleton:
    """The skeleton below a new root at a place, (3,), with the old root's channels; the old one gets `channels`."""
    offsets = np.array(skeleton.offsets)
    offsets[0] -= place
    return replace(
        skeleton,
        names=(name, *skeleton.names),
        parents=np.append(-1, skeleton.parents + 1),
        offsets=np.vstack([place, offsets]),
        channels=(skeleton.channels[0], channels, *skeleton.channels[1:]),
        end_sites=np.append(False, skeleton.end_sites),
    )


def only(skeleton: Skeleton, joints: Iterable[int]) -> Skeleton:
    """The skeleton reduced to these joints, each below its nearest remaining ancestor."""
    chosen = sorted(joints)
    number = {joint: place for place, joint in enumerate(chosen)}
    return replace(
        skeleton,
        names=tuple(skeleton.names[joint] for joint in chosen),
        parents=np.array([next((number[a] for a in skeleton.to_root(j)[1:] if a in number), -1) for j in chosen]),
        offsets=skeleton.offsets[chosen],
        channels=tuple(skeleton.channels[joint] for joint in chosen),
        end_sites=skeleton.end_sites[chosen],
    )


def bare(skeleton: Skeleton, joint: int) -> Skeleton:
    """The skeleton without anything below a joint."""
    return only(skeleton, set(range(len(skeleton))) - set(skeleton.subtree(joint)[1:]))


def with_offset(skeleton: Skeleton, joints: int | Sequence[int], offsets: ArrayLike) -> Skeleton:
    """The skeleton with other offsets of one or more joints, (3,) or (joints, 3)."""
    changed = np.array(skeleton.offsets)
    changed[joints] = offsets
    return skeleton.with_offsets(changed)


def turned_below(skeleton: Skeleton, joint: int, turn: Rotation) -> Skeleton:
    """The skeleton with everything below a joint turned about it."""
    below = skeleton.subtree(joint)[1:]
    return with_offset(skeleton, below, turn.apply(skeleton.offsets[below]))


@dataclass(frozen=True)
class Along:
    """A rest pose that is not a standing one: all bones lie along one axis of their joints, those of the right side in
    its negative direction if `mirrored`. `base` has the hips' axes as columns, in the axes of a body in T-pose.
    """

    base: NDArray[np.float64]
    axis: int
    mirrored: bool = False

    def axes(self, skeleton: Skeleton) -> Rotation:
        """The axes of each joint of a skeleton in T-pose; a joint with no bone or several has those of its parent."""
        joints = roles(skeleton)
        right = {*skeleton.subtree(joints["rightShoulder"]), *skeleton.subtree(joints["rightUpperLeg"])}
        axes = [Rotation.identity()] * joints["hips"]
        for joint in range(len(axes), len(skeleton)):
            below = [child for child in skeleton.children[joint] if skeleton.lengths[child] > NO_BONE]
            turn = Rotation.from_matrix(self.base) if joint == joints["hips"] else axes[skeleton.parents[joint]]
            if len(below) == 1:
                along = turn.as_matrix()[:, self.axis] * (-1.0 if self.mirrored and joint in right else 1.0)
                turn = least(along[None], skeleton.offsets[below]) * turn
            axes.append(turn)
        return Rotation.from_quat(np.array([turn.as_quat() for turn in axes]))


LEFT, UP, FORWARD = np.eye(3)
LYING: Mapping[str, Along] = {
    "X": Along(np.column_stack([UP, FORWARD, LEFT]), axis=0),  # LAFAN1
    "Y": Along(np.eye(3), axis=1),  # Character Creator
    "X mirrored": Along(np.column_stack([UP, FORWARD, LEFT]), axis=0, mirrored=True),  # Bandai Namco
}


def with_axes(skeleton: Skeleton, axes: Rotation) -> Skeleton:
    """The skeleton with other axes of its joints, a rotation for each, and so another rest pose."""
    offsets = axes[np.maximum(skeleton.parents, 0)].inv().apply(np.array(skeleton.offsets))
    return with_offset(skeleton.with_offsets(offsets), 0, skeleton.offsets[0])


def in_axes(motion: Motion, axes: Rotation) -> Motion:
    """The same motion on a rig whose joints have other axes, as in `with_axes`."""
    above = Rotation.from_quat(np.vstack([[0.0, 0.0, 0.0, 1.0], axes.as_quat()])[motion.skeleton.parents + 1]).inv()
    translations, rotations = motion.translations, np.array(motion.rotations)
    for joint in range(len(motion.skeleton)):
        translations[:, joint] = above[joint].apply(translations[:, joint])
        rotations[:, joint] = (above[joint] * Rotation.from_quat(rotations[:, joint]) * axes[joint]).as_quat()
    skeleton = with_axes(motion.skeleton, axes)
    return Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)


def z_up(skeleton: Skeleton) -> Skeleton:
    """The skeleton turned from Y up, facing +Z, to Z up, facing -Y."""
    return replace(skeleton, offsets=skeleton.offsets[:, [0, 2, 1]] * (1, -1, 1), up="Z")
