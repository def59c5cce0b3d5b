"""Which joint plays which part of a human body, told from the joints' names and the tree.

The words of many naming conventions stand in `conventions.json`. An entry has a readable title; the names of the hips,
of spine and neck from below, and of the head; those of the four parts of arm and leg (`ARM`, `LEG`) without side; and
where there are such, a prefix of all names, and other names that may occur.
"""

from __future__ import annotations

import json
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from distretarget.body.anatomy import ARM, FINGERS, LEG, SIDES, Anatomy, spine_roles
from distretarget.body.joint_names import JointName, Words, joint_names, stem_and_side, without_digits, words
from distretarget.skeleton import Skeleton

# What a part adds to a chain that has it: the bones of a limb count more than collar bone and toes. The convention's
# fit, 0 to 1, halved, comes on top and decides between readings of the same word.
WORTH = dict.fromkeys(ARM + LEG, 2.0) | {"Shoulder": 1.0, "Toes": 1.0}
FIT_WORTH = 0.5

# What the names of the parts that have a long bone begin with.
LONG_BONES = ("Upper", "Lower")

# How well the names must fit a convention for it to be named, and what its prefix adds.
RECOGNISED = 0.75
PREFIX_FIT = 1.0

# A name of the hips where legs and trunk hang from it; anywhere above it is only what carries the body.
CARRIER = "root"

# A finger's number in a name, and the number of a finger's last bone that has a role.
FINGER_NUMBER = re.compile(r"finger(\d)")
LAST_BONE = 3

Word = tuple[str, bool]
"""A stem, and whether it has a side."""


@dataclass(frozen=True)
class Convention:
    """A naming convention: which words mean which part.

    Attributes:
        title: its readable name.
        prefix: what all its names begin with; mostly nothing.
        parts: the part that each word means.
        also: other words that it may have.
    """

    title: str
    prefix: Words
    parts: Mapping[Word, str]
    also: frozenset[Word]


@dataclass(frozen=True)
class Vocabulary:
    """All conventions, and the words of fingers.

    Attributes:
        conventions: in the order in which they are preferred where names fit several.
        fingers: per finger, the words for it.
        palm: the words for a bone in the palm.
        necks: the words for joints of the neck, without digits at the end.
    """

    conventions: tuple[Convention, ...]
    fingers: Mapping[str, tuple[str, ...]]
    palm: tuple[str, ...]
    necks: frozenset[str]


def by_names(skeleton: Skeleton) -> Anatomy | None:
    """The anatomy that the joints' names and the tree tell, offsets apart; None where they tell too little.

    Enough are the two long bones of both arms or of both legs, hips, and something above them, if there is more than
    legs. A part without a joint of a known name has no role; the joints of spine and neck need no known names.
    """
    return _read(skeleton).anatomy()


def convention_of(skeleton: Skeleton) -> str:
    """The title of the convention whose names the joints have; empty where none is recognised."""
    return _read(skeleton).convention


@cache
def vocabulary() -> Vocabulary:
    """The words of `conventions.json`."""
    data = json.loads(files(__package__).joinpath("conventions.json").read_text("utf-8"))
    conventions = tuple(_convention(**entry) for entry in data["conventions"])
    return Vocabulary(
        conventions,
        {finger: tuple(names) for finger, names in data["fingers"].items()},
        tuple(data["palm"]),
        frozenset(
            without_digits(stem)
            for convention in conventions
            for (stem, _), part in convention.parts.items()
            if part == "neck"
        ),
    )


def _convention(
    title: str,
    hips: str,
    spine: Sequence[str],
    neck: Sequence[str],
    head: str,
    arm: Sequence[str | None],
    leg: Sequence[str | None],
    prefix: str = "",
    also: Iterable[str] = (),
) -> Convention:
    trunk = {hips: "hips", head: "head"} | dict.fromkeys(spine, "spine") | dict.fromkeys(neck, "neck")
    parts = {(stem_and_side(words(name))[0], False): part for name, part in trunk.items()}
    for names, limb in ((arm, ARM), (leg, LEG)):
        parts |= {(stem_and_side(words(name))[0], True): part for name, part in zip(names, limb, strict=True) if name}
    others = [stem_and_side(words(name)) for name in also]
    return Convention(title, words(prefix), parts, frozenset((stem, side is not None) for stem, side in others))


class _Chain(NamedTuple):
    """Joints from above for parts of a limb, and what they are worth."""

    worth: float
    joints: tuple[tuple[str, int], ...]


class _Trunk(NamedTuple):
    """The joints between the limbs; `head` is None where no joint is named so."""

    hips: int
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    head: int | None


