"""Meanings of joint names: their words and sides, and the naming convention that they follow.

`conventions.json` lists the words of many naming conventions. An entry has a readable title; the names of the hips, of
spine and neck from below, and of the head; those of the four parts of arm and leg (`ARM`, `LEG`) without side; and, if
the convention has them, the prefix of all names, other names that may occur, and the `leans` (see `Convention`).
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.resources import files
from itertools import filterfalse
from typing import Any, Literal, NamedTuple

from distretarget.body.anatomy import ARM, LEG, Side
from distretarget.skeleton import Skeleton

NameWords = tuple[str, ...]
"""The words of a joint's name, in lower case."""

Term = tuple[str, bool]
"""The stem of a joint's name, and whether the name has a side."""

# A word of a name: a run of capitals, a lower-case word that may begin with a capital, or a word in another script,
# each with the digits that follow it; or digits alone.
NAME_WORD = re.compile(r"[A-Z]+(?![a-z])\d*|[A-Z]?[a-z]+\d*|\d+|[^\W\d_A-Za-z]+\d*")

# Words that mark a side, or the middle (None).
SIDE_MARKERS: dict[str, Side | None] = dict.fromkeys(("left", "lft", "lt", "l", "左"), "left")
SIDE_MARKERS |= dict.fromkeys(("right", "rgt", "rt", "r", "右"), "right")
SIDE_MARKERS |= dict.fromkeys(("c", "m", "x"))

# Markers that may be part of a word, as in "lfemur", with that of the other side, which must have the matching name.
ATTACHED_MARKERS: tuple[tuple[str, str, Side], ...] = (("left", "right", "left"), ("right", "left", "right"))
ATTACHED_MARKERS += (("l", "r", "left"), ("r", "l", "right"), ("左", "右", "left"), ("右", "左", "right"))

# Words in the names of helper joints, which are not part of the body, and MakeHuman's prefix of such joints.
HELPER_WORDS = {"twist", "roll", "ik", "pole", "target", "effector", "share", "helper", "dummy", "tip", "end", "nub"}
HELPER_PREFIX = "__"

NEW_BONE = ("bone",)  # Blender's name of a new bone, which some bones keep as a prefix when renamed by hand

COMMON_SHARE = 0.75  # first or last words or final numbers of this share of the names are ignored [0 to 1]
RECOGNISED = 0.75  # least fit of a convention that is recognised [0 to 1]
PREFIX_FIT = 1.0  # bonus for the prefix of a convention


class NamedTree(NamedTuple):
    """A skeleton without its offsets: all that the meaning of names depends on, equal for all clips of a rig."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    end_sites: tuple[bool, ...]

    @classmethod
    def of(cls, skeleton: Skeleton) -> NamedTree:
        """Return the tree of a skeleton."""
        return cls(tuple(skeleton.names), tuple(skeleton.parents.tolist()), tuple(skeleton.end_sites.tolist()))


@dataclass(frozen=True)
class JointName:
    """A joint's name, taken apart."""

    stem: str  # the words in lower case without prefix and side; empty for End Sites and helpers of MakeHuman
    side: Side | None  # the side that the name marks, else that of the nearest ancestor with a side marker
    helper: bool  # whether the joint is not part of the body: an End Site, or a twist bone, target or tip by its name
    prefix: NameWords  # which of the known prefixes the name has; empty without one

    @property
    def term(self) -> Term:
        """Stem, and whether there is a side."""
        return self.stem, self.side is not None


@lru_cache(maxsize=4096)
def words(name: str) -> NameWords:
    """Return the words of a name in lower case, without accents: "mixamorig:LeftForeArm" has four, "Índice.L" two."""
    letters = "".join(filterfalse(unicodedata.combining, unicodedata.normalize("NFKD", name)))
    return tuple(word.lower() for word in NAME_WORD.findall(letters))


def stem_and_side(parts: Sequence[str]) -> tuple[str, Side | None]:
    """Return the words that are not side markers, joined, and the side of the first marker that names one."""
    side = next((side for side in map(SIDE_MARKERS.get, parts) if side), None)
    return "".join(part for part in parts if part not in SIDE_MARKERS), side


def without_digits(text: str) -> str:
    """Return the text without the digits at its end."""
    return text.rstrip("0123456789")


