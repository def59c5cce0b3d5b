"""Runs of clips over the zoo of bodies, and clips on their own bodies, each with its figures."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import partial
from pathlib import Path

import numpy as np

from distretarget import DistretargetError, Motion, RetargetResult, read_bvh, retarget
from distretarget.measure.figures import Variant

sys.path.append(str(Path(__file__).resolve().parents[1] / "tools"))
from zoo import MEMBERS, member

PROCESSES = 2
SHARE = 3  # each clip is retargeted to one in so many members, the next clip to the members after these


@dataclass(frozen=True, kw_only=True)
class Run:
    """A clip retargeted to a member of the zoo.

    Attributes:
        clip, member: their names.
        frames: how many were retargeted.
        frame_time: the time between frames [s].
        joints: of the member, without End Sites.
        unsolved: how many frames did not converge.
        iterations: of the solver, in all frames.
        seconds: that retargeting took.
        figures: of the whole clip, by key, of source, rotation copy and result.
    """

    clip: str
    member: str
    frames: int
    frame_time: float
    joints: int
    unsolved: int
    iterations: int
    seconds: float
    figures: Mapping[Variant, Mapping[str, float | None]]

    @property
    def name(self) -> str:
        """The clip and the member."""
        return f"{self.clip} on {self.member}"

    def figure(self, key: str, side: Variant = "result") -> float:
        """A figure of one side; nan where nothing was measured."""
        value = self.figures[side].get(key)
        return np.nan if value is None else value


@dataclass(frozen=True, kw_only=True)
class OwnBody:
    """A clip retargeted to its own body: how far a joint of the body is off at most [% of the body's height]."""

    clip: str
    deviation: float


def read_clip(path: Path, frames: int | None) -> Motion:
    """The first frames of a clip; all for None."""
    return read_bvh(path)[:frames]


def members_like(pattern: str) -> list[str]:
    """The members of the zoo whose names match a pattern."""
    return [name for name in MEMBERS if fnmatch(name, pattern)]


def plan(clips: Sequence[Path], members: Sequence[str]) -> Iterator[tuple[Path, str]]:
    """The clips with the members that each is retargeted to: one in `SHARE`, another third for each clip."""
    for number, clip in enumerate(clips):
        for name in members[number % SHARE :: SHARE]:
            yield clip, name


def run_all(clips: Sequence[Path], members: Sequence[str], frames: int | None) -> list[Run]:
    """The runs of the plan."""
    with ProcessPoolExecutor(PROCESSES) as pool:
        return list(pool.map(partial(_run, frames), plan(clips, members)))


def own_bodies(clips: Sequence[Path], members: Sequence[str], frames: int | None) -> list[OwnBody]:
    """All clips on their own bodies, without those that the program refuses; and for each member the motion that it
    has after the first clip of its plan.
    """
    first = {name: clip for clip, name in reversed(list(plan(clips, members)))}
    with ProcessPoolExecutor(PROCESSES) as pool:
        own = [
            *pool.map(partial(_own_body, frames), clips),
            *pool.map(partial(_own_body_of_member, frames), first, first.values()),
        ]
    return [one for one in own if one]


def retargeted(clip: Path, name: str, frames: int | None) -> RetargetResult:
    """A clip on a member of the zoo."""
    return retarget(read_clip(clip, frames), member(name))


def clip_name(clip: Path) -> str:
    """The name of a clip, with its folder."""
    return f"{clip.parent.name}/{clip.stem}"


def _run(frames: int | None, task: tuple[Path, str]) -> Run:
    clip, name = task
    started = time.perf_counter()
    result = retargeted(clip, name, frames)
    seconds = time.perf_counter() - started
    return Run(
        clip=clip_name(clip),
        member=name,
        frames=len(result.motion),
        frame_time=result.motion.frame_time,
        joints=len(result.motion.skeleton.joints),
        unsolved=len(result.effort.unsolved),
        iterations=int(result.effort.iterations.sum()),
        seconds=seconds,
        figures=result.figures,
    )


def _own_body(frames: int | None, clip: Path) -> OwnBody | None:
    """A clip on its own body; None for a file that the program refuses."""
    try:
        motion = read_clip(clip, frames)
        return OwnBody(clip=clip_name(clip), deviation=_deviation(retarget(motion, motion)))
    except DistretargetError:
        return None


def _own_body_of_member(frames: int | None, name: str, clip: Path) -> OwnBody:
    motion = retargeted(clip, name, frames).motion
    deviation = _deviation(retarget(motion, motion.skeleton))
    return OwnBody(clip=f"{clip_name(clip)} of {name}", deviation=deviation)


def _deviation(result: RetargetResult) -> float:
    """How far a joint of the body is from the source's at most [% of the body's height]."""
    body = result.matching.target
    joints = body.regions.of_joint >= 0
    away = np.linalg.norm(result.motion.positions - result.source.positions, axis=-1)[:, joints]
    return float(100 * away.max() / body.height)
