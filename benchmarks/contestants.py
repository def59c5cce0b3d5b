"""Methods of retargeting a clip to a character, for the scoreboard: each returns a motion, and its seconds per frame.

Copied rotations are the project's own rotation copy, with rest poses aligned and the root's path scaled: pybvh's
`Bvh.retarget` copies bone lengths between skeletons with the same joints and rest pose, which characters do not have.
All methods use the pairs of joints that the project finds. The goals of mink and GMR's recipe are the source's
positions of hands, feet and hips, or of all joints, scaled by leg length.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from clips import back_and_forth
from numpy.typing import NDArray

from distretarget import Motion, Options, RetargetResult, Skeleton, read_bvh, retarget, write_bvh
from distretarget.baseline.rotation_copy import RootScale, rotation_copy
from distretarget.target import Target

if TYPE_CHECKING:
    from inverse_kinematics import ScaledGoals

STEPS = 3  # of mink per frame
LONG, SHORT = 1000, 60  # frames on which speed is measured: of fast methods, and of mink
NEEDS_MINK = ("mink", "mujoco", "daqp")
SCRIPT = Path(__file__).with_name("retarget_clip.mjs")
PACKAGES = "DISTRETARGET_NODE"  # names the folder in which npm has installed packages
STILL = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Case:
    """A clip to be retargeted to a character."""

    source: Motion
    target: Skeleton | Target

    @cached_property
    def run(self) -> RetargetResult:
        """A run of the project; the contestants use its source, pairs of joints and scale, not its result."""
        return retarget(self.source, self.target)

    def of_frames(self, frames: int) -> Case:
        """The case with the clip played forwards and backwards until it has this many frames."""
        return Case(back_and_forth(self.source, frames), self.target)


@dataclass(frozen=True)
class Contestant:
    """A method of retargeting."""

    name: str  # in tables
    motion: Callable[[Case], Motion]  # the result for a case
    timer: Callable[[Case], Callable[[], float]]  # a run of a case that returns the processor time per frame [s]
    missing: str = ""  # why it cannot be run here; empty if it can
    measures: bool = False  # whether a conversion also computes metrics


COPY = "copied rotations"


def contestants() -> Iterator[Contestant]:
    """Yield all contestants, the project's own last."""

    def copy_timer(case: Case) -> Callable[[], float]:
        run = case.of_frames(LONG).run
        return lambda: _seconds(lambda: rotation_copy(run.matching, RootScale.even(run.root_scale))) / LONG

    yield Contestant(COPY, lambda case: case.run.rotation_copy, copy_timer)
    yield _three()
    yield from _mink()
    yield _own("paper's objective", Options(objective="paper"))
    yield _own("distretarget, `--skin none`", Options(skin="none"))
    yield _own("distretarget", Options())


def _own(name: str, options: Options) -> Contestant:
    def timer(case: Case) -> Callable[[], float]:
        long = case.of_frames(LONG)
        return lambda: _seconds(lambda: retarget(long.source, long.target, options)) / LONG

    return Contestant(name, lambda case: retarget(case.source, case.target, options).motion, timer, measures=True)


def _three() -> Contestant:
    def timer(case: Case) -> Callable[[], float]:
        peer = ThreeJs(case.of_frames(LONG).run)
        return lambda: float(np.median(peer.solve(5)[1])) / LONG

    package = Path(os.environ.get(PACKAGES, "")) / "node_modules" / "three" / "package.json"
    missing = "" if shutil.which("node") else "node.js is not installed"
    if PACKAGES not in os.environ:
        missing = f"{PACKAGES} does not name a folder with the npm package three"
    elif not package.is_file():
        missing = f"the npm package three is not in {os.environ[PACKAGES]}"
    name = "three.js" if missing else f"three.js {json.loads(package.read_text())['version']}"
    return Contestant(f"{name}, `retargetClip`", lambda case: ThreeJs(case.run).solve(1)[0], timer, missing)


