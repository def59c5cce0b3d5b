"""The anatomy of a skeleton, recognised by the names and the tree of its joints."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

from distretarget.body.anatomy import ARM, FINGERS, LEG, SIDES, Anatomy, spine_roles
from distretarget.body.conventions import NameMeanings, name_meanings, vocabulary
from distretarget.body.joint_names import NamedTree
from distretarget.skeleton import Skeleton

# Points for each part that a chain of joints has: the bones of a limb count more than collar bone and toes.
PART_POINTS = dict.fromkeys(ARM + LEG, 2.0) | {"Shoulder": 1.0, "Toes": 1.0}
# Points for a convention that fits fully; less fit, fewer points. They decide between several meanings of a word.
FIT_POINTS = 0.5

LONG_BONE_WORDS = ("Upper", "Lower")  # parts with these first words have a long bone
LAST_BONE = 3  # the number of a finger's last bone that has a role
FINGER_NUMBER = re.compile(r"finger(\d)")  # a finger's number in a joint's name

# The hips may have this name only where legs and trunk branch off; a joint above them with it just carries the body.
CARRIER = "root"


def by_names(skeleton: Skeleton) -> Anatomy | None:
    """Return the anatomy that names and tree show, whatever the offsets; None where they show too little.

    The names must show the two long bones of both arms or of both legs, hips and, unless the body is legs alone, a
    trunk above them. A part has a role only if a joint has a known name for it; spine and neck need no known names.
    """
    return _anatomy(NamedTree.of(skeleton))


@lru_cache(maxsize=64)
def _anatomy(tree: NamedTree) -> Anatomy | None:
    """The anatomy of a tree of joints; found once for all clips of a rig."""
    return _Rig(tree.parents, name_meanings(tree)).anatomy()


class _Chain(NamedTuple):
    """The joints of parts of a limb, from above, and their points."""

    points: float
    joints: tuple[tuple[str, int], ...]


class _NamedTrunk(NamedTuple):
    """The joints between the limbs; `head` is None where no joint has a name of the head."""

    hips: int
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    head: int | None


@dataclass(frozen=True)
class _Rig:
    """A tree of joints with the meanings of their names.

    Attributes:
        parents: the parent of each joint, -1 for the root.
        meanings: what the names of the joints mean.
    """

    parents: tuple[int, ...]
    meanings: NameMeanings

    def anatomy(self) -> Anatomy | None:
        """The anatomy; None where the names show too little."""
        arms = {side: self._limb(ARM, side) for side in SIDES}
        legs = {side: self._limb(LEG, side) for side in SIDES}
        if not (all(arms.values()) or all(legs.values())):
            return None
        trunk = self._trunk(_starts(arms), _starts(legs))
        if trunk is None:
            return None
        roles = {"hips": trunk.hips} | spine_roles(trunk.spine)
        roles |= {"neck": trunk.neck[0]} if trunk.neck else {}
        roles |= {"head": trunk.head} if trunk.head is not None else {}
        for side in SIDES:
            limbs = arms[side] | legs[side]
            limbs |= self._fingers(limbs["Hand"]) if "Hand" in limbs else {}
            roles |= {side + part: joint for part, joint in limbs.items()}
        return Anatomy(
            roles=roles, spine=trunk.spine, neck=trunk.neck, convention=self.meanings.convention, method="names"
        )

    def _limb(self, limb: Sequence[str], side: str) -> dict[str, int]:
        """The joints of the chain on a side with the most points for this limb; empty unless both long bones are named.

        `chains` has, per joint, the best chains that end there or above, by the number of parts they may use; of equal
        ones those that end higher up.
        """
        chains: list[list[_Chain]] = []
        for joint, parent in enumerate(self.parents):
            above = chains[parent] if parent >= 0 else [_Chain(0.0, ())] * (len(limb) + 1)
            best = list(above)
            fits = self.meanings.parts(joint) if self.meanings.names[joint].side == side else {}
            for rank, part in enumerate(limb):
                if part in fits:
                    points = above[rank].points + PART_POINTS[part] + FIT_POINTS * fits[part]
                    longer = _Chain(points, (*above[rank].joints, (part, joint)))
                    best[rank + 1 :] = [max(chain, longer, key=_points) for chain in best[rank + 1 :]]
            chains.append(best)
        joints = dict(max((best[-1] for best in chains), key=_points).joints)
        return joints if all(part in joints for part in limb if part.startswith(LONG_BONE_WORDS)) else {}

    def _fingers(self, hand: int) -> dict[str, int]:
        """The joints of the fingers below a hand, by role without side, such as "Index1"."""
        names = self.meanings.names
        below = [joint for joint in range(hand + 1, len(self.parents)) if hand in self._paths[joint]]
        stems = {joint: names[joint].stem for joint in below if not names[joint].helper}
        from_zero = any("finger0" in stem for stem in stems.values())
        chains: dict[str, list[int]] = {finger: [] for finger in FINGERS}
        next_finger: dict[int, str] = {}
        for joint in reversed(stems):
            finger = _finger_of(stems[joint], from_zero) or (next_finger.get(joint) if _in_palm(stems[joint]) else None)
            if finger:
                chains[finger].insert(0, joint)
                if finger != "Thumb":
                    next_finger[self.parents[joint]] = finger
        return {
            f"{finger}{number}": joint
            for finger, chain in chains.items()
            for number, joint in enumerate(chain, start=_first_number(finger, [stems[joint] for joint in chain]))
            if number <= LAST_BONE
        }

    def _trunk(self, arms: Sequence[int], legs: Sequence[int]) -> _NamedTrunk | None:
        """The trunk between the first joints of arms and legs; None where it has no upper end or no hips.

        The neck begins with the first joint that has a name of the neck, else where the arms branch off.
        """
        head = self._head()
        crown = head if head is not None else self._last_neck()
        uppers = [*arms] if len(arms) == len(SIDES) or crown is None else [*arms, crown]
        if not uppers:
            return self._hips_alone(legs)
        top = self._branching(self.parents[joint] for joint in uppers)
        center = self._branching([top, *(self.parents[joint] for joint in legs)])
        hips = self._hips(center, legs)
        if hips is None:
            return None
        line = self._path(top)
        spine = line[line.index(hips if hips in line else center) + 1 :]
        neck = [] if crown is None else [joint for joint in self._path(crown) if joint not in line and joint != head]
        joints = [joint for joint in spine + neck if not self.meanings.is_helper(joint) and not self._is_hips(joint)]
        past_top = sum(joint in line for joint in joints)
        first = next((place for place, joint in enumerate(joints) if self.meanings.is_neck(joint)), past_top)
        return _NamedTrunk(hips, tuple(joints[:first]), tuple(joints[first:]), head)

    def _hips_alone(self, legs: Sequence[int]) -> _NamedTrunk | None:
        """The trunk of a body that has legs only; None if it has more than legs."""
        above = {joint for leg in legs for joint in self._path(leg)}
        hips = self._hips(self._branching(self.parents[leg] for leg in legs), legs)
        if hips is None or any(joint not in above and path.isdisjoint(legs) for joint, path in enumerate(self._paths)):
            return None
        return _NamedTrunk(hips, (), (), None)

    def _hips(self, center: int, legs: Sequence[int]) -> int | None:
        """The hips: the joint with their name at or above `center`, where legs and trunk branch off, else between
        `center` and the legs, else `center` itself. Without legs only a joint with their name counts.

        `center` is -1 where there is no such joint.
        """
        if center < 0:
            return None
        others = [*self._path(self._branching(legs))[-1:], *reversed(self._path(center)[:-1])]
        named = [joint for joint in others if self._is_hips(joint) and self.meanings.names[joint].stem != CARRIER]
        if self._is_hips(center) or not named:
            return center if legs or self._is_hips(center) else None
        return named[0]

    def _is_hips(self, joint: int) -> bool:
        return self.meanings.means(joint, "hips")

    def _head(self) -> int | None:
        """The joint with a name of the head that is deepest in the tree; None without one."""
        heads = [joint for joint in range(len(self.parents)) if self.meanings.means(joint, "head")]
        return max(heads, key=lambda joint: len(self._path(joint)), default=None)

    def _last_neck(self) -> int | None:
        """The last joint with a name of the neck; None without one."""
        return max(filter(self.meanings.is_neck, range(len(self.parents))), default=None)

    @cached_property
    def _paths(self) -> list[frozenset[int]]:
        """For each joint the joints from the root down to it."""
        paths: list[frozenset[int]] = []
        for joint, parent in enumerate(self.parents):
            paths.append((paths[parent] if parent >= 0 else frozenset()) | {joint})
        return paths

    def _path(self, joint: int) -> list[int]:
        """The joints from the root down to this one; empty for -1."""
        return sorted(self._paths[joint]) if joint >= 0 else []

    def _branching(self, joints: Iterable[int]) -> int:
        """The lowest common ancestor of joints, which may be one of them; -1 where there is none."""
        paths = [set(self._path(joint)) for joint in joints]
        return max(set.intersection(*paths), default=-1) if paths else -1


def _points(chain: _Chain) -> float:
    return chain.points


def _starts(limbs: Mapping[str, Mapping[str, int]]) -> list[int]:
    """The first joint of each limb that was found."""
    return [min(limb.values()) for limb in limbs.values() if limb]


def _finger_of(stem: str, from_zero: bool) -> str | None:
    """The finger that a stem names by a word, or by a number that counts from the thumb; None without either."""
    for finger, own_words in vocabulary().fingers.items():
        if any(word in stem for word in own_words):
            return finger
    number = FINGER_NUMBER.search(stem)
    return dict(enumerate(FINGERS, start=not from_zero)).get(int(number[1])) if number else None


def _in_palm(stem: str) -> bool:
    return any(word in stem for word in vocabulary().palm)


def _first_number(finger: str, stems: Sequence[str]) -> int:
    """The number of a finger's first bone: 0 for a bone in the palm, else 1.

    A bone is in the palm if its name says so, or if three others follow it and its number is not 1. A thumb of three
    bones begins in the palm, but with 1.
    """
    if not stems:
        return 1
    longer = len(stems) > LAST_BONE and not stems[0].endswith("1")
    return 0 if longer or (finger != "Thumb" and _in_palm(stems[0])) else 1
