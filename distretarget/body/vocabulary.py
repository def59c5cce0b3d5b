"""The words with which naming conventions call the joints of a body.

`conventions.json` lists the words of many naming conventions. An entry has a readable title; the names of the hips, of
spine and neck from below, and of the head; those of the four parts of arm and leg (`ARM`, `LEG`) without side; and, if
the convention has them, the prefix of all names, and other names that may occur.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from distretarget.body.anatomy import ARM, LEG
from distretarget.body.joint_names import NameWords, stem_and_side, without_digits, words

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
    conventions = tuple(_convention(**entry) for entry in data["conventions"])
    return Vocabulary(
        conventions,
        frozenset(term for convention in conventions for term in convention.parts),
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
    *,
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
