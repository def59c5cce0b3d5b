"""What the names of a skeleton's joints mean, and which naming convention they follow.

`conventions.json` lists the words of many naming conventions. An entry has a readable title; the names of the hips, of
spine and neck from below, and of the head; those of the four parts of arm and leg (`ARM`, `LEG`) without side; and, if
the convention has them, the prefix of all names, and other names that may occur.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from distretarget.body.anatomy import ARM, LEG
from distretarget.body.joint_names import (
    JointName,
    NamedTree,
    NameWords,
    joint_names,
    stem_and_side,
    without_digits,
    words,
)
from distretarget.skeleton import Skeleton

RECOGNISED = 0.75  # least fit of a convention that is recognised [0 to 1]
PREFIX_FIT = 1.0  # what its prefix adds to the fit of a convention

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
        terms: all terms that mean a part in any of them.
        fingers: per finger, the words for it.
        palm: the words for a bone in the palm.
        necks: the words for joints of the neck, without digits at the end.
    """

    conventions: tuple[Convention, ...]
    terms: frozenset[Term]
    fingers: Mapping[str, tuple[str, ...]]
    palm: tuple[str, ...]
    necks: frozenset[str]


@cache
def vocabulary() -> Vocabulary:
    """Return the vocabulary in `conventions.json`."""
    data = json.loads(files(__package__).joinpath("conventions.json").read_text("utf-8"))
    conventions = tuple(map(_convention, data["conventions"]))
    parts = [item for convention in conventions for item in convention.parts.items()]
    return Vocabulary(
        conventions,
        frozenset(term for term, _ in parts),
        {finger: tuple(names) for finger, names in data["fingers"].items()},
        tuple(data["palm"]),
        frozenset(without_digits(stem) for (stem, _), part in parts if part == "neck"),
    )


def _convention(entry: Mapping[str, Any]) -> Convention:
    """The convention of an entry of `conventions.json`."""
    trunk = [(entry["hips"], "hips"), (entry["head"], "head")]
    trunk += [(name, part) for part in ("spine", "neck") for name in entry[part]]
    limbs = [*zip(entry["arm"], ARM, strict=True), *zip(entry["leg"], LEG, strict=True)]
    parts = {(_stem(name), False): part for name, part in trunk}
    parts |= {(_stem(name), True): part for name, part in limbs if name}
    others = [stem_and_side(words(name)) for name in entry.get("also", ())]
    also = frozenset((stem, side is not None) for stem, side in others)
    return Convention(entry["title"], words(entry.get("prefix", "")), parts, also)


def _stem(name: str) -> str:
    return stem_and_side(words(name))[0]


@dataclass(frozen=True)
class NameMeanings:
    """What the names of a skeleton's joints mean.

    Attributes:
        names: the name of each joint.
        readings: per term of the names, the parts that it means, each with the best fit of the conventions in which it
            does, 0 to 1.
        convention: the title of the recognised convention; empty where none is.
    """

    names: tuple[JointName, ...]
    readings: Mapping[Term, Mapping[str, float]]
    convention: str

    def parts(self, joint: int) -> Mapping[str, float]:
        """The parts that the joint's name may mean, with the fit of each."""
        return self.readings.get(_term(self.names[joint]), {})

    def means(self, joint: int, part: str) -> bool:
        """Whether the joint's name means this part in all conventions that know it."""
        return self.parts(joint).keys() == {part}

    def is_neck(self, joint: int) -> bool:
        """Whether the joint has a name of the neck, whatever digits follow it."""
        name = self.names[joint]
        return name.side is None and without_digits(name.stem) in vocabulary().necks and not self.is_helper(joint)

    def is_helper(self, joint: int) -> bool:
        """Whether the joint is not part of the body. Names with a helper's word may be, such as "NeckTwist01"."""
        return self.names[joint].helper and not self.parts(joint)


def convention_of(skeleton: Skeleton) -> str:
    """Return the title of the convention that the joints' names follow; empty where none is recognised."""
    return name_meanings(NamedTree.of(skeleton)).convention


def name_meanings(tree: NamedTree) -> NameMeanings:
    """Return what the names of a tree of joints mean.

    The fit of a convention is the number of terms that names and convention share, over the number of terms that either
    has, leaving out terms that no convention knows and the convention's `also`. Its prefix adds `PREFIX_FIT`. Of equal
    fits the one with more of the `also` is recognised.
    """
    conventions = vocabulary().conventions
    names = joint_names(tree, {convention.prefix for convention in conventions} - {()})
    prefixes = Counter(name.prefix for name in names if name.stem)
    prefix = max(prefixes, key=prefixes.__getitem__, default=())
    terms = set(map(_term, names))
    known = terms & vocabulary().terms
    readings: dict[Term, dict[str, float]] = defaultdict(dict)
    fits: list[tuple[float, int]] = []
    for convention in conventions:
        own = convention.parts.keys()
        fit = len(own & known) / len(own | (known - convention.also))
        fit += PREFIX_FIT * (prefix != () and prefix == convention.prefix)
        fits.append((fit, len(convention.also & terms)))
        for term in known & own:
            part = convention.parts[term]
            readings[term][part] = max(readings[term].get(part, 0.0), min(fit, 1.0))
    best = max(range(len(fits)), key=fits.__getitem__)
    return NameMeanings(names, readings, conventions[best].title if fits[best][0] >= RECOGNISED else "")


def _term(name: JointName) -> Term:
    return name.stem, name.side is not None
