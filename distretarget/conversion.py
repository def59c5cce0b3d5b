"""From the texts of files to a motion on its target: what every command that retargets does with a clip."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

from distretarget.baseline.world import RootOffset
from distretarget.errors import DistretargetError, FileError, MatchingError
from distretarget.io.files import read_text, text_hash
from distretarget.io.map_json import MapFile, joint_map
from distretarget.io.skeleton_json import parse_target
from distretarget.motion import Motion
from distretarget.retargeting import Objective, RetargetResult, retarget
from distretarget.solve.chunks import Mapper, Progress


@dataclass(frozen=True)
class Options:
    """How a motion is to be carried over: the arguments of `retarget` of these names."""

    objective: Objective = "contact"
    hold_feet: bool = True
    root_scale: float | None = None
    source_up: str | None = None
    target_up: str | None = None
    root_offset: RootOffset | None = None


@dataclass(frozen=True)
class Text:
    """A file that was read: its text, and its path, for errors."""

    text: str
    path: str | Path

    @cached_property
    def hash(self) -> str:
        """The hash of the text, as UTF-8."""
        return text_hash(self.text)


def load_text(path: str | Path) -> Text:
    """Read a file; errors as in `read_text`."""
    return Text(read_text(path), path)


def carry(
    motion: Motion,
    source: str | Path,
    target: Text,
    own: MapFile,
    options: Options,
    mapper: Mapper = map,
    progress: Progress = lambda _frames: None,
) -> RetargetResult:
    """The motion of the file `source` on the target of another file, with the pairs of a map file.

    `mapper` and `progress` are as in `retarget`.

    Raises:
        FileError: the motion cannot be carried over.
        SkeletonFileError, BvhError: the target's file is no target.
    """
    goal = parse_target(target.text, target.path, motion.rigid_skeleton)
    pairs = joint_map(motion.rigid_skeleton, goal, target.path, own)
    try:
        return retarget(
            motion,
            goal.skeleton,
            joint_map=pairs,
            target_motion=goal.motion,
            mapper=mapper,
            progress=progress,
            **asdict(options),
        )
    except MatchingError as error:
        raise needs_map(error, source, target.path) from error
    except DistretargetError as error:
        raise FileError(source, str(error)) from error


def needs_map(error: MatchingError, source: str | Path, target: str | Path) -> FileError:
    """The refusal of two bodies that cannot be matched, with the command that writes a map for them."""
    command = f"distretarget skeleton match {shlex.quote(str(source))} {shlex.quote(str(target))} -o MAP.json"
    return FileError(target, f"{error}: write one with `{command}`, and give it with --map MAP.json")
