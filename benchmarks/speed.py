"""Measure frames per second of `retarget`, and of mink's inverse kinematics on the same body.

    python benchmarks/speed.py CLIP.bvh [--target H] [--rounds 7] [--markdown FILE]

Each contestant runs in a separate process with one thread. Processor time is measured there, so that neither more cores
nor other programs matter; compiling and reading are not counted. The contestants run alternately, and the table has
medians over the rounds. Needs the extra `bench`; without mink the script says so and measures the rest.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from edits import TARGETS, edited
from numpy.typing import NDArray
from tables import insert

from distretarget import Motion, RetargetResult, read_bvh, retarget
from distretarget.body.body import Body
from distretarget.retargeting import OBJECTIVES

try:
    import mink
    import mujoco
except ImportError:
    mink = None

SOLVER = "daqp"
STEPS = {"1 step a frame": 1, "3 steps a frame": 3}
GMR = "the recipe of GMR"  # General Motion Retargeting, https://github.com/YanjieZe/GMR; below are its values
SETTLED = 1e-3  # a stage is over when a step lowers the norm of its tasks' errors by at most this ...
MOST_STEPS = 10  # ... or after so many steps behind the first
GMR_DAMPING, GMR_TASK_DAMPING = 0.5, 1.0  # of mink's solver, and of its tasks
POSTURE = 1e-2  # mink's cost of leaving the rotation copy's posture; that of missing a place of an end is 1
DAMPING = 1e-3  # of mink's solver
WRISTS = {"lefthand", "righthand", "lhand", "rhand", "leftwrist", "rightwrist"}
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # set to 1 before numpy is imported
TIMESTEP = 1.0  # mink solves for velocities; a step moves along them for so long [s]


class Contestant(NamedTuple):
    """A way of posing all frames of a clip.

    Attributes:
        run: poses them; returns positions, (frames, joints, 3) [file units].
        miss: from such positions, how far the ends are from their given places [% of leg length]; None if the
            contestant is given no places.
    """

    run: Callable[[], NDArray[np.float64]]
    miss: Callable[[NDArray[np.float64]], float] | None = None


_worker: dict[str, Contestant] = {}  # the one contestant of this process, by its name


class InverseKinematics:
    """The target as a MuJoCo model with ball joints and a free root, and mink's tasks on it.

    The tasks: hands, feet and hips are where the contact objective put them, and joints turn as in the rotation copy.
    So mink balances what the contact objective balances, and is given its result for the ends.
    """

    def __init__(self, result: RetargetResult) -> None:
        skeleton = result.motion.skeleton
        self.unit = result.matching.target.unit
        self.bodies = [joint for joint in skeleton.depth_first if not skeleton.end_sites[joint]]
        self.model = mujoco.MjModel.from_xml_string(_xml(result.motion, self.unit))
        self.configuration = mink.Configuration(self.model)
        self.postures = _postures(result.rotation_copy, self.bodies, self.unit)
        self.ends = _ends(result.matching.target)
        self.places = result.motion.positions[:, self.ends] / self.unit
        self.frames = [
            mink.FrameTask(f"joint{end}", "body", position_cost=1.0, orientation_cost=0.0) for end in self.ends
        ]
        self.posture = mink.PostureTask(self.model, cost=POSTURE)
        self.tasks = [*self.frames, self.posture]

    def solve(self, steps: int) -> NDArray[np.float64]:
        """(frames, bodies, 3), positions of the bodies [file units]; each frame is solved from the one before."""
        positions = np.empty((len(self.postures), len(self.bodies), 3))
        for t, posture in enumerate(self.postures):
            if t == 0:
                self.configuration.update(posture)
            self.posture.set_target(posture)
            for task, place in zip(self.frames, self.places[t], strict=True):
                task.set_target(mink.SE3.from_translation(place))
            for _ in range(steps):
                _step(self.configuration, self.tasks, DAMPING)
            positions[t] = self.configuration.data.xpos[1:]
        return positions * self.unit

    def miss(self, positions: NDArray[np.float64]) -> float:
        """Mean distance of hands, feet and hips from their given places [% of leg length]."""
        ends = positions[:, [self.bodies.index(end) for end in self.ends]] / self.unit
        return float(200 * np.linalg.norm(ends - self.places, axis=-1).mean())


class Gmr:
    """The same model, posed as GMR does.

    Each body is given the place of the source joint that drives it, scaled about the origin, and the rotation that
    follows from it. The first stage turns all bodies and places the feet; the second places and turns all.
    """

    def __init__(self, result: RetargetResult) -> None:
        self.of_result = InverseKinematics(result)
        matching, bodies = result.matching, self.of_result.bodies
        driven = [body for body in bodies if matching.drivers[body] >= 0]
        positions = result.source.positions[:, matching.drivers[driven]]
        self.places = positions * result.root_scale / self.of_result.unit
        self.rotations = result.rotation_copy.world_rotations[:, driven][..., [3, 0, 1, 2]]
        feet = {leg.ankle for leg in matching.target.legs or ()}
        self.stages = [
            [
                mink.FrameTask(f"joint{body}", "body", *_weights(stage, body, feet), lm_damping=GMR_TASK_DAMPING)
                for body in driven
            ]
            for stage in (1, 2)
        ]
        self.ends = [(bodies.index(end), driven.index(end)) for end in self.of_result.ends if end in driven]

    def solve(self) -> NDArray[np.float64]:
        """(frames, bodies, 3), positions of the bodies [file units]; each frame is solved from the one before."""
        configuration = self.of_result.configuration
        positions = np.empty((len(self.places), len(self.of_result.bodies), 3))
        configuration.update(self.of_result.postures[0])
        for t, frame in enumerate(zip(self.places, self.rotations, strict=True)):
            for tasks in self.stages:
                for task, place, rotation in zip(tasks, *frame, strict=True):
                    task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3(rotation), place))
                self._solve_stage(tasks)
            positions[t] = configuration.data.xpos[1:]
        return positions * self.of_result.unit

    def _solve_stage(self, tasks: Sequence[mink.Task]) -> None:
        configuration = self.of_result.configuration
        before = _error(configuration, tasks)
        for _ in range(1 + MOST_STEPS):
            _step(configuration, tasks, GMR_DAMPING)
            error = _error(configuration, tasks)
            if before - error <= SETTLED:
                break
            before = error

    def miss(self, positions: NDArray[np.float64]) -> float:
        """Mean distance of hands, feet and hips from their given places [% of leg length]."""
        bodies, places = np.transpose(self.ends)
        return float(
            200 * np.linalg.norm(positions[:, bodies] / self.of_result.unit - self.places[:, places], axis=-1).mean()
        )


def _weights(stage: int, body: int, feet: set[int]) -> tuple[float, float]:
    """What it costs a body in a stage to miss its place, and its rotation, as in GMR for the robot G1."""
    if body in feet:
        return 50.0, 10.0
    if stage == 1:
        return 0.0, 10.0
    return (10.0 if body else 100.0), 5.0


def _step(configuration: mink.Configuration, tasks: Sequence[mink.Task], damping: float) -> None:
    velocity = mink.solve_ik(configuration, tasks, TIMESTEP, SOLVER, damping=damping, limits=[])
    configuration.integrate_inplace(velocity, TIMESTEP)


def _error(configuration: mink.Configuration, tasks: Sequence[mink.Task]) -> float:
    """The norm of the tasks' errors."""
    return float(np.linalg.norm(np.concatenate([task.compute_error(configuration) for task in tasks])))


