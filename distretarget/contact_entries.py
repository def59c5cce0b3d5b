"""User constraints: contacts to keep, drop or make, supports, distances and directions.

An entry names parts of the body ("left hand", "hips", "head") or joints.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from distretarget.checks import brief_repr, check_kind, check_number
from distretarget.errors import ContactsError, SettingsError
from distretarget.numerics.vectors import Flags, Numbers

LARGEST = 1e9  # largest frame, second, length in centimetres, and coordinate
DISTANCE_PRIORITY = 100.0

Span = tuple[float, float]
Place = tuple[float, float, float]
Anchor = tuple[float, float]
Ground = Literal["floor", "where it is"]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """The fields that all constraints share.

    Attributes:
        frames: the first and the last frame, counted from 0, in which the constraint holds; by default the whole clip.
        seconds: the first and the last second, instead of frames.
        place: where the entry is in its file, such as `contacts[3]`, for errors.
        found: a description of what was found there; it has no effect.
    """

    key: ClassVar[str]  # the field with the constrained parts or joints
    frames: Span | None = None
    seconds: Span | None = None
    place: str = field(default="", compare=False)
    found: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if self.frames is not None and self.seconds is not None:
            raise SettingsError("an entry has both frames and seconds; leave one out")
        for name, span in (("frames", self.frames), ("seconds", self.seconds)):
            if span is None:
                continue
            _check_numbers(name, span, 2, 0.0)
            if span[0] > span[1]:
                raise SettingsError(f"{name} go back from {span[0]:g} to {span[1]:g}; swap them")
            if name == "frames" and any(each != int(each) for each in span):
                raise SettingsError(f"frames go from {span[0]:g} to {span[1]:g}; expected whole numbers, or seconds")
        check_kind("found", self.found, str)
        count = 2 if self.key in ("between", "distance") else 1
        names = getattr(self, self.key) if count == 2 else (getattr(self, self.key),)
        if not isinstance(names, tuple) or len(names) != count or not all(isinstance(name, str) for name in names):
            what = "the name of a part or joint" if count == 1 else "the names of two parts or joints"
            raise SettingsError(f"{self.key} is {names!r}; expected {what}")
        if count == 2 and names[0] == names[1]:
            raise SettingsError(f"{self.key} names {names[0]!r} twice; expected two parts")

    @property
    def names(self) -> tuple[str, ...]:
        """The constrained parts or joints, in the order given."""
        names = getattr(self, self.key)
        return (names,) if isinstance(names, str) else names

    @property
    def parts(self) -> tuple[str, ...]:
        """The constrained parts or joints, in alphabetical order."""
        return tuple(sorted(self.names))

    @property
    def has_effect(self) -> bool:
        """Whether the entry changes the result."""
        return True


@dataclass(frozen=True, kw_only=True)
class Contact(Entry):
    """A contact of two parts of the body: to keep as found, to drop, to change, or to make.

    Attributes:
        between: the two parts.
        keep: False drops the contact.
        gap: the gap between the two skins, or the two joints of bodies without thickness [cm]; "source" for the
            source's gap; None keeps the contact as found.
        firmness: the weight of the gap, 0 to 1.
        anchors: the point on the skin of each part that takes part in the contact, valid for any body: the position
            along the part's axis, 0 to 1, and the angle about it [degrees], from the front to the left, on limbs to the
            outer side; on a hand from palm to thumb, on a foot from its upper side. None for the nearest points.

    Raises:
        SettingsError: a value is out of bounds, or a dropped contact has a gap.
    """

    key = "between"
    between: tuple[str, str]
    keep: bool = True
    gap: float | Literal["source"] | None = None
    firmness: float = 1.0
    anchors: tuple[Anchor, Anchor] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_kind("keep", self.keep, bool)
        if self.gap is not None and self.gap != "source":
            check_number("gap", self.gap, 0.0, LARGEST)
        check_number("firmness", self.firmness, 0.0, 1.0)
        if self.firmness != 1.0 and self.gap is None:
            raise SettingsError('firmness is the weight of a gap; expected "gap" beside it, such as "source"')
        if not self.keep and self.gap is not None:
            raise SettingsError("an entry with keep false drops a contact, and cannot have a gap; leave one out")
        if self.anchors is not None:
            if self.gap is None or self.gap == "source":
                raise SettingsError('anchors are the places of a gap; expected "gap" beside them, in centimetres')
            check_kind("anchors", self.anchors, tuple)
            if len(self.anchors) != 2:
                raise SettingsError(f"anchors are {self.anchors!r}; expected two, one of each part")
            for number, anchor in enumerate(self.anchors):
                _check_numbers(f"anchors[{number}]", anchor, 2, -LARGEST)

    @property
    def has_effect(self) -> bool:
        return not self.keep or self.gap is not None


@dataclass(frozen=True, kw_only=True)
class Plant(Entry):
    """A support: a part of the body that rests on something.

    Attributes:
        plant: the part.
        on: "floor"; "where it is", its mean position; a position in the target's file [its units]; a joint or part of
            the body that carries it; in scenes a prop, or a performer's joint, such as "2: Head". None as found.
        keep: False drops the support.

    Raises:
        SettingsError: a value is out of bounds, or a dropped support has a place.
    """

    key = "plant"
    plant: str
    on: str | Place | None = None
    keep: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_kind("keep", self.keep, bool)
        if self.on is not None and not isinstance(self.on, str):
            _check_numbers("on", self.on, 3, -LARGEST)
        if not self.keep and self.on is not None:
            raise SettingsError('an entry with keep false drops a support, and cannot have "on"; leave one out')

    @property
    def has_effect(self) -> bool:
        return not self.keep or self.on is not None


@dataclass(frozen=True, kw_only=True)
class Distance(Entry):
    """A distance of two joints, a term of the paper's objective.

    Attributes:
        distance: the two joints.
        value: their distance [cm].
        priority: pi of the pair in the paper's objective; a bone has 1.

    Raises:
        SettingsError: a value is out of bounds.
    """

    key = "distance"
    distance: tuple[str, str]
    value: float
    priority: float = DISTANCE_PRIORITY

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("value", self.value, 0.0, LARGEST)
        check_number("priority", self.priority, 0.0, 1e6)


@dataclass(frozen=True, kw_only=True)
class Look(Entry):
    """A direction that the front of a part of the body keeps.

    Attributes:
        look: the part, such as "head".
        like: "source" for the source's direction; or a direction in the target's axes.

    Raises:
        SettingsError: a value is out of bounds, or the direction has no length.
    """

    key = "look"
    look: str
    like: Literal["source"] | Place = "source"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.like != "source":
            _check_numbers("like", self.like, 3, -LARGEST)
            if not any(self.like):
                raise SettingsError("like is 0, 0, 0, which is no direction; expected one number that is not 0")


@dataclass(frozen=True, repr=False)
class ContactList:
    """The user constraints of a clip.

    Attributes:
        entries: the constraints.
        path: their file, for errors; None without a file.

    Raises:
        SettingsError: an argument has the wrong type.
    """

    entries: tuple[Entry, ...] = ()
    path: Path | None = field(default=None, compare=False)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        check_kind("entries", self.entries, tuple)
        for number, entry in enumerate(self.entries):
            check_kind(f"entries[{number}]", entry, Contact, Plant, Distance, Look)

    def __iter__(self) -> Iterator[Entry]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    @property
    def has_effect(self) -> bool:
        """Whether any entry changes the result."""
        return any(entry.has_effect for entry in self.entries)

    def place_of(self, entry: Entry) -> str:
        """Return the place of an entry in its file, such as `contacts[3]`."""
        return entry.place or f"contacts[{next(n for n, each in enumerate(self.entries) if each is entry)}]"

    def fault(self, entry: Entry, key: str, what: str) -> ContactsError:
        """Return the error for a key of an entry; `what` says what is wrong."""
        return ContactsError(f"{self.place_of(entry)}{key and '.'}{key}", what, self.path)


NO_CONTACTS = ContactList()


@dataclass(frozen=True, eq=False)
class DroppedContact:
    """A contact that does not count in some frames."""

    parts: tuple[Numbers, ...]  # the target's joints of its two parts
    frames: Flags  # (frames,)

    @property
    def orders(self) -> tuple[tuple[Numbers, Numbers], ...]:
        """The two parts in either order."""
        one, other = self.parts
        return (one, other), (other, one)

    def matches(self, a: Numbers, b: Numbers) -> Flags:
        """(pairs,), whether joints a and b, (pairs,) each, belong to one part each, in either order."""
        return np.asarray(np.any([np.isin(a, one) & np.isin(b, other) for one, other in self.orders], axis=0))


def _check_numbers(name: str, values: object, count: int, least: float) -> None:
    if not isinstance(values, tuple) or len(values) != count:
        raise SettingsError(f"{name} is {values!r}; expected {count} numbers")
    for value in values:
        check_number(name, value, least, LARGEST)
