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


class SettingsError(DistretargetError):
    """A setting of an objective with a value that has no meaning there."""


class MatchingError(DistretargetError):
    """Joints of two skeletons that cannot be matched.

    Attributes: `reason`, and `target` and `source`, the names of their joints.
    """

    def __init__(self, reason: str, target: Sequence[str], source: Sequence[str]) -> None:
        self.reason = reason
        self.target = tuple(target)
        self.source = tuple(source)
        near = ((name, difflib.get_close_matches(name, source, n=1, cutoff=0.6)) for name in target)
        pairs = [f"{name!r} and {found[0]!r}" for name, found in near if found]
        shown = f"closest names: {', '.join(pairs[:6])}; " if pairs else ""
        super().__init__(
            f"{reason}; {shown}the target has {quoted(target, 12)}; the source has {quoted(source, 12)}; "
            "say in a map which source joint drives which target joint"
        )


class MapError(DistretargetError):
    """A map from target joints to source joints that names a joint which is not there.

    Attributes: `key`, the entry, and `reason`.
    """

    def __init__(self, key: str, reason: str) -> None:
        self.key = key
        self.reason = reason
        super().__init__(f"map[{key!r}]: {reason}")


class BatchError(DistretargetError):
    """Clips and folders that cannot be converted as asked."""


def quoted(names: Iterable[str], most: int = 6) -> str:
    """The names in quotes, separated by commas, and how many more there are past `most`."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(repr(name) for name in names[:most]) + more


def closest(name: str, available: Sequence[str]) -> str:
    """What would have worked in place of `name`: the nearest names, or all of them."""
    near = difflib.get_close_matches(name, available, n=3, cutoff=0.6)
    return f"did you mean {quoted(near)}?" if near else f"it has {quoted(available, 12)}"
