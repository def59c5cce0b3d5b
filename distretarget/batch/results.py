"""The folder of results: what is done in it, how results get into it, and how all become animations of one file."""

from __future__ import annotations

import fnmatch
import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path, PurePath

from distretarget.batch.database import Database
from distretarget.batch.plan import DATABASE, METRICS, PlannedClip
from distretarget.batch.record import BatchRecord, made_from, results_of
from distretarget.errors import FileError
from distretarget.io.files import check_inside, check_writable, hash_of, hash_of_file, make_folder, write_whole
from distretarget.io.gltf_writer import Parts
from distretarget.io.input_file import load_file
from distretarget.io.motion_file import parse_motion
from distretarget.io.motion_writer import OutputSettings, character_animation, with_animations
from distretarget.io.target_file import TargetFile


@dataclass(frozen=True)
class Results:
    """A folder of results."""

    folder: Path
    overwrite: bool = False  # whether to make again what is done, and to replace files that no batch made
    read_only: bool = False  # whether nothing is to be written, not even a database

    @cached_property
    def database(self) -> Database:
        """The database; unless `read_only`, the first use makes folder and database."""
        database = Database(self.folder, self.read_only)
        if not self.read_only:
            with database.transaction():  # no other run has a file half written
                _remove_temporary_files(self.folder)
        return database

    def known(self, record: BatchRecord, outputs: Sequence[str]) -> BatchRecord | None:
        """Return the record of a clip that is done, now its newest: the results that are there were made from the same
        files in the same way as `record` says; None if they were not.
        """
        hashes = [(name, hash_of_file(self.folder / name)) for name in outputs] if not self.overwrite else []
        if not hashes or not all(each for _, each in hashes):
            return None
        for older, found in enumerate(self.database.records(outputs[0])):
            made = results_of(found)
            if made_from(found) == made_from(record) and all(made.get(name) == each for name, each in hashes):
                if older and not self.read_only:
                    self.database.confirm(found)
                return found
        return None

    def check_replaceable(self, record: BatchRecord, name: str) -> None:
        """Raise a FileError if a result may replace the file at its path in the folder only with --overwrite: no batch
        made it, or one from another clip or target.
        """
        path = self.folder / name
        if self.overwrite or not os.path.lexists(path):
            return
        there = hash_of_file(path)
        records = chain(*map(self.database.records, (record["output"], name) if there else ()))
        made = next((each for each in records if results_of(each).get(name) == there), None)
        if made is None:
            check_writable(path)
        elif _is_other(made["input"], record["input"]) or _is_other(made["target"], record["target"]):
            raise FileError(path, f"is the result of {made['input']} onto {made['target']}; --overwrite replaces it")

    def add(self, record: BatchRecord, outputs: Sequence[str]) -> None:
        """Record what a clip became, whose results are to be at these paths; a FileError if that fails."""
        self.database.add(record, {hash_of_file(self.folder / name) for name in outputs} - {None})

    def put(self, record: BatchRecord, contents: Mapping[str, Parts]) -> BatchRecord:
        """Put the results of a clip, by their paths in the folder, in place, the first one last, and return its record.

        Raises:
            FileError: a result cannot be written; then the first one is as before.
        """
        first, *others = contents
        hashes = {name: hash_of(*parts) for name, parts in contents.items()}
        record = {**record, "output_hash": hashes[first], "others": {name: hashes[name] for name in others}}
        for name in contents:
            check_inside(self.folder / name, self.folder)
        make_folder((self.folder / first).parent)
        self.add(record, [*contents])  # so that the next run knows its own results if this one is killed before the end
        with self.database.transaction():
            for name in (*others, first):
                if hash_of_file(self.folder / name) != hashes[name]:  # else another run was faster
                    self.check_replaceable(record, name)
                    write_whole(self.folder / name, contents[name], overwrite=True)
            self.database.confirm(record)
        return record


def _remove_temporary_files(folder: Path) -> None:
    """Remove temporary files, but not in folders of results inside this one, which other runs may be writing to."""
    for inside, folders, files in os.walk(folder):
        if Path(inside) != folder and DATABASE in files:
            folders.clear()
            continue
        for name in fnmatch.filter(files, ".distretarget-*.tmp"):
            with suppress(OSError):
                Path(inside, name).unlink()


def _is_other(recorded: str, path: str) -> bool:
    """Whether a recorded path leads to another file than `path`; False if that file no longer exists."""
    try:
        return recorded != path and not Path(recorded).samefile(path)
    except (OSError, ValueError):
        return False


def clips_folder(path: Path) -> Path:
    """Return the folder beside a file that keeps its clips as BVH until the file is written, so that an interrupted run
    continues where it stopped.
    """
    return path.with_name(f"{path.name}.clips")


def write_merged(
    path: Path, target: TargetFile, clips: Sequence[PlannedClip], settings: OutputSettings, overwrite: bool
) -> int:
    """Write the character file with an animation for each clip that is done, in the order of their names, and return
    how many; if all are done, the folder of clips goes, and the table of their metrics stays beside the file.

    An animation has its clip's name, or in a tree of folders its path in it.

    Raises:
        DistretargetError: the file cannot be written.
    """
    folder = clips_folder(path)
    done = [PurePath(clip.output) for clip in clips if (folder / clip.output).is_file()]
    animations = []
    for place in sorted(done, key=lambda place: place.with_suffix("")):
        motion, _ = parse_motion(load_file(folder / place))
        animations.append(character_animation(target, settings.clip(motion, place.with_suffix("").as_posix())))
    write_whole(path, with_animations(path, target, animations, settings.animations), overwrite)
    if len(done) == len(clips):
        with suppress(OSError):
            (folder / METRICS).replace(path.with_name(f"{path.name}.{METRICS}"))
        shutil.rmtree(folder, ignore_errors=True)
    return len(animations)
