"""Joint names without what differs from file to file: prefixes, side markers, case and separators."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from distretarget.skeleton import Skeleton

Side = Literal["left", "right"]
Words = tuple[str, ...]

# A word of a name: capitals, a word in lower case with or without a capital, a word of another script, each with the
# digits behind it, or digits alone.
WORD = re.compile(r"[A-Z]+(?![a-z])\d*|[A-Z]?[a-z]+\d*|\d+|[^\W\d_A-Za-z]+\d*")

# Words that mark a side or the middle.
MARKERS: dict[str, Side | None] = dict.fromkeys(("left", "lft", "lt", "l", "左"), "left")
MARKERS |= dict.fromkeys(("right", "rgt", "rt", "r", "右"), "right")
MARKERS |= dict.fromkeys(("c", "m", "x"))

# Markers that may be written together with a word, as in "lfemur"; believed where the other side has its twin.
GLUED = (("left", "right"), ("l", "r"), ("左", "右"))

# Words of joints that are no joint of the body, and what MakeHuman puts before the name of one that stands in for it.
HELPERS = frozenset(
    ("twist", "roll", "ik", "pole", "target", "effector", "share", "helper", "dummy", "tip", "end", "nub")
)
STAND_IN = "__"

# The part of all names that must share their first or last word, or end with a number, for this to mean nothing.
SHARED = 0.75


@dataclass(frozen=True)
class JointName:
    """What a joint's name says.

    Attributes:
        stem: its words in lower case, joined, without prefix and side marker; empty for an End Site or stand-in.
        side: of the joint or of its nearest ancestor with a side marker.
        helper: it has a word of twist bones, targets or tips, or is an End Site or stand-in.
        prefix: which of the known prefixes it had; empty without.
    """

    stem: str
    side: Side | None
    helper: bool
    prefix: Words


def words(name: str) -> Words:
    """The words of a name in lower case: "mixamorig:LeftForeArm" has four, "upper_arm.L" three."""
    return tuple(word.lower() for word in WORD.findall(unicodedata.normalize("NFKC", name)))


def stem_and_side(parts: Sequence[str]) -> tuple[str, Side | None]:
    """The words that are no markers, joined, and the side that the first marker of a side tells."""
    sides = [side for side in map(MARKERS.get, parts) if side]
    return "".join(part for part in parts if part not in MARKERS), sides[0] if sides else None


def joint_names(skeleton: Skeleton, prefixes: Iterable[Words]) -> tuple[JointName, ...]:
    """What the name of each joint says; `prefixes` are dropped from any name, with digits behind them or without."""
    joints = [joint for joint in range(len(skeleton)) if not skeleton.end_sites[joint]]
    longest_first = sorted(prefixes, key=len, reverse=True)
    found = [_prefix(words(skeleton.names[joint]), longest_first) for joint in joints]
    parts = [words(skeleton.names[joint].rpartition(":")[2]) for joint in joints]
    parts = [part[len(_prefix(part, longest_first)) :] or part for part in parts]
    parts = _without_numbers(_without_shared(_without_shared(parts, 0), -1))
    names = [JointName("", None, True, ())] * len(skeleton)
    sides = _glued_sides([stem_and_side(part) for part in parts])
    for joint, part, prefix, (stem, side) in zip(joints, parts, found, sides, strict=True):
        stand_in = skeleton.names[joint].startswith(STAND_IN)
        names[joint] = JointName("" if stand_in else stem, side, stand_in or any(map(_is_helper, part)), prefix)
    for joint in joints[1:]:
        if names[joint].side is None:
            names[joint] = replace(names[joint], side=names[skeleton.parents[joint]].side)
    return tuple(names)


def without_digits(text: str) -> str:
    """The text without the digits at its end."""
    return text.rstrip("0123456789")


def _prefix(parts: Words, prefixes: Iterable[Words]) -> Words:
    """The first of the prefixes that the words begin with."""
    plain = tuple(map(without_digits, parts))
    return next((prefix for prefix in prefixes if plain[: len(prefix)] == prefix), ())


def _is_helper(word: str) -> bool:
    return without_digits(word) in HELPERS


def _without_shared(parts: Sequence[Words], place: Literal[0, -1]) -> list[Words]:
    """The names without the first or last words that nearly all of them share; one word stays."""
    parts = list(parts)
    while True:
        times = Counter(part[place] for part in parts if len(part) > 1 and not MARKERS.get(part[place]))
        word, count = max(times.items(), key=lambda item: item[1], default=("", 0))
        if not count or count < SHARED * len(parts):
            return parts
        parts = [
            (part[1:] if place == 0 else part[:-1]) if len(part) > 1 and part[place] == word else part for part in parts
        ]


def _without_numbers(parts: Sequence[Words]) -> list[Words]:
    """The names without the number that nearly all of them end with, as those of Sketchfab's files do."""
    numbered = sum(len(part) > 1 and part[-1].isdecimal() for part in parts)
    if numbered < SHARED * len(parts):
        return list(parts)
    return [part[:-1] if len(part) > 1 and part[-1].isdecimal() else part for part in parts]


def _glued_sides(stems: Sequence[tuple[str, Side | None]]) -> list[tuple[str, Side | None]]:
    """The stems and sides with the markers taken off that are glued to an unmarked stem."""
    unmarked = {stem for stem, side in stems if side is None}
    return [(stem, side) if side else _unglued(stem, unmarked) for stem, side in stems]


def _unglued(stem: str, unmarked: set[str]) -> tuple[str, Side | None]:
    for left, right in GLUED:
        sides: tuple[tuple[str, str, Side], ...] = ((left, right, "left"), (right, left, "right"))
        for marker, other, side in sides:
            rest = stem.removeprefix(marker)
            if rest and rest != stem and other + rest in unmarked:
                return rest, side
            rest = stem.removesuffix(marker)
            if rest and rest != stem and rest + other in unmarked:
                return rest, side
    return stem, None
