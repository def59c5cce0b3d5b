"""Retarget to a target file, with errors that name the file at fault and the command that helps."""

from __future__ import annotations

import shlex
from pathlib import Path

from distretarget.errors import SAY_IN_A_MAP, DistretargetError, MatchingError
from distretarget.ik.poses import Mapper, Progress, ignore_progress
from distretarget.io.files import STANDARD_INPUT, Text
from distretarget.io.map_json import MapFile, joint_map
from distretarget.io.target_file import parse_target
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_threads
from distretarget.pipeline.options import Options
from distretarget.pipeline.result import RetargetResult
from distretarget.pipeline.retargeting import retarget


def retarget_onto(
    motion: Motion,
    target: Text,
    *,
    source: str | Path,
    map_file: MapFile,
    options: Options,
    mapper: Mapper = in_threads,
    progress: Progress = ignore_progress,
) -> RetargetResult:
    """Retarget a motion to the target in a file, with the joint pairs of a map file.

    `source` is the path of the motion's file, for error messages; `mapper` and `progress` are those of `retarget`.

    Raises:
        DistretargetError: the motion cannot be retargeted, or the target's file is not valid; the error names the file.
    """
    whole_target = parse_target(target.text, target.path).for_source(motion.rigid_skeleton)
    pairs = joint_map(motion.rigid_skeleton, whole_target, target.path, map_file)
    try:
        return retarget(motion, whole_target, options, joint_map=pairs, mapper=mapper, progress=progress)
    except MatchingError as error:
        raise needs_map(error, source, target.path) from error
    except DistretargetError as error:
        raise error.in_file(source) from None


def needs_map(error: MatchingError, source: str | Path, target: str | Path) -> MatchingError:
    """Return the error with the advice to write a map, and the command for it."""
    command = f"distretarget skeleton match {argument(source)} {argument(target)} -o MAP.json"
    advice = f"{SAY_IN_A_MAP}: write one with `{command}`, and give it with --map MAP.json"
    return error.advised(advice).in_file(target)


def argument(path: str | Path) -> str:
    """Return the path as a command-line argument, quoted for a shell."""
    return "-" if path == STANDARD_INPUT else shlex.quote(str(path))