def _joint_names(tree: NamedTree, prefixes: Iterable[NameWords]) -> tuple[JointName, ...]:
    """The joints' names taken apart, without `prefixes`, whether digits follow them or not."""
    joints = [joint for joint, is_end in enumerate(tree.end_sites) if not is_end]
    longest_first = sorted(prefixes, key=len, reverse=True)
    joint_prefixes = [_prefix(words(tree.names[joint]), longest_first) for joint in joints]
    full = [words(tree.names[joint].rpartition(":")[2]) for joint in joints]
    parts = _without_prefix(_without_common(_without_prefix(full, longest_first), 0), longest_first)
    parts = _without_numbers(_without_common(parts, -1))
    stems = [stem_and_side(part) for part in parts]
    unmarked = {stem for stem, side in stems if side is None}
    names = [JointName("", None, True, ())] * len(tree.names)
    for joint, part, prefix, (stem, side) in zip(joints, parts, joint_prefixes, stems, strict=True):
        if side is None:
            stem, side = _split_marker(stem, unmarked)
        if side is None and joint:
            side = names[tree.parents[joint]].side
        helper = tree.names[joint].startswith(HELPER_PREFIX)
        is_helper = helper or any(without_digits(word) in HELPER_WORDS for word in part)
        names[joint] = JointName("" if helper else stem, side, is_helper, prefix)
    return tuple(names)


def _prefix(parts: NameWords, prefixes: Iterable[NameWords]) -> NameWords:
    """The first of the prefixes that the words begin with; empty without one."""
    plain = tuple(map(without_digits, parts))
    return next((prefix for prefix in prefixes if plain[: len(prefix)] == prefix), ())


def _without_prefix(parts: Sequence[NameWords], prefixes: Iterable[NameWords]) -> Sequence[NameWords]:
    """The names without the prefix that they begin with, if any; each keeps one word."""
    return [part[len(_prefix(part, prefixes)) :] or part for part in parts]


def _without_common(parts: Sequence[NameWords], place: Literal[0, -1]) -> Sequence[NameWords]:
    """The names without the first (place 0) or last (place -1) words that nearly all share; each keeps one word."""
    times = Counter(part[place] for part in parts if len(part) > 1 and not SIDE_MARKERS.get(part[place]))
    word, count = max(times.items(), key=lambda item: item[1], default=("", 0))
    if not count or count < COMMON_SHARE * len(parts):
        return parts
    kept = slice(1, None) if place == 0 else slice(-1)
    return _without_common([part[kept] if len(part) > 1 and part[place] == word else part for part in parts], place)


def _without_numbers(parts: Sequence[NameWords]) -> Sequence[NameWords]:
    """The names without the numbers at their ends, if nearly all names have one, as in Sketchfab's files."""
    numbered = [len(part) > 1 and part[-1].isdecimal() for part in parts]
    if sum(numbered) < COMMON_SHARE * len(parts):
        return parts
    return [part[:-1] if number else part for part, number in zip(parts, numbered, strict=True)]


def _split_marker(stem: str, unmarked: set[str]) -> tuple[str, Side | None]:
    """The stem without its attached marker, and the side of that, if `unmarked` has the other side's name."""
    for marker, other, side in ATTACHED_MARKERS:
        after, before = stem.removeprefix(marker), stem.removesuffix(marker)
        for rest, twin in ((after, other + after), (before, before + other)):
            if rest not in ("", stem) and twin in unmarked:
                return rest, side
    return stem, None


@dataclass(frozen=True)
class Convention:
    """A naming convention."""

    title: str  # the readable name
    prefix: NameWords  # the words with which all names begin; empty for most conventions
    parts: Mapping[Term, str]  # the part that each term means
    also: frozenset[Term]  # other terms that may occur
    # how far the axes of the joints from spine to head lean forwards against the hips' in a body that stands, lowest
    # first [degrees]; empty where that is not known
    leans: tuple[float, ...]


class Vocabulary(NamedTuple):
    """The content of `conventions.json`."""

    conventions: tuple[Convention, ...]  # all conventions, the preferred one first where names fit several
    terms: frozenset[Term]  # all terms that mean a part in any of them
    fingers: Mapping[str, Sequence[str]]  # the words for each finger
    palm: Sequence[str]  # the words for a bone in the palm
    necks: frozenset[str]  # the words for joints of the neck, without digits at the end


@cache
def vocabulary() -> Vocabulary:
    """Return the vocabulary in `conventions.json`."""
    data = json.loads(files(__package__).joinpath("conventions.json").read_text("utf-8"))
    conventions = tuple(map(_convention, data["conventions"]))
    parts = [item for convention in conventions for item in convention.parts.items()]
    necks = frozenset(without_digits(stem) for (stem, _), part in parts if part == "neck")
    return Vocabulary(conventions, frozenset(term for term, _ in parts), data["fingers"], data["palm"], necks)


