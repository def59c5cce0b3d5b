"""The paper's solver with any start, tolerance and eta, and another solver of the same problem."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, minimize

from distretarget.distances import DistanceProblem, filled, stress_and_gradient, target_distances
from distretarget.ik import spg
from distretarget.ik.spg import Minimum, scratch_for, spectral_gradient, steepest
from distretarget.objectives.paper import POINT_ITERATIONS, POINT_TOLERANCE

Array = NDArray[np.float64]


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
    """One posture to solve.

    Attributes:
        start: (3, columns), about its centroid [body sizes].
        stress: of the posture.
    """

    start: Array
    stress: Stress

    @classmethod
    def of(cls, problem: DistanceProblem, source: Array, start: Array) -> Task:
        """The task of a start, (points, 3), for a posture of the source, (points, 3)."""
        columns = np.ascontiguousarray((start - start.mean(axis=0)).T / problem.body_size)
        return cls(columns, Stress.of(problem, source))

    @property
    def filled(self) -> Task:
        """The same as the solver takes it."""
        return Task(filled(self.start), Stress(*map(filled, self.stress)))


@njit(cache=True, error_model="numpy")
def _objective(x, problem, gradient):  # type: ignore[no-untyped-def]
    return stress_and_gradient(x, problem.delta, problem.pi, gradient)


@njit(cache=True, error_model="numpy")
def _write_distances(source, ratio, delta):  # type: ignore[no-untyped-def]
    target_distances(source, ratio, delta)


def solve(problem: DistanceProblem, source: Array, start: Array, **settings: float) -> tuple[Array, Minimum]:
    """The points, (points, 3), that the solver reaches from a start, (points, 3), for a posture of the source."""
    x, minimum = descended(Task.of(problem, source, start).filled, **settings)
    return x.T[: len(problem)] * problem.body_size, minimum


def descended(task: Task, *, tolerance: float = POINT_TOLERANCE, eta: float = spg.ETA) -> tuple[Array, Minimum]:
    """Where the solver ends, (3, columns), and what it took."""
    x, gradient = task.start.copy(), np.zeros_like(task.start)
    return x, _compiled(eta)(x, task.stress, tolerance, gradient, scratch_for(x.shape))


def descended_by_lbfgs(task: Task) -> OptimizeResult:
    """Where scipy's L-BFGS-B ends; `fun` is sigma [body sizes squared]."""
    shape = task.start.shape

    def objective(flat: Array) -> tuple[float, Array]:
        gradient = np.empty(shape)
        return _objective(flat.reshape(shape), task.stress, gradient), gradient.ravel()

    options = {"ftol": 0, "gtol": 1e-10}
    return minimize(objective, task.start.ravel(), jac=True, method="L-BFGS-B", options=options)


@cache
def _compiled(eta: float) -> Any:
    """The solver with another `ETA`, a constant that is compiled into it at its first call."""
    with patch.object(spg, "ETA", eta):
        minimise = spectral_gradient(_objective, steepest, adaptive=True)

        @njit(error_model="numpy")
        def solve(x, stress, tolerance, gradient, scratch):  # type: ignore[no-untyped-def]
            sigma = _objective(x, stress, gradient)
            return minimise(x, sigma, gradient, stress, tolerance, POINT_ITERATIONS, scratch)

        x, stress = np.zeros((3, 2)), Stress(np.zeros((2, 2)), np.zeros((2, 2)))
        solve(x, stress, 0.0, np.zeros(x.shape), scratch_for(x.shape))
    return solve