def _xml(motion: Motion, unit: float) -> str:
    """The target as a MuJoCo model; lengths in body units."""
    skeleton = motion.skeleton

    def body(joint: int) -> str:
        place = " ".join(repr(float(x)) for x in (skeleton.offsets[joint] / unit if joint else np.zeros(3)))
        kind = "ball" if joint else "free"
        below = "".join(body(child) for child in skeleton.children[joint] if not skeleton.end_sites[child])
        return (
            f'<body name="joint{joint}" pos="{place}"><joint type="{kind}"/>'
            f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{below}</body>'
        )

    return f'<mujoco><compiler balanceinertia="true"/><worldbody>{body(0)}</worldbody></mujoco>'


def _postures(copy: Motion, bodies: list[int], unit: float) -> NDArray[np.float64]:
    """(frames, 3 + 4 bodies), the copy in MuJoCo's coordinates: the root's position, each body's quaternion w x y z."""
    quaternions = copy.rotations[:, bodies][..., [3, 0, 1, 2]]
    return np.concatenate([copy.root_positions / unit, quaternions.reshape(len(copy), -1)], axis=1)


def _ends(body: Body) -> list[int]:
    """The root, the ankles and the wrists."""
    wrists = [joint for joint, name in enumerate(body.skeleton.names) if name.lower() in WRISTS]
    return sorted({0, *(leg.ankle for leg in body.legs or ()), *wrists})