def _convention(entry: Mapping[str, Any]) -> Convention:
    """The convention of an entry of `conventions.json`."""
    trunk = [(entry["hips"], "hips"), (entry["head"], "head")]
    trunk += [(name, part) for part in ("spine", "neck") for name in entry[part]]
    limbs = [*zip(entry["arm"], ARM, strict=True), *zip(entry["leg"], LEG, strict=True)]
    parts = {(stem_and_side(words(name))[0], False): part for name, part in trunk}
    parts |= {(stem_and_side(words(name))[0], True): part for name, part in limbs if name}
    others = [stem_and_side(words(name)) for name in entry.get("also", ())]
    also = frozenset((stem, side is not None) for stem, side in others)
    return Convention(entry["title"], words(entry.get("prefix", "")), parts, also, tuple(entry.get("leans", ())))


def leans_of(title: str) -> tuple[float, ...]:
    """Return the `leans` of the convention with a title; empty without one."""
    return next((convention.leans for convention in vocabulary().conventions if convention.title == title), ())


@dataclass(frozen=True)
class NameMeanings:
    """What the names of a skeleton's joints mean."""

    names: tuple[JointName, ...]  # the name of each joint, taken apart
    # the parts that each term may mean, each with the best fit, 0 to 1, of the conventions in which it does
    readings: Mapping[Term, Mapping[str, float]]
    convention: str  # the title of the recognised convention; empty where none is

    def parts(self, joint: int) -> Mapping[str, float]:
        """The parts that the joint's name may mean, with the fit of each."""
        return self.readings.get(self.names[joint].term, {})

    def means(self, joint: int, part: str) -> bool:
        """Whether the joint's name means this part in all conventions that know it."""
        return self.parts(joint).keys() == {part}

    def is_neck(self, joint: int) -> bool:
        """Whether the joint has a name of the neck, whatever digits follow it."""
        name = self.names[joint]
        return name.side is None and without_digits(name.stem) in vocabulary().necks and not self.is_helper(joint)

    def is_helper(self, joint: int) -> bool:
        """Whether the joint is not part of the body. A known name with a helper word ("NeckTwist01") is part of it."""
        return self.names[joint].helper and not self.parts(joint)


def convention_of(skeleton: Skeleton) -> str:
    """Return the title of the convention that the joints' names follow; empty where none is recognised."""
    return name_meanings(NamedTree.of(skeleton)).convention


def name_meanings(tree: NamedTree) -> NameMeanings:
    """Return what the names of a tree of joints mean. The fit of a convention is the number of terms that it shares
    with the names, over the number that either has, without terms that no convention knows and the convention's `also`;
    its prefix adds `PREFIX_FIT`. Of equal fits the one with more of the `also` wins. Numbers that no convention knows
    count for no fit.
    """
    conventions = vocabulary().conventions
    names = _joint_names(tree, {convention.prefix for convention in conventions} - {()} | {NEW_BONE})
    prefixes = Counter(name.prefix for name in names if name.stem)
    prefix = max(prefixes, key=prefixes.__getitem__, default=())
    terms = {name.term for name in names}
    known, numbered = terms & vocabulary().terms, _numbered(terms)
    readings: dict[Term, dict[str, float]] = defaultdict(dict)
    fits: list[tuple[float, int]] = []
    for convention in conventions:
        own = convention.parts.keys()
        fit = len(own & known) / len(own | (known - convention.also))
        fit += PREFIX_FIT * (prefix != () and prefix == convention.prefix)
        fits.append((fit, len(convention.also & terms)))
        means = {term: term for term in known & own} | {term: plain for term, plain in numbered.items() if plain in own}
        for term, plain in means.items():
            part = convention.parts[plain]
            readings[term][part] = max(readings[term].get(part, 0.0), min(fit, 1.0))
    best = max(range(len(fits)), key=fits.__getitem__)
    return NameMeanings(names, readings, conventions[best].title if fits[best][0] >= RECOGNISED else "")


def _numbered(terms: Collection[Term]) -> dict[Term, Term]:
    """The terms of limbs whose number no convention knows, such as "arm00", each with the known term without it. Of
    several numbers of a term the first one counts, or none if a convention knows one of these.
    """
    known = vocabulary().terms
    groups: dict[Term, list[Term]] = defaultdict(list)
    for stem, sided in sorted(terms):
        if sided:
            groups[without_digits(stem), True].append((stem, True))
    return {each[0]: plain for plain, each in groups.items() if plain in known and known.isdisjoint(each)}