@dataclass(frozen=True)
class _Rig:
    """A tree with its names read.

    Attributes:
        parents: per joint, -1 for the root.
        names: per joint.
        readings: per word, the parts that conventions give it, each with the best fit of those that do, 0 to 1.
        convention: the title of the one recognised; empty without.
    """

    parents: tuple[int, ...]
    names: tuple[JointName, ...]
    readings: Mapping[Word, Mapping[str, float]]
    convention: str

    def anatomy(self) -> Anatomy | None:
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
            fingers = self._fingers(arms[side]["Hand"]) if "Hand" in arms[side] else {}
            roles |= {side + part: joint for part, joint in (arms[side] | legs[side] | fingers).items()}
        return Anatomy(roles, trunk.spine, trunk.neck, self.convention, "names")

    def _limb(self, limb: Sequence[str], side: str) -> dict[str, int]:
        """The joints of the chain of a side that is worth most as this limb; none unless both long bones are named.

        Per joint, `chains` has the best chains that end there or above, by how many of the parts they may use.
        """
        chains: list[tuple[_Chain, ...]] = []
        for joint, parent in enumerate(self.parents):
            above = chains[parent] if parent >= 0 else (_Chain(0.0, ()),) * (len(limb) + 1)
            named = self._readings(joint) if self.names[joint].side == side else {}
            chains.append(_extended(above, joint, limb, named))
        joints = dict(max((best[-1] for best in chains), key=_worth).joints)
        return joints if all(part in joints for part in limb if part.startswith(LONG_BONES)) else {}

    def _trunk(self, arms: Sequence[int], legs: Sequence[int]) -> _Trunk | None:
        """The trunk between the first joints of arms and legs; None where it has no upper end or no hips.

        The neck begins with the first joint named so, or else where the arms leave.
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
        joints = [joint for joint in spine + neck if not self._is_helper(joint) and not self._means(joint, "hips")]
        past_top = sum(joint in line for joint in joints)
        first = next((place for place, joint in enumerate(joints) if self._is_neck(joint)), past_top)
        return _Trunk(hips, tuple(joints[:first]), tuple(joints[first:]), head)

    def _hips_alone(self, legs: Sequence[int]) -> _Trunk | None:
        """The trunk of a body that is nothing but legs."""
        ways = [set(self._path(joint)) for joint in range(len(self.parents))]
        above = set().union(*(ways[leg] for leg in legs))
        hips = self._hips(self._branching(self.parents[leg] for leg in legs), legs)
        if hips is None or any(joint not in above and way.isdisjoint(legs) for joint, way in enumerate(ways)):
            return None
        return _Trunk(hips, (), (), None)

    def _hips(self, center: int, legs: Sequence[int]) -> int | None:
        """The joint named hips at or above the one from which legs and trunk leave, else between this and the legs,
        else this one itself; without legs only a named one. `center` is -1 where there is none.
        """
        if center < 0:
            return None
        others = [*self._path(self._branching(legs))[-1:], *reversed(self._path(center)[:-1])]
        named = [joint for joint in others if self._means(joint, "hips") and self.names[joint].stem != CARRIER]
        if self._means(center, "hips") or not named:
            return center if legs or self._means(center, "hips") else None
        return named[0]

    def _head(self) -> int | None:
        """The lowest in the tree of the joints named head."""
        heads = [joint for joint in range(len(self.parents)) if self._means(joint, "head")]
        return max(heads, key=lambda joint: len(self._path(joint)), default=None)

    def _last_neck(self) -> int | None:
        return max(filter(self._is_neck, range(len(self.parents))), default=None)

    def _fingers(self, hand: int) -> dict[str, int]:
        """The joints of the fingers below a hand by role without side, as "Index1"."""
        below = {hand}
        for joint in range(hand + 1, len(self.parents)):
            if self.parents[joint] in below:
                below.add(joint)
        stems = {joint: self.names[joint].stem for joint in sorted(below - {hand}) if not self.names[joint].helper}
        from_zero = any("finger0" in stem for stem in stems.values())
        joints: dict[str, list[int]] = {finger: [] for finger in FINGERS}
        next_finger: dict[int, str] = {}
        for joint in reversed(stems):
            finger = _finger_of(stems[joint], from_zero) or (next_finger.get(joint) if _in_palm(stems[joint]) else None)
            if finger:
                joints[finger].insert(0, joint)
                if finger != "Thumb":
                    next_finger[self.parents[joint]] = finger
        return {
            f"{finger}{number}": joint
            for finger, chain in joints.items()
            for number, joint in enumerate(chain, start=_first_number(finger, [stems[joint] for joint in chain]))
            if number <= LAST_BONE
        }

    def _readings(self, joint: int) -> Mapping[str, float]:
        return self.readings.get(_word(self.names[joint]), {})

    def _means(self, joint: int, part: str) -> bool:
        """All conventions that know the joint's word give it this part."""
        return self._readings(joint).keys() == {part}

    def _is_neck(self, joint: int) -> bool:
        name = self.names[joint]
        return name.side is None and without_digits(name.stem) in vocabulary().necks and not self._is_helper(joint)

    def _is_helper(self, joint: int) -> bool:
        """No joint of the body; some conventions have known parts with a helper's word, as "NeckTwist01"."""
        return self.names[joint].helper and not self._readings(joint)

    def _path(self, joint: int) -> list[int]:
        """The joints from the root to this one; none for -1."""
        path = []
        while joint >= 0:
            path.append(joint)
            joint = self.parents[joint]
        return path[::-1]

    def _branching(self, joints: Iterable[int]) -> int:
        """The lowest joint that is an ancestor of all these, or one of them; -1 where there is none."""
        common = -1
        for level in zip(*map(self._path, joints), strict=False):
            if len(set(level)) > 1:
                break
            common = level[0]
        return common


