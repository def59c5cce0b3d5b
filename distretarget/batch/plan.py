"""The plan of a batch: each clip onto each target, and the places of the results."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

from distretarget.batch.clips import Clip
from distretarget.errors import BatchError
from distretarget.io.files import Text, is_folder

MANIFEST = "manifest.jsonl"  # the name of the manifest in the folder of results


@dataclass(frozen=True)
class Work:
    """One clip to convert onto one target.

    Attributes:
        clip: the clip.
        target: the target's file.
        place: the path of the output, relative to the folder of results.
    """

    clip: Clip
    target: Text
    place: PurePath


def plan(clips: Sequence[Clip], targets: Sequence[Text], folder: Path, sources: Sequence[Path]) -> list[Work]:
    """Plan the conversion of every clip onto every target into `folder`, the largest clips first.

    With several targets, the results of each go to a folder of their own.

    Raises:
        BatchError: two results would have the same path, a result would replace a clip or a target, or `folder` is
            inside one of `sources`.
    """
    _check_folder(folder, sources)
    names = [PurePath()] if len(targets) == 1 else [_folder_name(Path(target.path)) for target in targets]
    works = [
        Work(clip, target, name / clip.place) for target, name in zip(targets, names, strict=True) for clip in clips
    ]
    _check_places(works, folder)
    return sorted(works, key=lambda work: -work.clip.size)


def _folder_name(target: Path) -> PurePath:
    """The name of the folder for the results of a target; for a target such as `...json` its whole name, not `..`."""
    return PurePath(target.stem if target.stem.strip(".") else target.name)


def _check_folder(folder: Path, sources: Sequence[Path]) -> None:
    for source in sources:
        if is_folder(source) and folder.resolve().is_relative_to(source.resolve()):
            raise BatchError(
                f"{folder}: is inside {source}, whose clips are to be converted; choose a folder elsewhere with -o"
            )


def _check_places(works: Sequence[Work], folder: Path) -> None:
    taken: dict[str, Work] = {}
    for work in works:
        other = taken.setdefault(work.place.as_posix().casefold(), work)
        if other is not work:
            raise BatchError(
                f"{folder / work.place} would be the result of both {_named(other)} and {_named(work)}; "
                "leave one of them out with --exclude, and convert it into another folder"
            )
    inputs = {_file(path) for work in works for path in (work.clip.path, work.target.path)} - {None}
    for work in works:
        if _file(folder / work.place) in inputs:
            raise BatchError(f"{folder / work.place} is an input and would be replaced; choose another folder with -o")


def check_page(page: Path, works: Sequence[Work], folder: Path, map_path: Path | None) -> None:
    """Check that the page over all clips replaces neither an input nor a file that the batch writes to `folder`.

    Raises:
        BatchError: it would replace one.
    """
    read = {path for work in works for path in (work.clip.path, work.target.path)} | {map_path}
    existing = _file(page)
    is_input = existing is not None and existing in {_file(path) for path in read if path}
    written = {folder.resolve() / place for place in (PurePath(MANIFEST), *(work.place for work in works))}
    if is_input or page.resolve() in written:
        raise BatchError(f"{page}: is an input, or the place of a result; give the page another name")


def _file(path: str | Path) -> tuple[int, int] | None:
    """What identifies a file, whichever path leads to it: device and inode; None where there is no file."""
    try:
        status = os.stat(path)  # noqa: PTH116 - of many thousand paths
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def _named(work: Work) -> str:
    return f"{work.clip.path} onto {work.target.path}"
