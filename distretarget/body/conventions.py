"""What the names of a skeleton's joints mean, and which naming convention they follow."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

from distretarget.body.joint_names import JointName, NamedTree, joint_names, without_digits
from distretarget.body.vocabulary import Term, vocabulary
from distretarget.skeleton import Skeleton

# A convention is recognised from this fit on [0 to 1], to which its prefix adds the second number.
RECOGNISED = 0.75
PREFIX_FIT = 1.0


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
    """Return what the names of a tree of joints mean."""
    conventions = vocabulary().conventions
    names = joint_names(tree, {convention.prefix for convention in conventions} - {()})
    terms = vocabulary().terms.intersection(map(_term, names))
    fits = _fits(names, terms)
    readings: dict[Term, dict[str, float]] = defaultdict(dict)
    for convention, (fit, _) in zip(conventions, fits, strict=True):
        for term in terms & convention.parts.keys():
            part = convention.parts[term]
            readings[term][part] = max(readings[term].get(part, 0.0), min(fit, 1.0))
    best = max(range(len(fits)), key=fits.__getitem__)
    title = conventions[best].title if fits[best][0] >= RECOGNISED else ""
    return NameMeanings(names, readings, title)


def _fits(names: Sequence[JointName], known: Set[Term]) -> list[tuple[float, int]]:
    """How well the names fit each convention, and how many of its other terms they have; `known` are their terms that
    any convention knows.

    The fit is the number of terms that names and convention share, over the number of terms that either has. Terms that
    no convention knows and the convention's other terms are left out. The convention's prefix adds `PREFIX_FIT`.
    """
    conventions = vocabulary().conventions
    terms = set(map(_term, names))
    prefixes = Counter(name.prefix for name in names if name.stem)
    prefix = max(prefixes, key=prefixes.__getitem__, default=())
    fits = []
    for convention in conventions:
        own = convention.parts.keys()
        fit = len(own & known) / len(own | (known - convention.also))
        fits.append((fit + PREFIX_FIT * (prefix != () and prefix == convention.prefix), len(convention.also & terms)))
    return fits


def _term(name: JointName) -> Term:
    return name.stem, name.side is not None