def contestant(clip: Path, target: str, name: str) -> Contestant:
    """The contestant with this name, ready to run: an objective, one of `STEPS`, or `GMR`."""
    source = read_bvh(clip)
    body = edited(source.rigid_skeleton, TARGETS[target])
    if name in OBJECTIVES:
        return Contestant(lambda: retarget(source, body, objective=name).motion.positions)
    result = retarget(source, body)
    if name == GMR:
        gmr = Gmr(result)
        return Contestant(gmr.solve, gmr.miss)
    peer = InverseKinematics(result)
    return Contestant(lambda: peer.solve(STEPS[name]), peer.miss)


def _prepare(clip: Path, target: str, name: str) -> None:
    """Prepare a contestant in its process."""
    _worker[name] = contestant(clip, target, name)


def _seconds(name: str) -> float:
    """Processor seconds of a run that follows another one."""
    _worker[name].run()
    started = time.process_time()
    _worker[name].run()
    return time.process_time() - started


def _miss(name: str) -> str:
    contestant = _worker[name]
    return f"{contestant.miss(contestant.run()):.2f}" if contestant.miss else ""


def measure(clip: Path, target: str, rounds: int) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    """For each contestant, processor seconds of each round, and the mean miss of its ends.

    Each runs in a separate process: in a shared one, each run slows the next.
    """
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    names = [*OBJECTIVES, *((*STEPS, GMR) if mink else ())]
    context = get_context("spawn")
    with ExitStack() as stack:
        workers = {
            name: stack.enter_context(ProcessPoolExecutor(1, context, _prepare, (clip, target, name))) for name in names
        }
        misses = {name: worker.submit(_miss, name).result() for name, worker in workers.items()}
        seconds = [[workers[name].submit(_seconds, name).result() for name in names] for _ in range(rounds)]
    return dict(zip(names, np.transpose(seconds), strict=True)), misses


def table(frames: int, seconds: dict[str, NDArray[np.float64]], misses: dict[str, str]) -> str:
    """The table, in Markdown."""
    lines = [
        "| | frames/s, median | slowest to fastest | time over contact's | miss of hands, feet and hips, % of leg |",
        "|---|---|---|---|---|",
    ]
    for name, times in seconds.items():
        speed = frames / times
        ratio = np.median(times / seconds["contact"])
        lines.append(
            f"| {_title(name)} | {np.median(speed):,.0f} | {speed.min():,.0f} to {speed.max():,.0f} "
            f"| {ratio:.2f} | {misses[name]} |"
        )
    return "\n".join(lines) + "\n"


def _title(name: str) -> str:
    return f"`retarget`, {name}" if name in OBJECTIVES else f"mink {version('mink')} with {SOLVER}, {name}"


def main() -> None:
    """Measure, print, and write the table if a page is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clip", type=Path, metavar="CLIP.bvh")
    parser.add_argument("--target", choices=TARGETS, default="H")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--markdown", type=Path, help="write the table into this page")
    arguments = parser.parse_args()
    source = read_bvh(arguments.clip)
    if mink is None:
        print("mink is not installed: pip install '.[bench]'")
    text = table(len(source), *measure(arguments.clip, arguments.target, arguments.rounds))
    print(f"{arguments.clip.name} on {arguments.target}, {len(source)} frames, {len(source.skeleton)} joints\n\n{text}")
    if arguments.markdown:
        insert(arguments.markdown, {"speed": text})


if __name__ == "__main__":
    main()
