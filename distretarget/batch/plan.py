"""Plan a batch: find the clips, and give each of them its targets and the paths of its results."""

from __future__ import annotations

import os
import stat
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePath

from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.files import is_folder, read_bytes, reason_of, safe_file_name
from distretarget.io.gltf_writer import free_name
from distretarget.io.input_file import ARRAYS, MOTION_SUFFIXES, InputFile, format_of_name
from distretarget.io.motion_writer import suffix_of
from distretarget.io.reading import TargetFile, animations_in
from distretarget.scene.scene_file import SCENE_NAME

DATABASE, METRICS = "results.sqlite", "metrics.csv"  # in the folder of results
WILDCARDS = frozenset("*?[")


@dataclass(frozen=True)
class PlannedClip:
    """A clip to retarget to a target."""

    path: Path  # of the clip's file
    target: TargetFile
    outputs: tuple[str, ...]  # paths of the results in the folder of results, with slashes; the suffix is the format
    size: int  # of the clip's file [bytes]; 0 if it cannot be read
    animation: str | None = None  # one of several in the file, such as "#2"

    @property
    def output(self) -> str:
        """The first result, which identifies the clip."""
        return self.outputs[0]


def find_clips(
    sources: Sequence[Path],
    listed: Sequence[Path] = (),
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    arrays: bool = False,
) -> tuple[list[tuple[Path, PurePath]], list[FileError]]:
    """Return the clips in files and folders, (path, path of the result without suffix), and the errors of files and
    folders that cannot be searched. Links are followed, except in loops; hidden files, and files of scenes, are left
    out.

    Results keep the tree of a folder; with several sources, below the folder's name. Results of `listed` files keep
    their tree below the deepest folder that contains them all. `include` and `exclude` are shell patterns for names of
    files in folders, or their paths there; patterns that end in / or have no wildcards also match folders.
    """
    clips: list[tuple[Path, PurePath]] = []
    unread: list[FileError] = []
    suffixes = MOTION_SUFFIXES + ARRAYS.others * arrays
    for source in sources:
        if not is_folder(source):
            clips.append((source, _result(PurePath(source.name))))
            continue
        above = PurePath() if len(sources) == 1 else PurePath(source.resolve().name)
        for place in sorted(_files_below(source, unread, suffixes)):
            if _matches_any(place, include or ("*",)) and not _matches_any(place, exclude):
                clips.append((source / place, above / _result(place)))
    paths = [os.path.normpath(path.absolute()) for path in listed]
    shared = os.path.commonpath([os.path.dirname(path) for path in paths]) if paths else ""  # noqa: PTH120
    places = [_result(PurePath(os.path.relpath(path, shared))) for path in paths]
    return [*clips, *zip(listed, places, strict=True)], unread


def plan(
    found: Sequence[tuple[Path, PurePath]],
    targets: Sequence[TargetFile],
    folder: Path,
    sources: Sequence[Path],
    kinds: Sequence[str] = (),
    animation: str | None = None,
) -> list[PlannedClip]:
    """Plan to retarget every clip found to every target, the largest clips first. Results go into `folder`, with
    several targets into a folder for each; `kinds` are their formats, "own" by default. A file with several animations
    becomes a folder, unless `animation` names one. A BatchError if two results would have the same path, one would
    replace a clip or a target, or `folder` is inside one of `sources`.
    """
    for source in sources:
        if is_folder(source) and folder.resolve().is_relative_to(source.resolve()):
            raise BatchError(
                f"{folder}: is inside {source}, whose clips are to be converted; choose a folder elsewhere with -o"
            )
    paths = [Path(target.path) for target in targets]  # the stem of `...json` is `..`: then the whole name is used
    names = [path.stem if path.stem.strip(".") else path.name for path in paths] if len(targets) > 1 else [""]
    parts = [
        (path, place / name, number)
        for path, place in found
        for number, name in ({None: ""} if animation else animations_of(path)).items()
    ]
    sizes = [status.st_size if (status := _status(path)) else 0 for path, _, _ in parts]
    suffixes = [
        dict.fromkeys(suffix_of(target, None if kind == "own" else kind) for kind in kinds or ("own",))
        for target in targets
    ]
    clips = [
        PlannedClip(path, target, tuple(PurePath(name, f"{place}{suffix}").as_posix() for suffix in own), size, number)
        for target, name, own in zip(targets, names, suffixes, strict=True)
        for (path, place, number), size in zip(parts, sizes, strict=True)
    ]
    taken: dict[str, PlannedClip] = {}
    inputs = _inputs(clips)
    for clip in clips:
        for output in clip.outputs:
            result = folder / output
            other = taken.setdefault(output.casefold(), clip)
            if other is not clip:
                both = " and ".join(f"{each.path} onto {each.target.path}" for each in (other, clip))
                raise BatchError(
                    f"{result} would be the result of both {both}; "
                    "leave one of them out with --exclude, and convert it into another folder"
                )
            if _file(result) in inputs:
                raise BatchError(f"{result} is an input and would be replaced; choose another folder with -o")
    return sorted(clips, key=lambda clip: -clip.size)


