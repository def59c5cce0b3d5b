"""Everything that can go wrong, each as one line that names the place and what would have worked."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from pathlib import Path


class DistretargetError(Exception):
    """Base of all errors of this package; `str(error)` is one line for the user."""


class FileError(DistretargetError):
    """A file that cannot be read or written.

    Attributes: `path`, and `reason`, a clause such as "is a folder".
    """

    def __init__(self, path: str | Path, reason: str) -> None:
        self.path = Path(path)
        self.reason = reason
        super().__init__(f"{path}: {reason}")


class BvhError(DistretargetError):
    """A BVH file that does not say what a BVH file must say.

    Attributes: `path`, `line` (from 1; 0 where the whole file is meant) and `reason`.
    """

    def __init__(self, path: str | Path, line: int, reason: str) -> None:
        self.path = Path(path)
        self.line = line
        self.reason = reason
        super().__init__(f"{path}:{line}: {reason}" if line else f"{path}: {reason}")


class SkeletonFileError(DistretargetError):
    """A target skeleton file (JSON) that breaks its format.

    Attributes: `path`, `place` (as `joints[3].offset[2]`, empty for the whole file) and `reason`.
    """

    def __init__(self, path: str | Path, place: str, reason: str) -> None:
        self.path = Path(path)
        self.place = place
        self.reason = reason
        super().__init__(f"{path}: {place}: {reason}" if place else f"{path}: {reason}")


class SkeletonError(DistretargetError):
    """A skeleton that is no tree of distinguishable joints, or has not the joint asked for."""


class MotionError(DistretargetError):
    """A motion that cannot be retargeted: no frames, positions that overflow."""


class MatchingError(DistretargetError):
    """Joints of the target that no joint of the source drives.

    Attributes: `missing`, the names of those target joints, and `available`, the source's names.
    """

    def __init__(self, missing: Sequence[str], available: Sequence[str], where: str = "the source") -> None:
        self.missing = tuple(missing)
        self.available = tuple(available)
        noun = "joint" if len(self.missing) == 1 else "joints"
        super().__init__(f"{where} has no {noun} {quoted(self.missing)}; {closest(self.missing[0], self.available)}")


def quoted(names: Iterable[str], most: int = 6) -> str:
    """The names in quotes, separated by commas, and how many more there are past `most`."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(repr(name) for name in names[:most]) + more


def closest(name: str, available: Sequence[str]) -> str:
    """What would have worked in place of `name`: the nearest names, or all of them."""
    near = difflib.get_close_matches(name, available, n=3, cutoff=0.6)
    return f"did you mean {quoted(near)}?" if near else f"it has {quoted(available, 12)}"
