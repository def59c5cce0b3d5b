"""The errors of this package. Each message is one line: where the fault is, what it is, and what would have worked."""

from __future__ import annotations

import difflib
import json
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Self

LONGEST_NAME = 60  # longer names are cut off in messages [characters]
LONGEST_LINE = 2000  # longer lines on a terminal lose their middle [characters]
LINE_END = 600  # this end of such a line stays, as it has the advice [characters]
SAY_IN_A_MAP = "say in a map which source joint drives which target joint"


class DistretargetError(Exception):
    """Base of all errors of this package; `str(error)` is one line for the user.

    Attributes:
        reason: the message without the place.
        path: the file at fault, or None.
        performer: the number of the performer of a scene at fault, or None.
        of_target: whether that performer's target is at fault, not its source.
    """

    performer: int | None = None
    of_target: bool = False

    def __init__(self, reason: str, path: str | Path | None = None, within: str = "") -> None:
        self.reason = reason  # not passed to Exception: `args` must stay those of the subclass, for pickling
        self.path = None if path is None else Path(path)
        self._within = within  # the place in the file, as it follows the path in the message

    def __str__(self) -> str:
        return f"{self.location}: {self.reason}" if self.location else self.reason

    @property
    def location(self) -> str:
        """The file at fault and, if known, the place in it; empty without a file."""
        return f"{self.path}{self._within}" if self.path else ""

    def in_file(self, path: str | Path) -> Self:
        """Set the file at fault, and return this error."""
        self.path = Path(path)
        return self


class FileError(DistretargetError):
    """A file or folder that cannot be read or written."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(reason, path)


class BvhError(DistretargetError):
    """An invalid BVH file; `line` counts from 1, or is 0 for the whole file."""

    def __init__(self, path: str | Path, line: int, reason: str) -> None:
        super().__init__(reason, path, f":{line}" if line else "")
        self.line = line


class SkeletonFileError(DistretargetError):
    """An invalid JSON file; `place` is such as `joints[3].offset[2]`, or empty for the whole file."""

    def __init__(self, path: str | Path, place: str, reason: str) -> None:
        super().__init__(reason, path, f": {place}" if place else "")
        self.place = place


class SkeletonError(DistretargetError):
    """A skeleton that is not a tree, has two joints with the same key, or lacks a requested joint."""


class MotionError(DistretargetError):
    """A motion that cannot be constructed or retargeted, for example one without frames."""


class SettingsError(DistretargetError):
    """An argument or setting with an invalid value."""


class MatchingError(DistretargetError):
    """Two skeletons whose joints cannot be matched: `fault` says why, and `reason` adds the most similar of the joint
    names `source` and `target`, or else some of both.
    """

    def __init__(self, fault: str, source: Sequence[str], target: Sequence[str], advice: str = SAY_IN_A_MAP) -> None:
        near = ((name, difflib.get_close_matches(name, source, n=1, cutoff=0.6)) for name in target)
        pairs = [f"{name!r} and {matches[0]!r}" for name, matches in near if matches]
        closest = f"closest names: {', '.join(pairs[:3])}"
        names = closest if pairs else f"the target has {quoted(target, 3)}; the source has {quoted(source, 3)}"
        super().__init__(f"{fault}; {names}; {advice}")
        self.fault, self.source, self.target = fault, tuple(source), tuple(target)

    @property
    def is_of_source(self) -> bool:
        """Whether the source alone is at fault."""
        return "the source" in self.fault and "target" not in self.fault

    def advised(self, advice: str) -> MatchingError:
        """Return the same error with other advice at the end of its message."""
        return MatchingError(self.fault, self.source, self.target, advice)


class MapError(DistretargetError):
    """A joint map that names a missing joint; `fault` says what is wrong with the entry at `key`."""

    def __init__(self, key: str, fault: str) -> None:
        super().__init__(f"map[{key!r}]: {fault}")
        self.key, self.fault = key, fault


class ContactsError(DistretargetError):
    """A user constraint that does not suit the clip; `place` is such as `contacts[3].frames`."""

    def __init__(self, place: str, fault: str, path: str | Path | None = None) -> None:
        super().__init__(fault, path, f": {place}" if place else "")
        self.place, self.fault = place, fault
        if path is None:
            self.reason = f"{place}: {fault}"


class MissingPackageError(DistretargetError):
    """A missing optional package that this call needs."""


class LibraryError(DistretargetError):
    """A library of compiled functions that is missing, damaged, old or for another machine; `remedy` installs it."""

    def __init__(self, path: str | Path, reason: str, remedy: str) -> None:
        super().__init__(f"{reason}; the compiled functions come with: {remedy}", path)


class BatchError(DistretargetError):
    """A batch that cannot run, or that stopped."""


@contextmanager
def in_file(path: str | Path) -> Iterator[None]:
    """Set the file at fault of errors raised within that have none."""
    try:
        yield
    except DistretargetError as error:
        raise error if error.path not in (None, Path()) else error.in_file(path) from None


def cut(name: str) -> str:
    """Return a name, or only its beginning if it is too long for a message."""
    return name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."


def shown(line: str) -> str:
    """Return a line fit for a terminal: not too long, and control characters escaped."""
    if len(line) > LONGEST_LINE:
        line = f"{line[: LONGEST_LINE - LINE_END]} ... {line[-LINE_END:]}"
    if line.isprintable():
        return line
    harmless = {each for each in line if each.isprintable() or unicodedata.category(each) == "Zs"}
    return "".join(each if each in harmless else each.encode("unicode_escape").decode() for each in line)


def quoted(names: Iterable[str], most: int = 6) -> str:
    """Return up to `most` names in quotes, separated by commas, and the number of the others."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(repr(cut(name)) for name in names[:most]) + more


def name_difference(names: Iterable[str], expected: Iterable[str]) -> str:
    """Return which expected names are missing, and which names are not expected."""
    names, expected = set(names), set(expected)
    sides = (("lacks", expected - names), ("has", names - expected))
    return "; ".join(f"it {verb} {quoted(sorted(side))}" for verb, side in sides if side)


def counted(number: int, what: str) -> str:
    """Return a number and its noun, such as "1 frame" or "12 frames"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def closest(name: str, available: Sequence[str]) -> str:
    """Return a clause for an error message: the available names close to `name`, or else the first dozen."""
    near = difflib.get_close_matches(name, available, n=3, cutoff=0.6)
    return f"did you mean {quoted(near)}?" if near else f"it has {quoted(available, 12)}"


def entry_place(place: str, key: str) -> str:
    """Return the place of the entry `key` in a file, such as `map["Hips"]`, with unprintable characters escaped."""
    key = cut(key)
    return f"{place}[{json.dumps(key, ensure_ascii=not key.isprintable())}]"
