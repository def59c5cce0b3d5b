"""The errors of this package: each is one line that names the place of the fault and what would have worked."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Self

SAY_IN_A_MAP = "say in a map which source joint drives which target joint"


class DistretargetError(Exception):
    """Base of all errors of this package; `str(error)` is one line for the user.

    Attributes: `reason`, what is wrong without the place, and `path`, the file at fault, None if it is not a file.
    """

    path: Path | None = None

    def __init__(self, reason: str) -> None:
        self.reason = reason  # `args`, by which errors are pickled, keeps the arguments of the subclass

    def __str__(self) -> str:
        return f"{self.location}: {self.reason}" if self.location else self.reason

    @property
    def location(self) -> str:
        """The file at fault and, where known, the place in it; empty without a file."""
        return str(self.path) if self.path else ""

    def in_file(self, path: str | Path) -> Self:
        """Set the file at fault, and return this error."""
        self.path = Path(path)
        return self


class FileError(DistretargetError):
    """A file or folder that cannot be read or written."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(reason)
        self.path = Path(path)


class BvhError(DistretargetError):
    """A BVH file that is not valid; `line` counts from 1, 0 is the whole file."""

    def __init__(self, path: str | Path, line: int, reason: str) -> None:
        super().__init__(reason)
        self.path, self.line = Path(path), line

    @property
    def location(self) -> str:
        """The file and, unless the whole file is at fault, the line."""
        return f"{self.path}:{self.line}" if self.line else str(self.path)


class SkeletonFileError(DistretargetError):
    """A JSON file that breaks its format; `place` is such as `joints[3].offset[2]`, empty for the whole file."""

    def __init__(self, path: str | Path, place: str, reason: str) -> None:
        super().__init__(reason)
        self.path, self.place = Path(path), place

    @property
    def location(self) -> str:
        """The file and, unless the whole file is at fault, the place in it."""
        return f"{self.path}: {self.place}" if self.place else str(self.path)


class SkeletonError(DistretargetError):
    """A skeleton that is not a tree of joints that can be told apart, or that lacks a joint asked for."""


class MotionError(DistretargetError):
    """A motion that cannot be made or retargeted, for example one without frames."""


class SettingsError(DistretargetError):
    """An argument or setting with an invalid value."""


class MatchingError(DistretargetError):
    """Joints of two skeletons that cannot be matched.

    Attributes:
        fault: why they cannot be matched; `reason` also has the names of both and the closest pairs.
        source, target: the names of the joints of each skeleton.
    """

    def __init__(self, fault: str, source: Sequence[str], target: Sequence[str], advice: str = SAY_IN_A_MAP) -> None:
        near = ((name, difflib.get_close_matches(name, source, n=1, cutoff=0.6)) for name in target)
        pairs = [f"{name!r} and {matches[0]!r}" for name, matches in near if matches]
        shown = f"closest names: {', '.join(pairs[:6])}; " if pairs else ""
        names = f"the target has {quoted(target, 12)}; the source has {quoted(source, 12)}"
        super().__init__(f"{fault}; {shown}{names}; {advice}")
        self.fault, self.source, self.target = fault, tuple(source), tuple(target)

    def advised(self, advice: str) -> MatchingError:
        """Return the same error with other advice at the end of its message."""
        return MatchingError(self.fault, self.source, self.target, advice)


class MapError(DistretargetError):
    """A joint map that names a joint that does not exist: `fault` is what is wrong with the entry at `key`."""

    def __init__(self, key: str, fault: str) -> None:
        super().__init__(f"map[{key!r}]: {fault}")
        self.key, self.fault = key, fault


class MissingPackageError(DistretargetError):
    """An optional package that this call needs, and that is not installed."""


class BatchError(DistretargetError):
    """A batch that cannot run, or that stopped."""


def quoted(names: Iterable[str], most: int = 6) -> str:
    """Return up to `most` names in quotes, separated by commas, and how many more there are."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(repr(name) for name in names[:most]) + more


def counted(number: int, what: str) -> str:
    """Return how many there are of what, such as "1 frame" or "12 frames"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def closest(name: str, available: Sequence[str]) -> str:
    """Return the names close to `name`, or else all available names, as a clause for an error message."""
    near = difflib.get_close_matches(name, available, n=3, cutoff=0.6)
    return f"did you mean {quoted(near)}?" if near else f"it has {quoted(available, 12)}"


def entry_place(place: str, key: str) -> str:
    """Return the place of an entry whose key the user chose, in printable characters."""
    return f"{place}[{json.dumps(key, ensure_ascii=not key.isprintable())}]"
