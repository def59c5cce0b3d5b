"""Joints that a file does not hang where a body has them: feet and hands that hang from the root, as in baked IK rigs,
not from shin and forearm; and twins, second joints at the place of others, which may have their rotations.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES
from distretarget.body.conventions import NamedTree, name_meanings
from distretarget.body.limbs import is_bend
from distretarget.body.named_anatomy import by_tree
from distretarget.motion import Motion
from distretarget.numerics.vectors import Numbers, extent, lengths
from distretarget.skeleton import ROTATION_CHANNELS, Skeleton

SHORTEST, LONGEST = 0.4, 1.6  # a lower bone is between so many times as long as the upper one: 0.45 in CMU's subject 5
STRAIGHT = np.radians(60)  # the limb of a rest pose bends by less than this at knee or elbow [rad]
STRETCH = 0.25  # a baked limb stretches by less than this where its handle was out of reach [of its length]
SAME_PLACE = 1e-6  # a joint within this of its offset is there [body sizes]
NEAR = 1e-6  # a twin is this near to its parent [longest paths]


class Hanging(NamedTuple):
    """A foot or hand and the joint from which it hangs on a body."""

    joint: int
    above: int  # knee or elbow


def limbs_beside(skeleton: Skeleton, motion: Motion | None = None) -> Iterator[Hanging]:
    """Yield the feet and hands of a skeleton that do not hang from their limb, but are named for it and are where it
    ends: in all frames of a motion, or without one in the rest pose. There are none in a file that states which joint
    is which part of the body.
    """
    tree = NamedTree.of(skeleton)
    anatomy = None if skeleton.humanoid else by_tree(tree)
    if anatomy is None:
        return
    for side, (*bones, part) in product(SIDES, (ARM[1:], LEG[:3])):
        ends = anatomy.joints(*(side + bone for bone in bones))
        if side + part in anatomy.roles or len(ends) < len(bones):
            continue
        upper, lower = ends
        meanings = name_meanings(tree)
        for joint in skeleton.joints:
            is_named = meanings.names[joint].side == side and part in meanings.parts(joint)
            apart = upper not in skeleton.line(joint) and joint not in skeleton.line(lower)
            if is_named and apart and _goes_on(skeleton, motion, upper, lower, joint):
                yield Hanging(joint, lower)
                break


def _goes_on(skeleton: Skeleton, motion: Motion | None, upper: int, lower: int, joint: int) -> bool:
    """Whether a joint is where the limb ends whose bone leads from `upper` to `lower`."""
    x = skeleton.rest_positions[None] if motion is None else motion.positions
    bone, onward = x[:, lower] - x[:, upper], x[:, joint] - x[:, lower]
    length = lengths(onward)
    usual = float(np.median(length))
    if not SHORTEST < usual / max(float(np.median(lengths(bone))), 1e-300) < LONGEST:
        return False
    return not is_bend(bone[0], onward[0], STRAIGHT) if motion is None else bool(np.ptp(length) < STRETCH * usual)


class Tree(NamedTuple):
    """A skeleton made of some joints of another one, at the same places in another tree."""

    skeleton: Skeleton
    joints: Numbers  # (joints,), the joint of the other skeleton that each is

    @property
    def in_order(self) -> bool:
        """Whether it has all joints of the other skeleton, in their order."""
        return bool((self.joints == np.arange(len(self.joints))).all())

    def motion(self, motion: Motion) -> Motion:
        """Return a motion of the other skeleton by this one: all joints are where and turned as they were."""
        world, places = motion.world_rotations[:, self.joints], motion.positions[:, self.joints]
        parents = self.skeleton.parents
        is_below = (parents >= 0)[:, None]
        above = Rotation.from_quat(np.where(is_below, world[:, parents], [0.0, 0.0, 0.0, 1.0])).inv()
        translations = above.apply(places - np.where(is_below, places[:, parents], 0.0))
        rotations, offsets = (above * Rotation.from_quat(world)).as_quat(), self.skeleton.offsets
        away = lengths(translations - offsets).max(axis=0, initial=0.0)
        still = is_below[:, 0] & (away < SAME_PLACE * extent(self.skeleton.rest_positions))
        translations[:, still] = offsets[still]
        return Motion.of_translations(self.skeleton, translations, rotations, motion.frame_time_text)


def in_tree(skeleton: Skeleton, parents: Mapping[int, int], channels: Mapping[int, Sequence[str]]) -> Tree:
    """Return the skeleton of some joints of another one, each with its parent among them, -1 for the root, in
    `parents`, and with its channels.
    """
    joints = _top_down(parents)
    places, numbers = skeleton.rest_positions, {joint: number for number, joint in enumerate(joints)}
    above = np.array([numbers.get(parents[joint], -1) for joint in joints])
    offsets = places[joints] - np.where((above >= 0)[:, None], places[joints][above], -skeleton.offsets[0])
    made = replace(
        skeleton,
        names=tuple(skeleton.names[joint] for joint in joints),
        parents=above,
        offsets=offsets,
        channels=tuple(tuple(channels[joint]) for joint in joints),
        end_sites=skeleton.end_sites[joints],
    )
    return Tree(made, np.array(joints))


def limbs_on_body(skeleton: Skeleton, motion: Motion | None = None) -> Tree | None:
    """Return the skeleton in which feet and hands hang from shin and forearm, turning only; None where they do. A
    motion, if there is one, shows where they are.
    """
    beside = [*limbs_beside(skeleton, motion)]
    if not beside:
        return None
    turns = {
        joint: tuple(each for each in skeleton.channels[joint] if each in ROTATION_CHANNELS) for joint, _ in beside
    }
    parents = dict(enumerate(skeleton.parents.tolist())) | dict(beside)
    return in_tree(skeleton, parents, dict(enumerate(skeleton.channels)) | turns)


def _top_down(parents: Mapping[int, int]) -> list[int]:
    """The joints of a tree, each after its parent: in their order if that is so in it."""
    if all(parent < joint for joint, parent in parents.items()):
        return sorted(parents)
    below: dict[int, list[int]] = defaultdict(list)
    for joint in sorted(parents):
        below[parents[joint]].append(joint)
    joints = below[-1]
    for upper in joints:
        joints.extend(below[upper])
    return joints


# ---- twins


def without_twins(motion: Motion, kept: Collection[str] = ()) -> Motion:
    """Return a motion in which a joint and its twin, such as "Arm" and "Arm.001" or "Arm_rot", are one joint with the
    rotations of both; the same motion where there is none, or where one of the twins is `kept`, by key.
    """
    skeleton = motion.rigid_skeleton
    twins = {*_twins(skeleton)}
    if not twins or any(skeleton.keys[twin] in kept for twin in twins):
        return motion
    lowest = list(range(len(skeleton)))  # of the twins at the place of each joint
    for twin in sorted(twins, reverse=True):
        lowest[skeleton.parents[twin]] = lowest[twin]
    tops = [joint for joint in range(len(skeleton)) if joint not in twins]
    above = {lowest[top]: lowest[skeleton.parents[top]] if top else -1 for top in tops}
    tree = in_tree(skeleton, above, {lowest[top]: skeleton.channels[top] for top in tops})
    names = {lowest[top]: skeleton.names[top] for top in tops}
    one_each = replace(tree.skeleton, names=tuple(names[joint] for joint in tree.joints.tolist()))
    return Tree(one_each, tree.joints).motion(motion)


def _twins(skeleton: Skeleton) -> Iterator[int]:
    """The twins: joints at their parent's place, its only children, with its name and one more word, not a number, as
    joints of a spine have.
    """
    near = skeleton.lengths <= NEAR * skeleton.longest_path
    for joint in skeleton.joints[1:]:
        parent = skeleton.parents.item(joint)
        more = skeleton.names[joint].removeprefix(skeleton.names[parent])
        is_word = more[:1].isupper() or not more[:1].isalnum()
        named = more not in ("", skeleton.names[joint]) and is_word
        alone = [child for child in skeleton.children[parent] if not skeleton.end_sites[child]] == [joint]
        if near[joint] and alone and named:
            yield joint
