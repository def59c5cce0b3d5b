"""Repairs of a joint tree: feet and hands that hang from the root, as in baked IK rigs, move below shin and forearm;
twins, joints at one place of which any may turn, become one joint; a joint moves to another place.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES
from distretarget.body.conventions import NamedTree, name_meanings
from distretarget.body.limbs import is_bend
from distretarget.body.named_anatomy import by_tree
from distretarget.motion import Motion
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.vectors import Array, Numbers, extent, lengths
from distretarget.skeleton import ROTATION_CHANNELS, Skeleton, same_up_to_scale
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh

SHORTEST, LONGEST = 0.4, 1.6  # length of a lower bone: 0.45 in CMU's subject 5 [lengths of the upper bone]
STRAIGHT = np.radians(60)  # a limb in the rest pose bends by less than this at knee or elbow [rad]
STRETCH = 0.25  # a baked limb stretches by less than this where its handle was out of reach [of its length]
SAME_PLACE = 1e-6  # a translation within this of the offset is set to it [body sizes]
NEAR = 1e-6  # a twin is at most this far from its parent [longest paths]
STILL = 1e-6  # a joint that turns by less never turns [half angles, rad]


def _detached_limbs(skeleton: Skeleton, motion: Motion | None) -> Iterator[tuple[int, int]]:
    """Yield the feet and hands of a skeleton that do not hang from their limb, but have its name and are at its end in
    all frames of a motion, or without one in the rest pose, each with the knee or elbow above it. A file with a
    `humanoid` has none.
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
            apart = upper not in skeleton.to_root(joint) and joint not in skeleton.to_root(lower)
            if is_named and apart and _is_limb_end(skeleton, motion, upper, lower, joint):
                yield joint, lower
                break


def _is_limb_end(skeleton: Skeleton, motion: Motion | None, upper: int, lower: int, joint: int) -> bool:
    """Whether a joint is at the end of the limb whose upper bone leads from `upper` to `lower`."""
    x = skeleton.rest_positions[None] if motion is None else motion.positions
    bone, onward = x[:, lower] - x[:, upper], x[:, joint] - x[:, lower]
    length = lengths(onward)
    usual = float(np.median(length))
    if not SHORTEST < usual / max(float(np.median(lengths(bone))), 1e-300) < LONGEST:
        return False
    return not is_bend(bone[0], onward[0], STRAIGHT) if motion is None else bool(np.ptp(length) < STRETCH * usual)


class Reparented(NamedTuple):
    """A skeleton with joints of another one, the original, at the same places but with other parents."""

    skeleton: Skeleton
    joints: Numbers  # (joints,), the joint of the original that each joint is

    @property
    def in_order(self) -> bool:
        """Whether it has all joints of the original, in their order."""
        return bool((self.joints == np.arange(len(self.joints))).all())

    def motion(self, motion: Motion) -> Motion:
        """Return a motion of the original on this skeleton, with the same world positions and rotations."""
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


