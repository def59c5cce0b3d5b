"""Compilation of all code that is compiled at run time, or loading it from the cache, before there is work to do.

The solver takes more than half of the time. In the first run a second process compiles it, while this one compiles all
else and then waits for it (`code_cache`).
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from distretarget.baseline.rotation_copy import RootScale
from distretarget.batch.interrupts import interrupts_kept
from distretarget.body.axes import axis_vector
from distretarget.body.resting import above_lowest, joint_speeds, still_joints
from distretarget.ik.poses import Poses
from distretarget.io.bvh import parse_bvh
from distretarget.io.bvh_writer import format_bvh
from distretarget.motion import Motion
from distretarget.numerics.code_cache import CAN_WAIT
from distretarget.numerics.parallel import threads
from distretarget.objectives.contact import solver_lacks_code
from distretarget.pipeline.options import Objective, Options
from distretarget.pipeline.performer import match_performer
from distretarget.pipeline.retargeting import retarget
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

ROTATIONS = ("Zrotation", "Xrotation", "Yrotation")
COMPILE_SOLVER = """
import sys
sys.path[:] = sys.argv[1:]
from distretarget.objectives.contact import compile_solver
compile_solver()
"""
JOINTS = 6  # enough for a pair of joints so far apart along the tree that the solver keeps it as a contact


@interrupts_kept()
def warm(objective: Objective) -> None:
    """Read, retarget, measure and write a clip of two frames, so that all code for `objective` is compiled."""
    with _solver_compiled_meanwhile(objective) as meanwhile:
        source, target = _clip()
        _run_for_legs(source)
        if meanwhile:
            _run_without_solver(source, target)
        retarget(source, target, Options(objective=objective)).figures  # noqa: B018 - what it needs is compiled


@contextmanager
def _solver_compiled_meanwhile(objective: Objective) -> Iterator[bool]:
    """Let another process compile the solver, and yield True, if that is to be done and there is a core for it."""
    if objective != "contact" or not CAN_WAIT or threads() < 2 or not solver_lacks_code():
        yield False
        return
    process = subprocess.Popen(
        [sys.executable, "-c", COMPILE_SOLVER, *sys.path],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield True
    finally:
        process.kill()
        process.wait()


def _clip() -> tuple[Motion, Skeleton]:
    """A clip that was written and read, and a target for it."""
    names = tuple(f"joint{number}" for number in range(JOINTS))
    offsets = np.array([[0.0, 0.0, 0.0], *([[0.0, 1.0, 0.0]] * (JOINTS - 1))])
    channels = (POSITION_CHANNELS + ROTATIONS, *((ROTATIONS,) * (JOINTS - 1)))
    body = Skeleton(
        names=names, parents=np.arange(JOINTS) - 1, offsets=offsets, channels=channels, end_sites=np.zeros(JOINTS, bool)
    )
    bent = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, np.sin(0.6), np.cos(0.6)]])
    motion = Motion(body, np.zeros((2, 3)), np.tile(bent[:, None], (1, JOINTS, 1)), "0.01")
    return parse_bvh(format_bvh(motion), "joints"), body.with_offsets(1.5 * offsets)


def _run_for_legs(source: Motion) -> None:
    """Run what only bodies with legs need."""
    joints, shots = np.arange(JOINTS), np.zeros(len(source), np.intp)
    above_lowest(source, joints, axis_vector("Y"))
    still_joints(source, joints, joints, joint_speeds(source, joints, shots), 1.0, shots)


def _run_without_solver(source: Motion, target: Skeleton) -> None:
    """Make a result of the rotation copy, and measure it, while the solver is being compiled."""
    performer = match_performer(source, target).performer(RootScale.even(1.0))
    still = np.zeros((len(source), int(performer.clip.parts.max()) + 2, 3))
    performer.result(Poses(still, np.zeros((4, len(source))))).figures  # noqa: B018 - as above
