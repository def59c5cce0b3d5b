"""mink on a target's body, with tasks of its own and with those of General Motion Retargeting (GMR), which is made for
robots: https://github.com/YanjieZe/GMR.
"""

from __future__ import annotations

from collections.abc import Sequence

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

from distretarget import Body, Motion, RetargetResult

Array = NDArray[np.float64]

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
        copy = result.rotation_copy  # MuJoCo's coordinates: the root's position, each body's quaternion w x y z
        quaternions = copy.rotations[:, self.bodies][..., [3, 0, 1, 2]]
        self.postures = np.concatenate([copy.root_positions / self.unit, quaternions.reshape(len(copy), -1)], axis=1)
        self.ends = _ends(result.matching.target)
        self.places = result.motion.positions[:, self.ends] / self.unit
        self.frames = [_frame_task(end, 1.0, 0.0) for end in self.ends]
        self.posture = mink.PostureTask(self.model, cost=POSTURE)

    def solve(self, steps: int) -> Array:
        """(frames, bodies, 3), positions of the bodies [file units]; each frame is solved from the one before."""
        positions = np.empty((len(self.postures), len(self.bodies), 3))
        self.configuration.update(self.postures[0])
        for t, (posture, places) in enumerate(zip(self.postures, self.places, strict=True)):
            self.posture.set_target(posture)
            for task, place in zip(self.frames, places, strict=True):
                task.set_target(mink.SE3.from_translation(place))
            for _ in range(steps):
                _step(self.configuration, [*self.frames, self.posture], DAMPING)
            positions[t] = self.configuration.data.xpos[1:]
        return positions * self.unit

    def miss(self, positions: Array) -> float:
        """Mean distance of hands, feet and hips from their given places [% of leg length]."""
        return _miss(positions[:, [self.bodies.index(end) for end in self.ends]] / self.unit, self.places)


class Gmr(InverseKinematics):
    """The same model, posed as GMR does.

    Each body is given the place of the source joint that drives it, scaled about the origin, and the rotation that
    follows from it. The first stage turns all bodies and places the feet; the second places and turns all.
    """

    def __init__(self, result: RetargetResult) -> None:
        super().__init__(result)
        matching = result.matching
        self.driven = [body for body in self.bodies if matching.drivers[body] >= 0]
        self.places = result.source.positions[:, matching.drivers[self.driven]] * result.root_scale / self.unit
        self.rotations = result.rotation_copy.world_rotations[:, self.driven][..., [3, 0, 1, 2]]
        feet = {leg.ankle for leg in matching.target.legs or ()}
        self.stages = [
            [_frame_task(body, *_weights(stage, body, feet), lm_damping=GMR_TASK_DAMPING) for body in self.driven]
            for stage in (1, 2)
        ]

    def solve(self, _steps: int) -> Array:
        """(frames, bodies, 3), positions of the bodies [file units]; each frame is solved from the one before."""
        positions = np.empty((len(self.places), len(self.bodies), 3))
        self.configuration.update(self.postures[0])
        for t, frame in enumerate(zip(self.places, self.rotations, strict=True)):
            for tasks in self.stages:
                for task, place, rotation in zip(tasks, *frame, strict=True):
                    task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3(rotation), place))
                self._solve_stage(tasks)
            positions[t] = self.configuration.data.xpos[1:]
        return positions * self.unit

    def _solve_stage(self, tasks: Sequence[mink.Task]) -> None:
        before = self._error(tasks)
        for _ in range(1 + MOST_STEPS):
            _step(self.configuration, tasks, GMR_DAMPING)
            error = self._error(tasks)
            if before - error <= SETTLED:
                break
            before = error

    def _error(self, tasks: Sequence[mink.Task]) -> float:
        """The norm of the tasks' errors."""
        return float(np.linalg.norm(np.concatenate([task.compute_error(self.configuration) for task in tasks])))

    def miss(self, positions: Array) -> float:
        """Mean distance of hands, feet and hips from their given places [% of leg length]."""
        ends = [end for end in self.ends if end in self.driven]
        bodies, places = ([each.index(end) for end in ends] for each in (self.bodies, self.driven))
        return _miss(positions[:, bodies] / self.unit, self.places[:, places])


def _frame_task(body: int, position: float, rotation: float, **others: float) -> mink.FrameTask:
    """The task that brings a body to a place and rotation, with the costs of missing them."""
    return mink.FrameTask(f"joint{body}", "body", position_cost=position, orientation_cost=rotation, **others)


def _miss(ends: Array, places: Array) -> float:
    """The mean distance of end effectors from their places, both (frames, ends, 3) [body units], in % of leg length."""
    return float(200 * np.linalg.norm(ends - places, axis=-1).mean())


def _weights(stage: int, body: int, feet: set[int]) -> tuple[float, float]:
    """The costs of missing a body's place and its rotation in a stage, as in GMR for the robot G1."""
    if body in feet:
        return 50.0, 10.0
    if stage == 1:
        return 0.0, 10.0
    return (10.0 if body else 100.0), 5.0


def _step(configuration: mink.Configuration, tasks: Sequence[mink.Task], damping: float) -> None:
    velocity = mink.solve_ik(configuration, tasks, TIMESTEP, SOLVER, damping=damping, limits=[])
    configuration.integrate_inplace(velocity, TIMESTEP)


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


def _ends(body: Body) -> list[int]:
    """The root, the ankles and the wrists."""
    wrists = [joint for joint, name in enumerate(body.skeleton.names) if name.lower() in WRISTS]
    return sorted({0, *(leg.ankle for leg in body.legs or ()), *wrists})
