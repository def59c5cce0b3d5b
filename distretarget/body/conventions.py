"""The anatomy of a skeleton, recognised by the names and the tree of its joints.

`conventions.json` lists the words of many naming conventions. An entry has a readable title; the names of the hips, of
spine and neck from below, and of the head; those of the four parts of arm and leg (`ARM`, `LEG`) without side; and, if
the convention has them, the prefix of all names, and other names that may occur.
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
from distretarget.body.joint_names import JointName, NameWords, joint_names, stem_and_side, without_digits, words
from distretarget.skeleton import Skeleton

# Points for each part that a chain of joints has: the bones of a limb count more than collar bone and toes.
PART_POINTS = dict.fromkeys(ARM + LEG, 2.0) | {"Shoulder": 1.0, "Toes": 1.0}
# Points for a convention that fits fully; less fit, fewer points. They decide between several meanings of a word.
FIT_POINTS = 0.5

# The parts with these first words have a long bone.
LONG_BONE_WORDS = ("Upper", "Lower")

# A convention is recognised from this fit on [0 to 1], to which its prefix adds the second number.
RECOGNISED = 0.75
PREFIX_FIT = 1.0

# The hips may have this name only where legs and trunk branch off; a joint above them with it just carries the body.
CARRIER = "root"

# A finger's number in a joint's name, and the number of a finger's last bone that has a role.
FINGER_NUMBER = re.compile(r"finger(\d)")
LAST_BONE = 3

Term = tuple[str, bool]
"""The stem of a joint's name, and whether the name has a side."""


@dataclass(frozen=True)
class Convention:
    """A naming convention: which terms mean which part.

    Attributes:
        title: the readable name.
        prefix: the words with which all names begin; empty for most conventions.
        parts: the part that each term means.
        also: other terms that may occur.
    """

    title: str
    prefix: NameWords
    parts: Mapping[Term, str]
    also: frozenset[Term]


@dataclass(frozen=True)
class Vocabulary:
    """All conventions, and the words for fingers.

    Attributes:
        conventions: all conventions, the preferred one first where names fit several.
        fingers: per finger, the words for it.
        palm: the words for a bone in the palm.
        necks: the words for joints of the neck, without digits at the end.
    """

    conventions: tuple[Convention, ...]
    fingers: Mapping[str, tuple[str, ...]]
    palm: tuple[str, ...]
    necks: frozenset[str]


def by_names(skeleton: Skeleton) -> Anatomy | None:
    """Return the anatomy that names and tree show, whatever the offsets; None where they show too little.

    The names must show the two long bones of both arms or of both legs, hips and, unless the body is legs alone, a
    trunk above them. A part has a role only if a joint has a known name for it; spine and neck need no known names.
    """
    return _read(skeleton).anatomy()


def convention_of(skeleton: Skeleton) -> str:
    """Return the title of the convention that the joints' names follow; empty where none is recognised."""
    return _read(skeleton).convention


@cache
def vocabulary() -> Vocabulary:
    """Return the vocabulary in `conventions.json`."""
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
    """The joints of parts of a limb, from above, and their points."""

    points: float
    joints: tuple[tuple[str, int], ...]


