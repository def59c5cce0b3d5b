"""Which files are clips to convert, and where their results belong."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePath

from distretarget.errors import FileError
from distretarget.io.files import is_folder, reason_of
from distretarget.scene.scene_file import SCENE_NAME

SUFFIX = ".bvh"
WILDCARDS = frozenset("*?[")


@dataclass(frozen=True)
class Clip:
    """A clip to convert.

    Attributes:
        path: the path of the file.
        place: the path of its result, relative to the folder of results.
        size: the size of the file [bytes]; 0 where it cannot be read.
    """

    path: Path
    place: PurePath
    size: int


@dataclass(frozen=True)
class FoundClips:
    """The clips in some files and folders, and the errors of what could not be read."""

    clips: tuple[Clip, ...]
    unread: tuple[FileError, ...]


def find_clips(
    sources: Sequence[Path], listed: Sequence[Path] = (), include: Sequence[str] = (), exclude: Sequence[str] = ()
) -> FoundClips:
    """Find the clips in files and folders.

    Results keep the tree of a folder; with several sources, each folder's tree goes below the folder's name. In
    folders, files named *.bvh are clips, unless their name or that of a folder on their path begins with a dot. Folders
    of scenes, which have a scene.json, are left out. Links are followed, but not in circles. The results of files in
    `sources` go to the top, those of `listed` files to their places below the deepest folder that contains them all.

    `include` and `exclude` are shell patterns for the names of files in folders, or for their paths in the folder.
    Patterns that end in / or have no wildcards match names and paths of folders as well.
    """
    unread: list[FileError] = []
    folders = [source for source in sources if is_folder(source)]
    clips = [_clip(path, PurePath(path.name)) for path in sources if path not in folders]
    for folder in folders:
        above = PurePath() if len(sources) == 1 else PurePath(folder.resolve().name)
        inside = _files_below(folder, PurePath(), unread)
        clips += [
            _clip(folder / place, above / place)
            for place in inside
            if _wanted(place, include or ("*",)) and not _wanted(place, exclude)
        ]
    shared = _shared_folder(listed)
    clips += [_clip(path, PurePath(os.path.relpath(_absolute(path), shared))) for path in listed]
    return FoundClips(tuple(clips), tuple(unread))


def _clip(path: Path, place: PurePath) -> Clip:
    """The clip in a file; its result has the suffix .bvh in lower case."""
    try:
        size = path.stat().st_size
    except (OSError, ValueError):
        size = 0  # reading the clip will report the error
    return Clip(path, place.with_name(place.name.removesuffix(place.suffix if _is_bvh(place) else "") + SUFFIX), size)


def _is_bvh(place: PurePath) -> bool:
    return place.suffix.lower() == SUFFIX


def _wanted(place: PurePath, patterns: Iterable[str]) -> bool:
    return any(_matches(place, pattern) for pattern in patterns)


def _matches(place: PurePath, pattern: str) -> bool:
    """Whether a shell pattern matches a path or its name.

    A pattern that ends in / or has no wildcards may also match a folder on the path.
    """
    names_folder = pattern.endswith("/") or not WILDCARDS.intersection(pattern)
    pattern = pattern.removeprefix("**/").rstrip("/")
    paths = [place, *(place.parents[:-1] if names_folder else ())]
    return any(fnmatchcase(path.name, pattern) or fnmatchcase(path.as_posix(), pattern) for path in paths)


def _files_below(
    folder: Path, place: PurePath, unread: list[FileError], above: frozenset[str] = frozenset()
) -> Iterator[PurePath]:
    """The paths, relative to a folder, of the BVH files in its tree below `place`, in order.

    `above` has the folders on the path to `place`, which are left out if a link leads back to one of them.
    """
    real = os.path.realpath(folder / place)
    if real in above:
        return
    try:
        with os.scandir(folder / place) as entries:
            inside = sorted((entry for entry in entries if not entry.name.startswith(".")), key=lambda one: one.name)
    except OSError as error:
        unread.append(FileError(folder / place, reason_of(error)))
        return
    if any(entry.name == SCENE_NAME for entry in inside):
        return
    for entry in inside:
        try:
            mode = entry.stat().st_mode
        except OSError as error:  # a link to nothing, to itself, or to a folder without permission
            if _is_bvh(PurePath(entry.name)):
                yield place / entry.name  # reading the clip will report the error
            elif not isinstance(error, FileNotFoundError):
                unread.append(FileError(folder / place / entry.name, reason_of(error)))
            continue
        if stat.S_ISDIR(mode):
            yield from _files_below(folder, place / entry.name, unread, above | {real})
        elif _is_bvh(PurePath(entry.name)):
            if stat.S_ISREG(mode):
                yield place / entry.name
            else:
                unread.append(FileError(folder / place / entry.name, "is not a regular file"))


def _absolute(path: Path) -> str:
    return os.path.normpath(path.absolute())


def _shared_folder(paths: Sequence[Path]) -> str:
    """The deepest folder that contains all files."""
    return os.path.commonpath([os.path.dirname(_absolute(path)) for path in paths]) if paths else ""  # noqa: PTH120
