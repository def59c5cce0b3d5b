"""What a user says about contacts: which to keep, to drop or to make, what rests where, distances and directions.

An entry names parts of a body as people do ("left hand", "hips", "head"), or joints by their names.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from distretarget.checks import brief, check_kind, check_number
from distretarget.errors import ContactsError, SettingsError
from distretarget.numerics.vectors import Flags, Numbers

LONGEST = 1e9  # of frames, seconds, centimetres and coordinates
MOST_FIRM = 100.0

Span = tuple[float, float]
Place = tuple[float, float, float]
Anchor = tuple[float, float]
Ground = Literal["floor", "where it is"]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What all entries have.

    Attributes:
        frames: the first and the last frame, counted from 0, in which it holds; by default it holds in the whole clip.
        seconds: the first and the last second, instead of frames.
        place: where the entry is, such as `contacts[3]`, for errors.
        found: what was found there, in words; it has no effect.
    """

    key: ClassVar[str]  # the field with the names of what it is about
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

    @property
    def named(self) -> tuple[str, ...]:
        """The names of what it is about, as they are given."""
        names = getattr(self, self.key)
        return (names,) if isinstance(names, str) else names

    @property
    def parts(self) -> tuple[str, ...]:
        """The same in alphabetical order."""
        return tuple(sorted(self.named))

    @property
    def acts(self) -> bool:
        """Whether it changes anything."""
        return True


@dataclass(frozen=True, kw_only=True)
class Contact(Entry):
    """A contact of two parts of the body, to keep as it was found, to drop, or to make or change.

    Attributes:
        between: the two parts.
        keep: False to drop it.
        gap: how far their skins are to be apart [cm]; for bodies without thickness their joints. None as it was found.
        firmness: how far they are brought there, 0 to 1.
        anchors: the place on the skin of each part, the same of any body: how far along the part's axis, from 0 to 1,
            and the angle round it [degrees], from the front to the left, on limbs to the outer side; round a hand from
            the palm to the thumb, round a foot from its upper side. None where skins are nearest.

    Raises:
        SettingsError: a value is out of bounds, or a contact is to be dropped and made.
    """

    key = "between"
    between: tuple[str, str]
    keep: bool = True
    gap: float | Literal["source"] | None = None
    firmness: float = 1.0
    anchors: tuple[Anchor, Anchor] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_names("between", self.between, 2)
        check_kind("keep", self.keep, bool)
        if self.gap is not None and self.gap != "source":
            check_number("gap", self.gap, 0.0, LONGEST)
        check_number("firmness", self.firmness, 0.0, 1.0)
        if self.firmness != 1.0 and self.gap is None:
            raise SettingsError('firmness is that of a gap; expected "gap" beside it, such as "source"')
        if not self.keep and self.gap is not None:
            raise SettingsError("an entry with keep false drops a contact, and cannot have a gap; leave one out")
        if self.anchors is not None:
            if self.gap is None or self.gap == "source":
                raise SettingsError('anchors are those of a gap; expected "gap" beside them, in centimetres')
            check_kind("anchors", self.anchors, tuple)
            if len(self.anchors) != 2:
                raise SettingsError(f"anchors are {self.anchors!r}; expected two, one of each part")
            for number, anchor in enumerate(self.anchors):
                _check_numbers(f"anchors[{number}]", anchor, 2, -LONGEST)

    @property
    def acts(self) -> bool:
        return not self.keep or self.gap is not None


@dataclass(frozen=True, kw_only=True)
class Plant(Entry):
    """A part of the body that rests on the world.

    Attributes:
        plant: the part.
        on: "floor"; "where it is", at its mean place; a place in the target's file [its units]; a joint or part of the
            body, with which it moves; in scenes a prop, or a performer's joint, such as "2: Head". None as found.
        keep: False to let it go.

    Raises:
        SettingsError: a value is out of bounds, or a part is to be let go and planted.
    """

    key = "plant"
    plant: str
    on: str | Place | None = None
    keep: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_names("plant", (self.plant,), 1)
        check_kind("keep", self.keep, bool)
        if self.on is not None and not isinstance(self.on, str):
            _check_numbers("on", self.on, 3, -LONGEST)
        if not self.keep and self.on is not None:
            raise SettingsError("an entry with keep false lets a part go, and cannot plant it; leave one out")

    @property
    def acts(self) -> bool:
        return not self.keep or self.on is not None


@dataclass(frozen=True, kw_only=True)
class Distance(Entry):
    """A distance of two joints, the paper's own.

    Attributes:
        distance: the two joints.
        value: their distance [cm].
        priority: pi of the pair in the paper's objective, where that of a bone is 1.

    Raises:
        SettingsError: a value is out of bounds.
    """

    key = "distance"
    distance: tuple[str, str]
    value: float
    priority: float = MOST_FIRM

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_names("distance", self.distance, 2)
        check_number("value", self.value, 0.0, LONGEST)
        check_number("priority", self.priority, 0.0, 1e6)


@dataclass(frozen=True, kw_only=True)
class Look(Entry):
    """A direction that a part of the body keeps.

    Attributes:
        look: the part, such as "head".
        like: "source", as the source's; or the direction in which its front points, in the target's axes.

    Raises:
        SettingsError: a value is out of bounds, or the direction has no length.
    """

    key = "look"
    look: str
    like: Literal["source"] | Place = "source"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_names("look", (self.look,), 1)
        if self.like != "source":
            _check_numbers("like", self.like, 3, -LONGEST)
            if not any(self.like):
                raise SettingsError("like is 0, 0, 0, which is no direction; expected one number that is not 0")


@dataclass(frozen=True, repr=False)
class ContactList:
    """What a user says about the contacts of a clip.

    Attributes:
        entries: one for each statement.
        path: of the file with them, for errors; None without a file.

    Raises:
        SettingsError: an argument has the wrong type.
    """

    entries: tuple[Entry, ...] = ()
    path: Path | None = field(default=None, compare=False)

    __repr__ = brief

    def __post_init__(self) -> None:
        check_kind("entries", self.entries, tuple)
        for number, entry in enumerate(self.entries):
            check_kind(f"entries[{number}]", entry, Contact, Plant, Distance, Look)

    def __iter__(self) -> Iterator[Entry]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    @property
    def acts(self) -> bool:
        """Whether any entry changes anything."""
        return any(entry.acts for entry in self.entries)

    def place_of(self, entry: Entry) -> str:
        """Return where an entry is, such as `contacts[3]`."""
        return entry.place or f"contacts[{next(n for n, each in enumerate(self.entries) if each is entry)}]"

    def fault(self, entry: Entry, key: str, what: str) -> ContactsError:
        """Return the error that says what is wrong with a key of an entry."""
        return ContactsError(f"{self.place_of(entry)}{key and '.'}{key}", what, self.path)


NO_CONTACTS = ContactList()


@dataclass(frozen=True, eq=False)
class Drop:
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


def _check_names(name: str, parts: object, count: int) -> None:
    if not isinstance(parts, tuple) or len(parts) != count or not all(isinstance(part, str) for part in parts):
        what = "the name of a part or joint" if count == 1 else "the names of two parts or joints"
        raise SettingsError(f"{name} is {parts!r}; expected {what}")
    if count == 2 and parts[0] == parts[1]:
        raise SettingsError(f"{name} names {parts[0]!r} twice; expected two parts")


def _check_numbers(name: str, values: object, count: int, least: float) -> None:
    if not isinstance(values, tuple) or len(values) != count:
        raise SettingsError(f"{name} is {values!r}; expected {count} numbers")
    for value in values:
        check_number(name, value, least, LONGEST)
