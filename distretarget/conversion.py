"""From the texts of files to a motion on its target: what every command that retargets does with a clip."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

from distretarget.baseline.world import RootOffset
from distretarget.errors import SAY_IN_A_MAP, DistretargetError, MatchingError
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


def retarget_onto(
    target: Text,
    motion: Motion,
    source: str | Path,
    map_file: MapFile,
    options: Options,
    *,
    mapper: Mapper = map,
    progress: Progress = lambda _frames: None,
) -> RetargetResult:
    """Retarget the motion of the file `source` to the target in the text of another, with the pairs of a map file.

    `mapper` and `progress` are as in `retarget`.

    Raises:
        DistretargetError: the motion cannot be retargeted, or the target's file is no target; it names the file.
    """
    whole = parse_target(target.text, target.path).for_source(motion.rigid_skeleton)
    pairs = joint_map(motion.rigid_skeleton, whole, target.path, map_file)
    try:
        return retarget(motion, whole, joint_map=pairs, mapper=mapper, progress=progress, **asdict(options))
    except MatchingError as error:
        raise needs_map(error, source, target.path) from error
    except DistretargetError as error:
        raise error.in_file(source) from None


def needs_map(error: MatchingError, source: str | Path, target: str | Path) -> MatchingError:
    """The refusal of two bodies that cannot be matched, with the command that writes a map for them."""
    command = f"distretarget skeleton match {shlex.quote(str(source))} {shlex.quote(str(target))} -o MAP.json"
    advice = f"{SAY_IN_A_MAP}: write one with `{command}`, and give it with --map MAP.json"
    return error.advised(advice).in_file(target)
