"""Joint names reduced to their meaning: without prefixes, side markers, case and separators."""

from __future__ import annotations

import operator
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

from distretarget.skeleton import Skeleton

Side = Literal["left", "right"]
NameWords = tuple[str, ...]
"""The words of a joint's name, in lower case."""

# A word of a name: a run of capitals, a lower-case word that may begin with a capital, or a word in another script,
# each with the digits that follow it; or digits alone.
NAME_WORD = re.compile(r"[A-Z]+(?![a-z])\d*|[A-Z]?[a-z]+\d*|\d+|[^\W\d_A-Za-z]+\d*")

# Words that mark a side, or the middle (None).
SIDE_MARKERS: dict[str, Side | None] = dict.fromkeys(("left", "lft", "lt", "l", "左"), "left")
SIDE_MARKERS |= dict.fromkeys(("right", "rgt", "rt", "r", "右"), "right")
SIDE_MARKERS |= dict.fromkeys(("c", "m", "x"))

# Markers (left, right) that may be part of a word, as in "lfemur"; valid only if the other side has the matching name.
ATTACHED_MARKERS = (("left", "right"), ("l", "r"), ("左", "右"))

# Words in the names of helper joints, which are not part of the body, and MakeHuman's prefix of its helper joints.
HELPER_WORDS = frozenset(
    ("twist", "roll", "ik", "pole", "target", "effector", "share", "helper", "dummy", "tip", "end", "nub")
)
HELPER_PREFIX = "__"

# A first word, a last word or a number at the end is ignored if at least this share of all names has it [0 to 1].
COMMON_SHARE = 0.75


class NamedTree(NamedTuple):
    """The joints of a skeleton without their offsets: all that the names' meanings depend on. Clips of one rig have
    equal trees.

    Attributes:
        names: the name of each joint.
        parents: the parent of each joint, -1 for the root.
        end_sites: whether each joint is an End Site.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    end_sites: tuple[bool, ...]

    @classmethod
    def of(cls, skeleton: Skeleton) -> NamedTree:
        """The tree of a skeleton."""
        return cls(tuple(skeleton.names), tuple(skeleton.parents.tolist()), tuple(skeleton.end_sites.tolist()))


@dataclass(frozen=True)
class JointName:
    """The meaning of a joint's name.

    Attributes:
        stem: the words in lower case, joined, without prefix and side marker; empty for End Sites and MakeHuman's
            helper joints.
        side: the side that the name marks, else that of the nearest ancestor with a side marker.
        helper: whether the joint is not part of the body: an End Site, or a twist bone, target or tip by its name.
        prefix: which of the known prefixes the name has; empty without one.
    """

    stem: str
    side: Side | None
    helper: bool
    prefix: NameWords


@lru_cache(maxsize=4096)
def words(name: str) -> NameWords:
    """Return the words of a name in lower case: "mixamorig:LeftForeArm" has four, "upper_arm.L" three."""
    return tuple(word.lower() for word in NAME_WORD.findall(unicodedata.normalize("NFKC", name)))


def stem_and_side(parts: Sequence[str]) -> tuple[str, Side | None]:
    """Return the words that are not side markers, joined, and the side of the first marker that names one."""
    sides = [side for side in map(SIDE_MARKERS.get, parts) if side]
    return "".join(part for part in parts if part not in SIDE_MARKERS), sides[0] if sides else None


def joint_names(tree: NamedTree, prefixes: Iterable[NameWords]) -> tuple[JointName, ...]:
    """Return the meaning of each joint's name, without `prefixes`, whether digits follow them or not."""
    joints = [joint for joint in range(len(tree.names)) if not tree.end_sites[joint]]
    longest_first = sorted(prefixes, key=len, reverse=True)
    joint_prefixes = [_prefix(words(tree.names[joint]), longest_first) for joint in joints]
    full = [words(tree.names[joint].rpartition(":")[2]) for joint in joints]
    parts: Sequence[NameWords] = [part[len(_prefix(part, longest_first)) :] or part for part in full]
    parts = _without_numbers(_without_common(_without_common(parts, 0), -1))
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


def without_digits(text: str) -> str:
    """Return the text without the digits at its end."""
    return text.rstrip("0123456789")


def _prefix(parts: NameWords, prefixes: Iterable[NameWords]) -> NameWords:
    """The first of the prefixes that the words begin with; empty without one."""
    plain = tuple(map(without_digits, parts))
    return next((prefix for prefix in prefixes if plain[: len(prefix)] == prefix), ())


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
    shorter = [part[:-1] if len(part) > 1 and part[-1].isdecimal() else part for part in parts]
    numbered = sum(map(operator.ne, parts, shorter))
    return parts if numbered < COMMON_SHARE * len(parts) else shorter


def _split_marker(stem: str, unmarked: set[str]) -> tuple[str, Side | None]:
    """The stem without its attached marker, and the side of that, if `unmarked` has the other side's name."""
    for left, right in ATTACHED_MARKERS:
        sides: tuple[tuple[str, str, Side], ...] = ((left, right, "left"), (right, left, "right"))
        for marker, other, side in sides:
            rest = stem.removeprefix(marker)
            if rest and rest != stem and other + rest in unmarked:
                return rest, side
            rest = stem.removesuffix(marker)
            if rest and rest != stem and rest + other in unmarked:
                return rest, side
    return stem, None
