"""Runs of clips on bodies, by several processes, and what the package measures of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from clips import PROCESSES
from zoo import member, on_member

from distretarget import RetargetResult, read_bvh, retarget
from distretarget.measure.metrics import Variant

APART = (7, 16)  # a member is the source of the members so many places after it in the table
SHARE = 3  # each clip is retargeted to one in three members, the next clip to the members after these

Task = tuple[Path, str, str]
"""A clip, the member of the zoo that it is put on to be the source, if any, and the one that it is retargeted to."""
Made = TypeVar("Made")


@dataclass(frozen=True)
class Run:
    """A clip on a member: frames, and how many of them did not converge; joints of the member, without End Sites;
    solver iterations over all frames; metrics of the whole clip, of source, rotation copy and result.
    """

    name: str
    frames: int
    not_converged: int
    joints: int
    iterations: int
    metrics: Mapping[Variant, Mapping[str, float | None]]

    @classmethod
    def of(cls, name: str, result: RetargetResult) -> Run:
        """What is measured of a result, under a name."""
        effort, joints = result.effort, len(result.motion.skeleton.joints)
        counts = len(result.motion), len(effort.not_converged), joints, int(effort.iterations.sum())
        return cls(name, *counts, result.metrics)

    def metric(self, key: str, side: Variant = "result") -> float:
        """A metric of one side; nan where nothing was measured."""
        value = self.metrics[side].get(key)
        return np.nan if value is None else value


def in_processes(function: Callable[..., Made], tasks: Iterable[tuple[object, ...]]) -> list[Made]:
    """What a function makes of the arguments of each task, by several processes."""
    with ProcessPoolExecutor(PROCESSES) as pool:
        return list(pool.map(function, *zip(*tasks, strict=True)))


def clip_name(clip: Path) -> str:
    """The name of a clip, with its folder."""
    return f"{clip.parent.name}/{clip.stem}"


# ---- the zoo


def plan(clips: Sequence[Path], members: Sequence[str]) -> Iterator[Task]:
    """Each clip with one in `SHARE` members."""
    for number, clip in enumerate(clips):
        for name in members[number % SHARE :: SHARE]:
            yield clip, "", name


def pairs(clips: Sequence[Path], members: Sequence[str]) -> Iterator[Task]:
    """Each member as the source of two others, with a clip in turn."""
    for number, source in enumerate(members):
        for apart in APART if clips else ():
            yield clips[(number + apart) % len(clips)], source, members[(number + apart) % len(members)]


def retargeted(frames: int, clip: Path, source: str, target: str) -> RetargetResult:
    """The first frames of a clip, perhaps put on a member of the zoo, on another member."""
    motion = read_bvh(clip)[:frames]
    return retarget(on_member(source, motion) if source else motion, member(target))


def run_of(frames: int, clip: Path, source: str, target: str) -> Run:
    """The metrics of a clip on a member of the zoo."""
    name = f"{clip_name(clip)}{f' of {source}' if source else ''} on {target}"
    return Run.of(name, retargeted(frames, clip, source, target))
