"""mink on a target's body, by tasks of its own and by those of GMR; both end in positions, and in how far they miss.

General Motion Retargeting (GMR), https://github.com/YanjieZe/GMR, is made for robots.
"""

from __future__ import annotations

from collections.abc import Sequence

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

from distretarget import Body, Motion, RetargetResult

SOLVER = "daqp"
POSTURE = 1e-2  # mink's cost of leaving the rotation copy's posture; that of missing a place of an end is 1
DAMPING = 1e-3  # of mink's solver
SETTLED = 1e-3  # a stage of GMR is over when a step lowers the norm of its tasks' errors by at most this ...
MOST_STEPS = 10  # ... or after so many steps behind the first
GMR_DAMPING, GMR_TASK_DAMPING = 0.5, 1.0  # of mink's solver, and of its tasks, in GMR
WRISTS = {"lefthand", "righthand", "lhand", "rhand", "leftwrist", "rightwrist"}
TIMESTEP = 1.0  # mink solves for velocities; a step moves along them for so long [s]


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
        return _miss(positions[:, [self.bodies.index(end) for end in self.ends]] / self.unit, self.places)


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
        return _miss(positions[:, bodies] / self.of_result.unit, self.places[:, places])


def _miss(ends: NDArray[np.float64], places: NDArray[np.float64]) -> float:
    """The mean distance of ends, (frames, ends, 3) [body units], from their places [% of leg length]."""
    return float(200 * np.linalg.norm(ends - places, axis=-1).mean())


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
