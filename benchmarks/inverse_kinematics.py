"""mink on a target's body, with tasks of its own and with those of General Motion Retargeting (GMR), which is made for
robots: https://github.com/YanjieZe/GMR.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import mink
import mujoco
import numpy as np

from distretarget import Body, Motion, RetargetResult
from distretarget.numerics.kinematics import make_local
from distretarget.numerics.vectors import Array

SOLVER = "daqp"
POSTURE = 1e-2  # mink's cost of departing from the rotation copy's posture; that of position errors of ends is 1
DAMPING = 1e-3  # of mink's solver
SETTLED = 1e-3  # a stage of GMR ends when a step lowers the norm of its tasks' errors by at most this ...
MOST_STEPS = 10  # ... or after this many steps in addition to the first
GMR_DAMPING, GMR_TASK_DAMPING = 0.5, 1.0  # of mink's solver, and of its tasks, in GMR
W_FIRST, W_LAST = [3, 0, 1, 2], [1, 2, 3, 0]  # quaternions from x y z w to MuJoCo's w x y z, and back
TIMESTEP = 1.0  # mink solves for velocities; a step integrates them for this time [s]


class ScaledGoals:
    """The target as a MuJoCo model with ball joints and a free root, and mink's tasks on it: positions of hands, feet
    and hips as in the source, scaled, rotations as in the copy. Joints that follow their parents are fixed.
    """

    def __init__(self, result: RetargetResult) -> None:
        skeleton = result.motion.skeleton
        self.unit = result.matching.target.unit
        self.bodies = [joint for joint in skeleton.depth_first if not skeleton.end_sites[joint]]
        turning = [joint for joint in self.bodies if not joint or result.matching.rotation_sources[joint, 0] >= 0]
        copy = self.copy = result.rotation_copy
        self.model = mujoco.MjModel.from_xml_string(_xml(copy, turning, self.unit))
        self.configuration = mink.Configuration(self.model)
        quaternions = copy.rotations[:, turning][..., W_FIRST]
        self.postures = np.concatenate([copy.root_positions / self.unit, quaternions.reshape(len(copy), -1)], axis=1)
        drivers = result.matching.drivers
        ends = [end for end in _ends(result.matching.target) if drivers[end] >= 0]
        self.places = result.source.positions[:, drivers[ends]] * result.root_scale / self.unit
        self.frames = [_frame_task(end, 1.0, 0.0) for end in ends]
        self.posture = mink.PostureTask(self.model, cost=POSTURE)

    def motion(self, steps: int) -> Motion:
        """The solved frames as a motion of the target."""
        copy = self.copy
        places, turns = zip(*((data.xpos[1].copy(), data.xquat[1:].copy()) for data in self.solved(steps)), strict=True)
        rotations = np.tile([0.0, 0.0, 0.0, 1.0], (*copy.rotations.shape[:2], 1))
        rotations[:, self.bodies] = np.array(turns)[..., W_LAST]
        make_local(copy.skeleton.parents, rotations)
        rotations[:, copy.skeleton.end_sites] = [0.0, 0.0, 0.0, 1.0]
        return Motion(copy.skeleton, np.array(places) * self.unit, rotations, copy.frame_time_text)

    def solved(self, steps: int) -> Iterator[mujoco.MjData]:
        """The state of the model in each frame, solved from the one before."""
        self.configuration.update(self.postures[0])
        for posture, places in zip(self.postures, self.places, strict=True):
            self.posture.set_target(posture)
            for task, place in zip(self.frames, places, strict=True):
                task.set_target(mink.SE3.from_translation(place))
            for _ in range(steps):
                _step(self.configuration, [*self.frames, self.posture], DAMPING)
            yield self.configuration.data


class Gmr(ScaledGoals):
    """The same model, posed as GMR does: positions of drivers, rotations of the copy; at first those of feet alone."""

    def __init__(self, result: RetargetResult) -> None:
        super().__init__(result)
        matching = result.matching
        driven = [body for body in self.bodies if matching.drivers[body] >= 0]
        self.places = result.source.positions[:, matching.drivers[driven]] * result.root_scale / self.unit
        self.rotations = result.rotation_copy.world_rotations[:, driven][..., W_FIRST]
        feet = {leg.ankle for leg in matching.target.legs or ()}
        self.stages = [
            [_frame_task(body, *_weights(stage, body, feet), lm_damping=GMR_TASK_DAMPING) for body in driven]
            for stage in (1, 2)
        ]

    def solved(self, _steps: int = 0) -> Iterator[mujoco.MjData]:
        """The state of the model in each frame."""
        self.configuration.update(self.postures[0])
        for frame in zip(self.places, self.rotations, strict=True):
            for tasks in self.stages:
                for task, place, rotation in zip(tasks, *frame, strict=True):
                    task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3(rotation), place))
                self._solve_stage(tasks)
            yield self.configuration.data

    def _solve_stage(self, tasks: Sequence[mink.Task]) -> None:
        def norm() -> float:
            return float(np.linalg.norm(np.concatenate([task.compute_error(self.configuration) for task in tasks])))

        before = norm()
        for _ in range(1 + MOST_STEPS):
            _step(self.configuration, tasks, GMR_DAMPING)
            error = norm()
            if before - error <= SETTLED:
                break
            before = error


def _frame_task(body: int, position: float, rotation: float, **others: float) -> mink.FrameTask:
    """The task that brings a body to a position and rotation, with costs of their errors."""
    return mink.FrameTask(f"joint{body}", "body", position_cost=position, orientation_cost=rotation, **others)


def _weights(stage: int, body: int, feet: set[int]) -> tuple[float, float]:
    """The costs of errors of a body's position and rotation in a stage, as in GMR for the robot G1."""
    if body in feet:
        return 50.0, 10.0
    if stage == 1:
        return 0.0, 10.0
    return (10.0 if body else 100.0), 5.0


def _step(configuration: mink.Configuration, tasks: Sequence[mink.Task], damping: float) -> None:
    velocity = mink.solve_ik(configuration, tasks, TIMESTEP, SOLVER, damping=damping, limits=[])
    configuration.integrate_inplace(velocity, TIMESTEP)


def _xml(motion: Motion, turning: Sequence[int], unit: float) -> str:
    """The target as a MuJoCo model, in body units; joints that are not `turning` are fixed as in the first frame."""
    skeleton = motion.skeleton

    def numbers(values: Array) -> str:
        return " ".join(repr(float(x)) for x in values)

    def body(joint: int) -> str:
        place = numbers(skeleton.offsets[joint] / unit if joint else np.zeros(3))
        still = joint not in turning
        turn = f' quat="{numbers(motion.rotations[0, joint, W_FIRST])}"' if still else ""
        freedom = "" if still else f'<joint type="{"ball" if joint else "free"}"/>'
        below = "".join(body(child) for child in skeleton.children[joint] if not skeleton.end_sites[child])
        return (
            f'<body name="joint{joint}" pos="{place}"{turn}>{freedom}'
            f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{below}</body>'
        )

    return f'<mujoco><compiler balanceinertia="true"/><worldbody>{body(0)}</worldbody></mujoco>'


def _ends(body: Body) -> list[int]:
    """Hips, ankles and wrists."""
    parts = [body.roles[role] for role in ("hips", "leftHand", "rightHand") if role in body.roles]
    return sorted({*(parts or [0]), *(leg.ankle for leg in body.legs or ())})
