"""The paper's solver with any start, tolerance and eta, and another solver of the same problem; postures and clips."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numba import njit
from numpy.typing import NDArray
from paper_case import Case, case
from scipy.optimize import OptimizeResult, minimize

from distretarget.distances import DistanceProblem, filled, stress_and_gradient, target_distances
from distretarget.ik import spg
from distretarget.ik.spg import ETA, Minimum, Reason, scratch_for, spectral_gradient, steepest
from distretarget.numerics.build import introduce_parts
from distretarget.numerics.compiled import inlined
from distretarget.objectives.paper_terms import POINT_ITERATIONS, POINT_TOLERANCE

Array = NDArray[np.float64]


OFF = 0.05  # how far the start "copy, disturbed" is off in each coordinate, root mean square [body sizes]
CLOUD = 0.2  # the same of the start "random points" about the centroid [body sizes]
HIGHER = 1.01  # a minimum is another one if its sigma is more than this times the least known


class Stress(NamedTuple):
    """Eq. (2) for one posture: target distances [body sizes] and priorities, (points, columns)."""

    delta: Array
    pi: Array

    @classmethod
    def of(cls, problem: DistanceProblem, source: Array) -> Stress:
        """The stress of the source's posture (points, 3)."""
        delta = np.empty_like(problem.priorities)
        _write_distances(np.ascontiguousarray(source.T), problem.ratio, delta)
        return cls(delta, problem.priorities)


class Task(NamedTuple):
    """One posture to solve: a start about its centroid, (3, columns) [body sizes], and the stress."""

    start: Array
    stress: Stress

    @classmethod
    def of(cls, problem: DistanceProblem, source: Array, start: Array) -> Task:
        """The task of a start, (points, 3), for a posture of the source, (points, 3)."""
        columns = np.ascontiguousarray((start - start.mean(axis=0)).T / problem.body_size)
        return cls(columns, Stress.of(problem, source))

    @property
    def filled(self) -> Task:
        """The task padded to the width that the solver takes."""
        return Task(filled(self.start), Stress(*map(filled, self.stress)))


@inlined()
def _objective(x, problem, gradient):  # type: ignore[no-untyped-def]
    return stress_and_gradient(x, problem.delta, problem.pi, gradient)


introduce_parts()


@njit(error_model="numpy")
def _value(x, problem, gradient):  # type: ignore[no-untyped-def]
    return _objective(x, problem, gradient)


@njit(error_model="numpy")
def _write_distances(source, ratio, delta):  # type: ignore[no-untyped-def]
    target_distances(source, ratio, delta)


def solve(problem: DistanceProblem, source: Array, start: Array, **settings: float) -> tuple[Array, Minimum]:
    """Solve one posture from a start, (points, 3) both; return the points, (points, 3), and the effort."""
    x, minimum = descended(Task.of(problem, source, start).filled, **settings)
    return x.T[: len(problem)] * problem.body_size, minimum


def descended(task: Task, *, tolerance: float = POINT_TOLERANCE, eta: float = ETA) -> tuple[Array, Minimum]:
    """Run the solver; return its last x, (3, columns), and the effort."""
    x, gradient = task.start.copy(), np.zeros_like(task.start)
    return x, _compiled(eta)(x, task.stress, tolerance, gradient, scratch_for(x.shape))


def descended_by_lbfgs(task: Task) -> OptimizeResult:
    """Run scipy's L-BFGS-B; `fun` of the result is sigma [body sizes squared]."""
    shape = task.start.shape

    def objective(flat: Array) -> tuple[float, Array]:
        gradient = np.empty(shape)
        return _value(flat.reshape(shape), task.stress, gradient), gradient.ravel()

    options = {"ftol": 0, "gtol": 1e-10}
    return minimize(objective, task.start.ravel(), jac=True, method="L-BFGS-B", options=options)


@cache
def _compiled(eta: float) -> Any:
    """The solver compiled with another value of the constant `ETA`."""
    with patch.object(spg, "ETA", eta):
        minimise = spectral_gradient(_objective, steepest, adaptive=True)
        introduce_parts()

        @njit(error_model="numpy")
        def solve(x, stress, tolerance, gradient, scratch):  # type: ignore[no-untyped-def]
            sigma = _objective(x, stress, gradient)
            return minimise(x, sigma, gradient, stress, tolerance, POINT_ITERATIONS, scratch)

        x, stress = np.zeros((3, 2)), Stress(np.zeros((2, 2)), np.zeros((2, 2)))
        solve(x, stress, 0.0, np.zeros(x.shape), scratch_for(x.shape))
    return solve


# ---- whole clips

Start = Callable[[Case, int, Array], Array]
"""The points to start frame t from, (joints, 3) [m], given the points solved for the frame before."""


def _noise(case: Case, t: int, deviation: float) -> Array:
    """(joints, 3), random numbers with a standard deviation in body sizes [m]."""
    return deviation * case.problem.body_size * np.random.default_rng(t).normal(size=case.copy[t].shape)


def from_before_moved(case: Case, t: int, before: Array) -> Array:
    """The solved posture of the previous frame, each joint moved as in the rotation copy."""
    return before + case.copy[t] - case.copy[t - 1] if t else case.copy[t]


STARTS: dict[str, Start] = {
    "rotation copy": lambda case, t, _before: case.copy[t],
    "source's posture": lambda case, t, _before: case.source.positions[t],
    "frame before": lambda case, t, before: before if t else case.copy[t],
    "frame before, moved as the copy": from_before_moved,
    f"copy, disturbed by {OFF:.0%}": lambda case, t, _before: case.copy[t] + _noise(case, t, OFF),
    "random points": lambda case, t, _before: _noise(case, t, CLOUD),
}


@dataclass(frozen=True, eq=False)
class Solved:
    """A case solved in every frame: points (frames, joints, 3) [m], sigma [m^2] and the others (frames,)."""

    points: Array
    sigma: Array
    iterations: NDArray[np.intp]
    evaluations: NDArray[np.intp]
    reasons: NDArray[np.intp]

    @property
    def not_converged(self) -> int:
        """The number of frames that did not converge."""
        return int((self.reasons != Reason.CONVERGED).sum())


def solve_all(case: Case, start: Start, **settings: float) -> Solved:
    """Solve every frame of a case, one after the other."""
    points, log = np.empty_like(case.copy), np.empty((len(case.copy), 4))
    before = case.copy[0]
    for t, posture in enumerate(case.source.positions):
        before, log[t] = solve(case.problem, posture, start(case, t, before), **settings)
        points[t] = before
    counts = log[:, 1:].astype(np.intp).T
    return Solved(points, log[:, 0] * case.problem.body_size**2, *counts)


@cache
def solved_from(start: str, edit: str, clip: str = "walk") -> Solved:
    """A clip after an edit, solved from one of `STARTS`."""
    return solve_all(case(edit, clip), STARTS[start])


def elsewhere(solved: Solved, edit: str, clip: str = "walk") -> float:
    """The share of frames that end in a higher minimum than the best that any start reaches."""
    least = np.min([solved_from(start, edit, clip).sigma for start in STARTS], axis=0)
    return float((solved.sigma > HIGHER * least).mean())