def animations_of(path: Path) -> dict[str | None, str]:
    """Return the animations of a file, such as "#2", each with a file name; {None: ""} if it has fewer than two."""
    names, named = tuple[str, ...](), format_of_name(path)
    if named and named.has_characters:
        with suppress(DistretargetError):  # reading the clip will report it
            names = animations_in(InputFile(read_bytes(path), path))
    if len(names) < 2:
        return {None: ""}
    found: dict[str | None, str] = {}
    for number, name in enumerate(names, start=1):
        found[f"#{number}"] = free_name(safe_file_name(name) or f"animation {number}", {*found.values()})
    return found


def check_page(page: Path, clips: Sequence[PlannedClip], folder: Path, map_path: str | Path) -> None:
    """Raise a BatchError if a page or table about all clips would replace an input or a file of the batch."""
    written = {
        folder.resolve() / name for name in (DATABASE, METRICS, *(each for clip in clips for each in clip.outputs))
    }
    if page.resolve() in written or _file(page) in {*_inputs(clips), _file(map_path) or ()}:
        raise BatchError(f"{page}: is an input, or the place of a result; give it another name")


def _files_below(folder: Path, unread: list[FileError], suffixes: Collection[str]) -> Iterator[PurePath]:
    """Yield the paths, relative to a folder, of the files below it with these suffixes; errors go to `unread`."""

    def refuse(error: OSError) -> None:
        unread.append(FileError(error.filename, reason_of(error)))

    for inside, folders, files in os.walk(folder, onerror=refuse, followlinks=True):
        if SCENE_NAME in files:
            folders.clear()
            continue
        above = [Path(inside), *Path(inside).parents, *folder.resolve().parents]  # links to these are left out
        below = [Path(inside, name) for name in folders if name[0] != "."]
        folders[:] = [each.name for each in below if not (each.is_symlink() and any(map(each.samefile, above)))]
        for path in (Path(inside, name) for name in files if name[0] != "."):
            is_clip = path.suffix.lower() in suffixes
            try:
                is_regular = stat.S_ISREG(path.stat().st_mode)
            except OSError as error:  # a dangling link, a loop, or a link to a folder without permission
                is_regular = True  # reading the clip will report the error
                if not is_clip and not isinstance(error, FileNotFoundError):
                    refuse(error)
            if is_clip and is_regular:
                yield path.relative_to(folder)
            elif is_clip:
                unread.append(FileError(path, "is not a regular file"))


def _result(place: PurePath) -> PurePath:
    """The path of a clip's result, without suffix."""
    return place.with_suffix("") if place.suffix.lower() in MOTION_SUFFIXES + ARRAYS.others else place


def _matches_any(place: PurePath, patterns: Iterable[str]) -> bool:
    """Whether a path or its name matches a shell pattern, or a folder on the path matches a pattern for folders."""
    for pattern in patterns:
        for_folders = pattern.endswith("/") or not WILDCARDS.intersection(pattern)
        plain = pattern.removeprefix("**/").rstrip("/")
        for path in (place, *(place.parents[:-1] if for_folders else ())):
            if fnmatchcase(path.name, plain) or fnmatchcase(path.as_posix(), plain):
                return True
    return False


def _inputs(clips: Sequence[PlannedClip]) -> set[tuple[int, ...]]:
    return {
        file for path in {path for clip in clips for path in (clip.path, clip.target.path)} if (file := _file(path))
    }


def _file(path: str | Path) -> tuple[int, ...] | None:
    """The device and inode of a file, which identify it on any path; None if there is no file."""
    status = _status(path)
    return (status.st_dev, status.st_ino) if status else None


def _status(path: str | Path) -> os.stat_result | None:
    try:
        return os.stat(path)  # noqa: PTH116 - of many thousand paths
    except (OSError, ValueError):
        return None