def reparented(skeleton: Skeleton, parents: Mapping[int, int], channels: Mapping[int, Sequence[str]]) -> Reparented:
    """Return a skeleton with other parents: `parents` has the parent of each joint that stays, -1 for the root, and
    `channels` the channels of these joints.
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
    return Reparented(made, np.array(joints))


def attached_limbs(skeleton: Skeleton, motion: Motion | None = None) -> Reparented | None:
    """Return the skeleton with feet and hands attached to shin and forearm, with rotation channels only; None if they
    are attached already. A motion, if given, shows where they are.
    """
    detached = [*_detached_limbs(skeleton, motion)]
    if not detached:
        return None
    channels = dict(enumerate(skeleton.channels))
    channels |= {joint: tuple(each for each in channels[joint] if each in ROTATION_CHANNELS) for joint, _ in detached}
    return reparented(skeleton, dict(enumerate(skeleton.parents.tolist())) | dict(detached), channels)


def _top_down(parents: Mapping[int, int]) -> list[int]:
    """The joints of a tree, each after its parent; in ascending order if that has parents first."""
    if all(parent < joint for joint, parent in parents.items()):
        return sorted(parents)
    below: dict[int, list[int]] = defaultdict(list)
    for joint in sorted(parents):
        below[parents[joint]].append(joint)
    joints = below[-1]
    for upper in joints:
        joints.extend(below[upper])
    return joints


# ---- End Sites


def without_ends(motion: Motion) -> Motion:
    """Return the motion on the same skeleton without End Sites."""
    return _without(motion, np.flatnonzero(motion.skeleton.end_sites))


def without_exported_ends(source: Motion, target: Skeleton, kept: Collection[str] = ()) -> Motion:
    """Return a source without End Sites that an exporter added to the target's rig: those that the target has not,
    if all other joints are the target's, at the same distances from each other up to scale. The `kept` ones stay.
    """
    skeleton, keys = source.skeleton, {*target.keys}
    numbers = {key: joint for joint, key in enumerate(skeleton.keys)}
    others = np.array([joint for key, joint in numbers.items() if key not in keys], np.intp)
    if not len(others) or not keys <= numbers.keys() or not skeleton.end_sites[others].all():
        return source
    places = skeleton.rest_positions[[numbers[key] for key in target.keys]]
    if not same_up_to_scale(pdist(places), pdist(target.rest_positions)):
        return source
    return _without(source, others[[skeleton.keys[joint] not in kept for joint in others]])


def _without(motion: Motion, leaves: Numbers) -> Motion:
    """A motion without some joints that have no children."""
    skeleton = motion.skeleton
    left = np.setdiff1d(np.arange(len(skeleton)), leaves).tolist()
    if len(left) == len(skeleton):
        return motion
    parents = {joint: skeleton.parents.item(joint) for joint in left}
    return reparented(skeleton, parents, dict(enumerate(skeleton.channels))).motion(motion)


# ---- twins


def without_twins(motion: Motion, kept: Collection[str] = ()) -> Motion:
    """Return a motion in which a joint and its twins, such as "Arm" with "Arm.001", "Arm_rot" or "grp_Arm", are one
    joint with the rotations of all; the same motion if there are no twins, or if the key of one is in `kept`.
    """
    skeleton = motion.rigid_skeleton
    one, names = _joined(motion, skeleton)
    groups: dict[int, list[int]] = defaultdict(list)
    for joint, joined in enumerate(one):
        groups[joined].append(joint)
    tops = {joint: group[0] for joint, group in groups.items()}
    named = {next(each for each in group if skeleton.names[each] == names[group[0]]) for group in groups.values()}
    lost = {skeleton.keys[joint] for joint in skeleton.joints if joint not in named}
    if not lost or not lost.isdisjoint(kept):
        return motion
    above = {joint: one[skeleton.parents[top]] if top else -1 for joint, top in tops.items()}
    tree = reparented(skeleton, above, {joint: skeleton.channels[top] for joint, top in tops.items()})
    one_each = replace(tree.skeleton, names=tuple(names[tops[joint]] for joint in tree.joints.tolist()))
    return Reparented(one_each, tree.joints).motion(motion)


def _joined(motion: Motion, skeleton: Skeleton) -> tuple[list[int], list[str]]:
    """The joint that stands for each joint: the lowest of the twins at its place, each of which is the only child of
    the one above; the parent, for a joint at its place that never turns and has one child with its name; else itself.
    And the names of joints, those of twins the shortest.
    """
    near, names, one = skeleton.lengths <= NEAR * skeleton.longest_path, [*skeleton.names], [*range(len(skeleton))]
    below = [[child for child in children if not skeleton.end_sites[child]] for children in skeleton.children]
    for joint in reversed([joint for joint in skeleton.joints[1:] if near[joint]]):
        parent = skeleton.parents.item(joint)
        if below[parent] == [joint] and _has_name_of(names[parent], names[joint]):
            one[parent], names[parent] = joint, min(names[parent], names[joint], key=len)
        elif one[joint] == joint and len(below[joint]) == 1 and _has_name_of(names[joint], names[below[joint][0]]):
            turns = np.abs(motion.rotations[:, joint, :3]).max(initial=0.0) > STILL
            one[joint] = joint if turns else parent
    for joint in range(len(skeleton)):
        while one[joint] != one[one[joint]]:
            one[joint] = one[one[joint]]
    return one, names


def _has_name_of(one: str, other: str) -> bool:
    """Whether one of two names is the other with one more word; a number, as in the joints of a spine, is no word."""
    short, name = sorted((each.rpartition(":")[2] for each in (one, other)), key=len)
    for first in range(len(short) + 1 if 0 < len(short) < len(name) else 0):
        word = name[first : first + len(name) - len(short)]
        capital = word[0].isupper() or (first == 0 and short[0].isupper())
        is_word = capital or not (word[0].isalnum() and word[-1].isalnum())
        if is_word and short[:first] + word + short[first:] == name:
            return True
    return False


# ---- a joint at another place


class JointShift(NamedTuple):
    """The displacement of a joint in its own axes; its rotation and all other joints stay as they are."""

    joint: int
    shift: Array  # (3,), in the joint's own axes [file units]

    @property
    def inverse(self) -> JointShift:
        """The opposite displacement."""
        return JointShift(self.joint, -self.shift)

    def skeleton(self, skeleton: Skeleton) -> Skeleton:
        """Return a skeleton with the joint displaced. A root's OFFSET stays, as it is no bone, unless it is the root's
        place over the floor.
        """
        offsets = np.array(skeleton.offsets)
        offsets[list(skeleton.children[self.joint])] -= self.shift
        offsets[self.joint] += self.shift * (self.joint > 0 or skeleton.floor_at_zero)
        return skeleton.with_offsets(offsets)

    def motion(self, motion: Motion) -> Motion:
        """Return a motion with the joint displaced."""
        joint, translations = self.joint, motion.translations
        translations[:, list(motion.skeleton.children[joint])] -= self.shift
        translations[:, joint] += turned_by(np.ascontiguousarray(motion.rotations[:, joint]), self.shift)
        skeleton = self.skeleton(motion.skeleton)
        return Motion.of_translations(skeleton, translations, motion.rotations, motion.frame_time_text)

    def mesh(self, mesh: SkinnedMesh) -> SkinnedMesh:
        """Return the mesh of a skeleton with the joint displaced: its places are relative to the root."""
        return mesh if self.joint else mesh.moved(-self.shift)

    def capsules(self, capsules: Capsules) -> Capsules:
        """Return the capsules of a skeleton with the joint displaced."""
        own = (capsules.joints == self.joint)[:, None, None]
        return replace(capsules, ends=capsules.ends - own * self.shift)