def _mink() -> Iterator[Contestant]:
    """The contestants that mink solves: with hands, feet and hips as goals, and with GMR's tasks."""
    absent = [name for name in NEEDS_MINK if importlib.util.find_spec(name) is None]
    missing = f"not installed: {', '.join(absent)}" if absent else ""
    known = "mink" if missing else f"mink {version('mink')}"

    def timer(kind: str, case: Case) -> Callable[[], float]:
        peer = _peer(kind, case.of_frames(SHORT))
        return lambda: _seconds(lambda: [*peer.solved(STEPS)]) / SHORT

    for what, kind in (("hands and feet", "ScaledGoals"), ("GMR's recipe", "Gmr")):
        motion = partial(lambda kind, case: _peer(kind, case).motion(STEPS), kind)
        yield Contestant(f"{known}, {what}", motion, partial(timer, kind), missing)


def _peer(kind: str, case: Case) -> ScaledGoals:
    """An instance, for a case, of the class of this name."""
    import inverse_kinematics  # needs packages that may not be there

    return getattr(inverse_kinematics, kind)(case.run)


def files_timer(case: Case, measures: bool) -> Callable[[], float]:
    """Return a run that reads a clip, writes a result, maybe measures it, and returns processor time per frame [s]."""
    run = case.of_frames(LONG).run

    def timed() -> float:
        with tempfile.TemporaryDirectory() as folder:
            source, result = (Path(folder) / name for name in ("source.bvh", "result.bvh"))
            write_bvh(source, run.source)
            parts = [lambda: read_bvh(source), lambda: write_bvh(result, run.motion)]
            parts += [lambda: replace(run).metrics] if measures else []
            return sum(map(_seconds, parts)) / LONG

    return timed


def _seconds(run: Callable[[], object]) -> float:
    """Processor seconds of a run."""
    started = time.process_time()
    run()
    return time.process_time() - started


@dataclass(frozen=True, eq=False)
class ThreeJs:
    """A run's clip by three.js's `SkeletonUtils.retargetClip` in node; axes agree, so `localOffsets` are not needed."""

    run: RetargetResult

    def solve(self, runs: int) -> tuple[Motion, NDArray[np.float64]]:
        """The result, and the seconds of processor time of each of some runs in one process."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "task.json"
            file.write_text(json.dumps(self._task(Path(folder) / "clip.bvh")))
            command = ["node", SCRIPT, Path(os.environ[PACKAGES]).resolve(), file, runs]
            done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
        answer = json.loads(done.stdout.strip().splitlines()[-1])
        return self._motion(answer["tracks"]), np.array(answer["seconds"])

    def _task(self, clip: Path) -> dict:
        """The task of the script; joints are named by number, as names of tracks may hold few characters."""
        source, target, drivers = self.run.source, self.run.motion.skeleton, self.run.drivers
        names = tuple(f"s{joint}" for joint in range(len(source.skeleton)))
        write_bvh(clip, replace(source, skeleton=replace(source.skeleton, names=names)))
        joints = np.array(target.joints)
        return {
            "bvh": clip.read_text(),
            "names": [f"t{joint}" for joint in joints],
            "parents": [int(np.searchsorted(joints, target.parents[joint])) for joint in joints],
            "offsets": target.offsets[joints].tolist(),
            "pairs": {f"t{joint}": f"s{drivers[joint]}" for joint in joints if drivers[joint] >= 0},
            "hip": f"s{drivers[np.flatnonzero(drivers >= 0)[0]]}",
            "scale": self.run.root_scale,
        }

    def _motion(self, tracks: list[dict]) -> Motion:
        copy = self.run.rotation_copy
        frames, joints = copy.rotations.shape[:2]
        rotations, translations = np.tile(STILL, (frames, joints, 1)), np.tile(copy.skeleton.offsets, (frames, 1, 1))
        for track in tracks:
            joint, moved = int(track["bone"][1:]), track["kind"] == "position"
            values = np.array(track["values"]).reshape(-1, 3 if moved else 4)
            if moved:
                translations[:, joint] = values
            else:
                rotations[:, joint] = values / np.linalg.norm(values, axis=1, keepdims=True)
        return Motion.of_translations(copy.skeleton, translations, rotations, copy.frame_time_text)