def _read(skeleton: Skeleton) -> _Rig:
    """The skeleton's tree with its names read."""
    conventions = vocabulary().conventions
    names = joint_names(skeleton, {convention.prefix for convention in conventions} - {()})
    fits = _fits(names)
    readings: dict[Word, dict[str, float]] = defaultdict(dict)
    for convention, (fit, _) in zip(conventions, fits, strict=True):
        for word, part in convention.parts.items():
            readings[word][part] = max(readings[word].get(part, 0.0), min(fit, 1.0))
    best = max(range(len(fits)), key=fits.__getitem__)
    title = conventions[best].title if fits[best][0] >= RECOGNISED else ""
    return _Rig(tuple(skeleton.parents.tolist()), names, readings, title)


def _fits(names: Sequence[JointName]) -> list[tuple[float, int]]:
    """How well the names fit each convention: which part of its words and of all known words they have is common to
    both, and one more for its prefix; then, how many of its other words they have.
    """
    conventions = vocabulary().conventions
    known = {word for convention in conventions for word in convention.parts}
    found = set(map(_word, names))
    prefixes = Counter(name.prefix for name in names if name.stem)
    prefix = max(prefixes, key=prefixes.__getitem__, default=())
    fits = []
    for convention in conventions:
        own = convention.parts.keys()
        fit = len(own & found) / len(own | ((known & found) - convention.also))
        fits.append((fit + PREFIX_FIT * (prefix != () and prefix == convention.prefix), len(convention.also & found)))
    return fits


def _word(name: JointName) -> Word:
    return name.stem, name.side is not None


def _worth(chain: _Chain) -> float:
    return chain.worth


def _extended(
    above: tuple[_Chain, ...], joint: int, limb: Sequence[str], fits: Mapping[str, float]
) -> tuple[_Chain, ...]:
    """The best chains with a joint that can be the parts in `fits`, from those above it; the upper of equals."""
    best = list(above)
    for rank, part in enumerate(limb):
        if part in fits:
            worth = above[rank].worth + WORTH[part] + FIT_WORTH * fits[part]
            longer = _Chain(worth, (*above[rank].joints, (part, joint)))
            best[rank + 1 :] = [max(chain, longer, key=_worth) for chain in best[rank + 1 :]]
    return tuple(best)


def _starts(limbs: Mapping[str, Mapping[str, int]]) -> list[int]:
    """The first joints of the limbs found."""
    return [min(limb.values()) for limb in limbs.values() if limb]


def _finger_of(stem: str, from_zero: bool) -> str | None:
    """The finger that a name tells by a word or, from the thumb on, a number."""
    for finger, own_words in vocabulary().fingers.items():
        if any(word in stem for word in own_words):
            return finger
    number = FINGER_NUMBER.search(stem)
    return dict(enumerate(FINGERS, start=not from_zero)).get(int(number[1])) if number else None


def _in_palm(stem: str) -> bool:
    return any(word in stem for word in vocabulary().palm)


def _first_number(finger: str, stems: Sequence[str]) -> int:
    """The number of a finger's first bone: 0 in the palm, where its name says so or where it comes before three others
    and is not numbered 1; else 1. A thumb of three bones starts in the palm and with 1.
    """
    if not stems:
        return 1
    longer = len(stems) > LAST_BONE and not stems[0].endswith("1")
    return 0 if longer or (finger != "Thumb" and _in_palm(stems[0])) else 1