class _Trunk(NamedTuple):
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
        names: the name of each joint.
        readings: per term, the parts that it means, each with the best fit of the conventions in which it does, 0 to 1.
        convention: the title of the recognised convention; empty where none is.
    """

    parents: tuple[int, ...]
    names: tuple[JointName, ...]
    readings: Mapping[Term, Mapping[str, float]]
    convention: str

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
            fingers = self._fingers(arms[side]["Hand"]) if "Hand" in arms[side] else {}
            roles |= {side + part: joint for part, joint in (arms[side] | legs[side] | fingers).items()}
        return Anatomy(roles, trunk.spine, trunk.neck, self.convention, "names")

    def _limb(self, limb: Sequence[str], side: str) -> dict[str, int]:
        """The joints of the chain on a side with the most points for this limb; empty unless both long bones are named.

        `chains` has, per joint, the best chains that end there or above, by the number of parts they may use.
        """
        chains: list[tuple[_Chain, ...]] = []
        for joint, parent in enumerate(self.parents):
            above = chains[parent] if parent >= 0 else (_Chain(0.0, ()),) * (len(limb) + 1)
            named = self._readings(joint) if self.names[joint].side == side else {}
            chains.append(_extended(above, joint, limb, named))
        joints = dict(max((best[-1] for best in chains), key=_points).joints)
        return joints if all(part in joints for part in limb if part.startswith(LONG_BONE_WORDS)) else {}

    def _trunk(self, arms: Sequence[int], legs: Sequence[int]) -> _Trunk | None:
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
        joints = [joint for joint in spine + neck if not self._is_helper(joint) and not self._means(joint, "hips")]
        past_top = sum(joint in line for joint in joints)
        first = next((place for place, joint in enumerate(joints) if self._is_neck(joint)), past_top)
        return _Trunk(hips, tuple(joints[:first]), tuple(joints[first:]), head)

    def _hips_alone(self, legs: Sequence[int]) -> _Trunk | None:
        """The trunk of a body that has legs only; None if it has more than legs."""
        paths = [set(self._path(joint)) for joint in range(len(self.parents))]
        above = set().union(*(paths[leg] for leg in legs))
        hips = self._hips(self._branching(self.parents[leg] for leg in legs), legs)
        if hips is None or any(joint not in above and path.isdisjoint(legs) for joint, path in enumerate(paths)):
            return None
        return _Trunk(hips, (), (), None)

    def _hips(self, center: int, legs: Sequence[int]) -> int | None:
        """The hips: the joint with their name at or above `center`, where legs and trunk branch off, else between
        `center` and the legs, else `center` itself. Without legs only a joint with their name counts.

        `center` is -1 where there is no such joint.
        """
        if center < 0:
            return None
        others = [*self._path(self._branching(legs))[-1:], *reversed(self._path(center)[:-1])]
        named = [joint for joint in others if self._means(joint, "hips") and self.names[joint].stem != CARRIER]
        if self._means(center, "hips") or not named:
            return center if legs or self._means(center, "hips") else None
        return named[0]

    def _head(self) -> int | None:
        """The joint with a name of the head that is deepest in the tree; None without one."""
        heads = [joint for joint in range(len(self.parents)) if self._means(joint, "head")]
        return max(heads, key=lambda joint: len(self._path(joint)), default=None)

    def _last_neck(self) -> int | None:
        """The last joint with a name of the neck; None without one."""
        return max(filter(self._is_neck, range(len(self.parents))), default=None)

    def _fingers(self, hand: int) -> dict[str, int]:
        """The joints of the fingers below a hand, by role without side, such as "Index1"."""
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
        """The parts that the joint's name may mean, with the fit of each."""
        return self.readings.get(_term(self.names[joint]), {})

    def _means(self, joint: int, part: str) -> bool:
        """Whether the joint's name means this part in all conventions that know it."""
        return self._readings(joint).keys() == {part}

    def _is_neck(self, joint: int) -> bool:
        name = self.names[joint]
        return name.side is None and without_digits(name.stem) in vocabulary().necks and not self._is_helper(joint)

    def _is_helper(self, joint: int) -> bool:
        """Whether the joint is not part of the body. Names with a helper's word may be, such as "NeckTwist01"."""
        return self.names[joint].helper and not self._readings(joint)

    def _path(self, joint: int) -> list[int]:
        """The joints from the root down to this one; empty for -1."""
        path = []
        while joint >= 0:
            path.append(joint)
            joint = self.parents[joint]
        return path[::-1]

    def _branching(self, joints: Iterable[int]) -> int:
        """The lowest common ancestor of joints, which may be one of them; -1 where there is none."""
        common = -1
        for level in zip(*map(self._path, joints), strict=False):
            if len(set(level)) > 1:
                break
            common = level[0]
        return common


def _read(skeleton: Skeleton) -> _Rig:
    """The skeleton's tree with the meanings of its names."""
    conventions = vocabulary().conventions
    names = joint_names(skeleton, {convention.prefix for convention in conventions} - {()})
    fits = _fits(names)
    readings: dict[Term, dict[str, float]] = defaultdict(dict)
    for convention, (fit, _) in zip(conventions, fits, strict=True):
        for term, part in convention.parts.items():
            readings[term][part] = max(readings[term].get(part, 0.0), min(fit, 1.0))
    best = max(range(len(fits)), key=fits.__getitem__)
    title = conventions[best].title if fits[best][0] >= RECOGNISED else ""
    return _Rig(tuple(skeleton.parents.tolist()), names, readings, title)


def _fits(names: Sequence[JointName]) -> list[tuple[float, int]]:
    """How well the names fit each convention, and how many of its other terms they have.

    The fit is the number of terms that names and convention share, over the number of terms that either has. Terms that
    no convention knows and the convention's other terms are left out. The convention's prefix adds `PREFIX_FIT`.
    """
    conventions = vocabulary().conventions
    known = {term for convention in conventions for term in convention.parts}
    terms = set(map(_term, names))
    prefixes = Counter(name.prefix for name in names if name.stem)
    prefix = max(prefixes, key=prefixes.__getitem__, default=())
    fits = []
    for convention in conventions:
        own = convention.parts.keys()
        fit = len(own & terms) / len(own | ((known & terms) - convention.also))
        fits.append((fit + PREFIX_FIT * (prefix != () and prefix == convention.prefix), len(convention.also & terms)))
    return fits


def _term(name: JointName) -> Term:
    return name.stem, name.side is not None


def _points(chain: _Chain) -> float:
    return chain.points


def _extended(
    above: tuple[_Chain, ...], joint: int, limb: Sequence[str], fits: Mapping[str, float]
) -> tuple[_Chain, ...]:
    """The best chains that end at a joint or above it, from those above it; of equal ones those that end higher up.

    `fits` has the parts that the joint can be, with the fit of each.
    """
    best = list(above)
    for rank, part in enumerate(limb):
        if part in fits:
            points = above[rank].points + PART_POINTS[part] + FIT_POINTS * fits[part]
            longer = _Chain(points, (*above[rank].joints, (part, joint)))
            best[rank + 1 :] = [max(chain, longer, key=_points) for chain in best[rank + 1 :]]
    return tuple(best)


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
