"""Twins: a joint without length below another one that is named for it, which may hold the rotations of both."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

from distretarget.body.beside import Tree, in_tree
from distretarget.motion import Motion
from distretarget.skeleton import Skeleton

NEAR = 1e-6  # joints this near to each other are at one place [longest paths]


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
