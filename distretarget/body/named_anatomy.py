"""The anatomy of a skeleton, and its IK handles, by the names of the joints and their tree."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from operator import itemgetter

from distretarget.body.anatomy import ARM, FINGERS, LEG, SIDES, Anatomy, Regions, Side, trunk_roles
from distretarget.body.conventions import (
    NamedTree,
    NameMeanings,
    name_meanings,
    stem_and_side,
    vocabulary,
    without_digits,
    words,
)
from distretarget.skeleton import Skeleton

# Points for each named part in a chain of joints: the bones of a limb count more than collar bone and toes.
PART_POINTS = dict.fromkeys(ARM + LEG, 2.0) | {"Shoulder": 1.0, "Toes": 1.0}
# Points for the fit (0 to 1) of the convention in which a name means the part; they decide between meanings of a name.
FIT_POINTS = 0.5

LONG_BONE_WORDS = ("Upper", "Lower")  # parts with these first words have a long bone
LAST_BONE = 3  # the number of a finger's last bone that has a role
FINGER_NUMBER = re.compile(r"finger(\d)")  # a finger's number in a joint's name

# Hips may have this name only where legs and trunk branch off; a joint above them with this name carries the body.
CARRIER = "root"

DEFORMING = ("def",)  # the prefix of the bones that deform the mesh in rigs with other copies of each bone

HANDLE_WORDS = frozenset(("ik", "vb"))  # the name of a handle has one of these words; "VB" marks Unreal's virtual bones
HANDLED_PARTS = ("Hand", "Foot", "Toes")  # the parts that have handles

# Handles without the name of a joint, and the name of the joint that they follow. Unreal's "ik_hand_gun", the grip
# of a weapon, is at the right hand.
NAMED_OTHERWISE: dict[tuple[str, Side | None], tuple[str, Side]] = {("handgun", None): ("hand", "right")}

Trunk = tuple[int, Sequence[int], Sequence[int], int | None]
"""Hips, spine, neck and head; no head where no joint has a name of the head."""


@lru_cache(maxsize=64)
def by_tree(tree: NamedTree, *, single: bool = False) -> Anatomy | None:
    """Return the anatomy that a tree of names shows; None where it shows too little. Cached for the clips of a rig.

    The names must show the two long bones of both arms or of both legs, hips and, unless the body is legs alone, a
    trunk above them. A part has a role only if a joint has a known name for it; spine and neck need no known names.
    Limbs may be `single` bones, the upper ones, as of figures of blocks; then the names must show all four.
    """
    return _Rig(tree.parents, name_meanings(tree)).anatomy(single)


def with_named_fingers(skeleton: Skeleton, anatomy: Anatomy) -> Anatomy:
    """Return an anatomy with fingers added that names show below its hands."""
    tree = NamedTree.of(skeleton)
    rig = _Rig(tree.parents, name_meanings(tree))
    hands = {side: rig.fingers(anatomy.roles[f"{side}Hand"]) for side in SIDES}
    fingers = {side + role: joint for side, own in hands.items() for role, joint in own.items()}
    return replace(anatomy, roles={**anatomy.roles, **fingers})


@dataclass(frozen=True)
class _Rig:
    """A tree of joints, given by the parent of each (-1 for the root), and the meanings of their names."""

    parents: tuple[int, ...]
    meanings: NameMeanings

    def anatomy(self, single: bool) -> Anatomy | None:
        """The anatomy, with limbs that may be `single` bones; None where the names show too little."""
        find = self._limb_or_bone if single else self._limb
        arms, legs = ([find(limb, side) for side in SIDES] for limb in (ARM, LEG))
        if not (all(arms) and all(legs) if single else all(arms) or all(legs)):
            return None
        trunk = self._trunk(*([min(limb.values()) for limb in limbs if limb] for limbs in (arms, legs)))
        if trunk is None:
            return None
        roles = trunk_roles(*trunk)
        for side, arm, leg in zip(SIDES, arms, legs, strict=True):
            fingers = self.fingers(arm["Hand"]) if "Hand" in arm else {}
            roles |= {side + part: joint for part, joint in (arm | leg | fingers).items()}
        _, spine, neck, _ = trunk
        convention = self.meanings.convention
        return Anatomy(roles=roles, spine=tuple(spine), neck=tuple(neck), convention=convention, method="names")

    def _limb(self, limb: Sequence[str], side: str) -> dict[str, int]:
        """The joints of a limb on a side, by part: the chain of names with most points, of equal chains the one whose
        last joint has most descendants. Empty unless both long bones are named. `chains` has, for each joint, points
        and joints of the best chain that ends there or above with the first n parts of the limb, for each n.
        """
        chains: list[list[tuple[float, dict[str, int]]]] = []
        points = itemgetter(0)
        for joint, parent in enumerate(self.parents):
            above = chains[parent] if parent >= 0 else [(0.0, {})] * (len(limb) + 1)
            best = list(above)
            fits = self.meanings.parts(joint) if self.meanings.names[joint].side == side else {}
            for rank, part in enumerate(limb):
                if part in fits:
                    own_points = PART_POINTS[part] + FIT_POINTS * fits[part]
                    longer = above[rank][0] + own_points, above[rank][1] | {part: joint}
                    best[rank + 1 :] = [max(chain, longer, key=points) for chain in best[rank + 1 :]]
            chains.append(best)
        _, joints = max(
            (best[-1] for best in chains), key=lambda chain: (chain[0], self._below[max(chain[1].values(), default=-1)])
        )
        return joints if all(part in joints for part in limb if part.startswith(LONG_BONE_WORDS)) else {}

    def _limb_or_bone(self, limb: Sequence[str], side: str) -> dict[str, int]:
        """The joints of `_limb`, or else of a limb of one bone: the first joint on a side that hangs from trunk or
        collar bone, has the name of a long bone and carries only leaves and the limb's end, a part or an End Site.
        """
        if found := self._limb(limb, side):
            return found
        names, parts = self.meanings.names, self.meanings.parts
        upper, lower, end = ARM[1:] if limb is ARM else LEG[:3]
        for joint, parent in enumerate(self.parents):
            of_trunk = parent >= 0 and (names[parent].side != side or ARM[0] in parts(parent))
            if of_trunk and names[joint].side == side and parts(joint).keys() & {upper, lower}:
                below = [each for each, above in enumerate(self.parents) if above == joint]
                ends = [each for each in below if end in parts(each) or not names[each].stem]
                if not {*below}.difference(ends) & {*self.parents}:
                    return {upper: joint} | ({end: ends[0]} if ends else {})
        return {}

    def fingers(self, hand: int) -> dict[str, int]:
        """The joints of the fingers below a hand, by role without side, such as "Index1"."""
        names = self.meanings.names
        below = self._descendants([hand])
        deforming = [joint for joint in below if names[joint].prefix == DEFORMING]
        stems = {joint: names[joint].stem for joint in deforming or below if not names[joint].helper}
        from_zero = any("finger0" in stem for stem in stems.values())
        joints: dict[str, list[int]] = {finger: [] for finger in FINGERS}
        next_finger: dict[int, str] = {}
        for joint in reversed(stems):
            finger = _finger_of(stems[joint], from_zero) or (next_finger.get(joint) if _in_palm(stems[joint]) else None)
            if finger:
                joints[finger].insert(0, joint)
                if finger != "Thumb":
                    next_finger[self.parents[joint]] = finger
        chains = {finger: self._chain(own, stems) for finger, own in joints.items()}
        thumb = len(chains["Thumb"])
        return {
            f"{finger}{number}": joint
            for finger, chain in chains.items()
            for number, joint in enumerate(chain, start=_first_number(finger, [stems[joint] for joint in chain], thumb))
            if number <= LAST_BONE
        }

    def _chain(self, joints: Sequence[int], stems: Mapping[int, str]) -> Sequence[int]:
        """The bones of a finger: the longest chain of its joints down the tree. A joint whose name extends that of a
        joint above it ("index_01_half" and "index_01") only bends skin and does not count, unless all but one are such.
        """
        chains: list[tuple[list[int], list[int]]] = [([], [])]  # the bones, and all joints of each chain
        lowest = dict.fromkeys((-1,), 0)
        for joint in joints:
            above = next(above for above in (*self._to_root(self.parents[joint]), -1) if above in lowest)
            bones, line = chains[lowest[above]]
            of_skin = any(_extends(stems[joint], stems[upper]) for upper in line)
            lowest[joint] = len(chains)
            chains.append((bones if of_skin else [*bones, joint], [*line, joint]))
        bones, line = max(chains, key=lambda chain: (len(chain[0]), len(chain[1])))
        return bones if len(bones) > 1 else line

    def _trunk(self, arms: Sequence[int], legs: Sequence[int]) -> Trunk | None:
        """The trunk between the first joints of arms and legs; None where it has no upper end or no hips. The neck
        begins with the first joint that has a name of the neck, else where the arms branch off.
        """
        meanings, joints = self.meanings, range(len(self.parents))
        named = {joint: meanings.names[joint].stem for joint in joints if meanings.means(joint, "head")}
        heads = [joint for joint in named if named[joint] not in map(named.get, self._to_root(self.parents[joint]))]
        head = max(heads, key=lambda joint: len(self._to_root(joint)), default=None)
        crown = head if head is not None else max(filter(meanings.is_neck, joints), default=None)
        uppers = [*arms] if len(arms) == len(SIDES) or crown is None else [*arms, crown]
        if not uppers:
            return self._hips_alone(legs)
        top = self._common_ancestor(self.parents[joint] for joint in uppers)
        center = self._common_ancestor([top, *(self.parents[joint] for joint in legs)])
        hips = self._hips(center, legs)
        if hips is None:
            return None
        line = self._to_root(top)[::-1]
        spine = line[line.index(hips if hips in line else center) + 1 :]
        above_spine = self._to_root(-1 if crown is None else crown)[::-1]
        neck = [joint for joint in above_spine if joint not in line and joint != head]
        chain = [joint for joint in (*spine, *neck) if not meanings.is_helper(joint) and not self._is_hips(joint)]
        past_top = sum(joint in line for joint in chain)
        first = next((place for place, joint in enumerate(chain) if meanings.is_neck(joint)), past_top)
        return hips, chain[:first], chain[first:], head

    def _hips_alone(self, legs: Sequence[int]) -> Trunk | None:
        """The trunk of a body that has legs only; None if it has other joints."""
        hips = self._hips(self._common_ancestor(self.parents[leg] for leg in legs), legs)
        of_legs = {*self._descendants(legs), *(joint for leg in legs for joint in self._to_root(leg))}
        return None if hips is None or len(of_legs) < len(self.parents) else (hips, (), (), None)

    def _hips(self, center: int, legs: Sequence[int]) -> int | None:
        """The hips: the joint with their name at or above `center`, where legs and trunk branch off (-1 for no such
        joint), else between `center` and the legs, else `center` itself. Without legs only a joint with their name
        counts.
        """
        if center < 0:
            return None
        others = [*self._to_root(self._common_ancestor(legs))[:1], *self._to_root(self.parents[center])]
        named = [joint for joint in others if self._is_hips(joint) and self.meanings.names[joint].stem != CARRIER]
        if self._is_hips(center) or not named:
            return center if legs or self._is_hips(center) else None
        return named[0]

    def _is_hips(self, joint: int) -> bool:
        return self.meanings.means(joint, "hips")

    @cached_property
    def _below(self) -> list[int]:
        """The number of joints below each joint."""
        below = [0] * len(self.parents)
        for joint in range(len(self.parents) - 1, 0, -1):
            below[self.parents[joint]] += below[joint] + 1
        return below

    def _to_root(self, joint: int) -> list[int]:
        """The joints from a joint up to the root, both included; none for -1."""
        line = []
        while joint >= 0:
            line.append(joint)
            joint = self.parents[joint]
        return line

    def _descendants(self, tops: Collection[int]) -> list[int]:
        """The joints below some joints, ascending."""
        below = {*tops}
        for joint, parent in enumerate(self.parents):
            if parent in below:
                below.add(joint)
        return sorted(below.difference(tops))

    def _common_ancestor(self, joints: Iterable[int]) -> int:
        """The lowest common ancestor of joints, which may be one of them; -1 where there is none."""
        lines = [{*self._to_root(joint)} for joint in joints]
        return max(set.intersection(*lines), default=-1) if lines else -1


def _finger_of(stem: str, from_zero: bool) -> str | None:
    """The finger that a stem names, by a word or by a number counted from the thumb; None without either."""
    for finger, own_words in vocabulary().fingers.items():
        if any(word in stem for word in own_words):
            return finger
    number = FINGER_NUMBER.search(stem)
    return dict(enumerate(FINGERS, start=not from_zero)).get(int(number[1])) if number else None


def _extends(stem: str, upper: str) -> bool:
    """Whether a stem is another one and more words, as "index01half" extends "index01"."""
    return stem.startswith(upper) and stem[len(upper) :][:1].isalpha()


def _in_palm(stem: str) -> bool:
    return any(word in stem for word in vocabulary().palm)


def _first_number(finger: str, stems: Sequence[str], thumb: int) -> int:
    """The number of a finger's first bone: 0 for a bone in the palm, else 1. A bone is in the palm if its name says so,
    except in a thumb, or if three others follow and its name does not end with 1 or the thumb has three bones.
    """
    if not stems:
        return 1
    longer = len(stems) > LAST_BONE and (thumb == LAST_BONE or not stems[0].endswith("1"))
    return 0 if longer or (finger != "Thumb" and _in_palm(stems[0])) else 1


def find_handles(skeleton: Skeleton, anatomy: Anatomy | None, regions: Regions) -> dict[int, int]:
    """Return the joint that each IK handle follows, by handle: the hand, foot or toes with the same name, as "foot_l"
    of "ik_foot_l". Only joints that move and turn freely and carry no part of the body are handles.
    """
    roles = anatomy.roles if anatomy else {}
    parts = {_meaning(skeleton.names[joint]): joint for role, joint in roles.items() if role.endswith(HANDLED_PARTS)}
    handles = {}
    for joint in skeleton.joints:
        name = skeleton.names[joint]
        if any(map(_marks_handle, words(name))) and skeleton.moves_freely(joint):
            meaning = _meaning(name)
            part = parts.get(NAMED_OTHERWISE.get(meaning, meaning))
            if part is not None and (regions.of_joint[skeleton.subtree(joint)] < 0).all():
                handles[joint] = part
    return handles


def _marks_handle(word: str) -> bool:
    return without_digits(word) in HANDLE_WORDS


def _meaning(name: str) -> tuple[str, Side | None]:
    """The stem and side of a name without namespace and without the words of a handle."""
    return stem_and_side([word for word in words(name.rpartition(":")[2]) if not _marks_handle(word)])
