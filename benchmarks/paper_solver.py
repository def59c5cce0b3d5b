"""The paper's solver from any start, and another solver of the same problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple
from functools import cache

import numpy as np
from numpy.typing import NDArray
from paper_case import Case, case
from scipy.optimize import minimize

from distretarget.distances import DistanceProblem
from distretarget.ik.spg import Effort
from distretarget.objectives.paper import Postures, solve_postures

Array = NDArray[np.float64]

OFF = 0.05  # how far the start "copy, disturbed" is off in each coordinate, root mean square [body sizes]
CLOUD = 0.2  # the same of the start "random points" about the centroid [body sizes]
HIGHER = 1.01  # a minimum is another one if its sigma is more than this times the least known


def least_sigma(problem: DistanceProblem, source: Array, start: Array) -> float:
    """The sigma [body sizes squared] that scipy's L-BFGS-B finds for a posture from a start, (joints, 3) both."""
    u, v = np.triu_indices(len(problem), 1)
    pi = problem.priorities[u, v]
    delta = problem.ratio[u, v] * np.linalg.norm(source[u] - source[v], axis=1)

    def objective(flat: Array) -> tuple[float, Array]:
        """Eq. (2), and its gradient."""
        x = flat.reshape(start.shape)
        along = x[u] - x[v]
        distances = np.linalg.norm(along, axis=1)
        pull = (pi * (distances - delta) / distances)[:, None] * along
        gradient = np.zeros_like(x)
        np.add.at(gradient, u, pull)
        np.add.at(gradient, v, -pull)
        return 0.5 * float(pi @ (distances - delta) ** 2), gradient.ravel()

    options = {"ftol": 0, "gtol": 1e-10}
    first = start.ravel() / problem.body_size
    return float(minimize(objective, first, jac=True, method="L-BFGS-B", options=options).fun)


# ---- whole clips


def solved(one: Case, starts: Array) -> Postures:
    """Every frame of a case, solved from its own start, (frames, joints, 3) [m]."""
    return solve_postures(one.problem, one.source.positions, starts)


def from_before(one: Case) -> Postures:
    """Every frame of a case, solved from the points of the frame before, the first from the rotation copy."""
    before, frames = one.copy[:1], []
    for posture in one.source.positions:
        frames.append(solve_postures(one.problem, posture[None], before))
        before = frames[-1].positions
    positions, stress = (np.concatenate([getattr(frame, key) for frame in frames]) for key in ("positions", "stress"))
    counts = [np.concatenate(each) for each in zip(*(astuple(frame.effort) for frame in frames), strict=True)]
    return Postures(positions, stress, Effort(*counts))


def _noise(one: Case, deviation: float) -> Array:
    """(frames, joints, 3), random numbers with a standard deviation in body sizes [m]."""
    return deviation * one.problem.body_size * np.random.default_rng(0).normal(size=one.copy.shape)


STARTS: dict[str, Callable[[Case], Postures]] = {
    "rotation copy": lambda one: solved(one, one.copy),
    "source's posture": lambda one: solved(one, one.source.positions),
    "frame before": from_before,
    f"copy, disturbed by {OFF:.0%}": lambda one: solved(one, one.copy + _noise(one, OFF)),
    "random points": lambda one: solved(one, _noise(one, CLOUD)),
}
"""The solution of a case from each start."""


@cache
def solved_from(start: str, edit: str, clip: str = "walk") -> Postures:
    """A clip after an edit, solved from one of `STARTS`."""
    return STARTS[start](case(edit, clip))


def elsewhere(solved: Postures, edit: str, clip: str = "walk") -> float:
    """The share of frames that end in a higher minimum than the best that any start reaches."""
    least = np.min([solved_from(start, edit, clip).stress for start in STARTS], axis=0)
    return float((solved.stress > HIGHER * least).mean())
