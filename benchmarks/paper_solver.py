"""The paper's solver with any start, tolerance and eta, and another solver of the same problem."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, minimize

from distretarget.distances import DistanceProblem
from distretarget.numerics.stress import stress_and_gradient, target_distances
from distretarget.solve import spg
from distretarget.solve.free_points import POINT_ITERATIONS, POINT_TOLERANCE
from distretarget.solve.spg import Minimum, scratch_for, spectral_gradient, steepest

Array = NDArray[np.float64]


class Stress(NamedTuple):
    """Eq. (2) for one posture: target distances [body sizes] and priorities, (points, points)."""

    delta: Array
    pi: Array


@njit(cache=True, error_model="numpy")
def _objective(x, problem, gradient):  # type: ignore[no-untyped-def]
    return stress_and_gradient(x, problem.delta, problem.pi, gradient)


@njit(cache=True, error_model="numpy")
def _write_distances(source, ratio, delta):  # type: ignore[no-untyped-def]
    target_distances(source, ratio, delta)


def stress_of(problem: DistanceProblem, source: Array) -> Stress:
    """The stress of the source's posture (points, 3)."""
    delta = np.empty_like(problem.priorities)
    _write_distances(np.ascontiguousarray(source.T), problem.ratio, delta)
    return Stress(delta, problem.priorities)


def solve(
    problem: DistanceProblem, source: Array, start: Array, *, tolerance: float = POINT_TOLERANCE, eta: float = spg.ETA
) -> tuple[Array, Minimum]:
    """The points, (points, 3), that the solver reaches from a start, (points, 3), for a posture of the source."""
    x = in_columns(problem, start)
    minimum = _compiled(eta)(x, stress_of(problem, source), tolerance, np.empty(x.shape), scratch_for(x.shape))
    return x.T * problem.body_size, minimum


@cache
def _compiled(eta: float) -> Any:
    """The solver with another `ETA`, a constant that is compiled into it at its first call."""
    with patch.object(spg, "ETA", eta):
        minimise = spectral_gradient(_objective, steepest)

        @njit(error_model="numpy")
        def solve(x, stress, tolerance, gradient, scratch):  # type: ignore[no-untyped-def]
            sigma = _objective(x, stress, gradient)
            return minimise(x, sigma, gradient, stress, tolerance, POINT_ITERATIONS, scratch)

        x, stress = np.zeros((3, 2)), Stress(np.zeros((2, 2)), np.zeros((2, 2)))
        solve(x, stress, 0.0, np.zeros(x.shape), scratch_for(x.shape))
    return solve


def solve_with_lbfgs(problem: DistanceProblem, source: Array, start: Array) -> OptimizeResult:
    """What scipy's L-BFGS-B reaches from the same start; `fun` is sigma [body sizes squared]."""
    stress, x = stress_of(problem, source), in_columns(problem, start)

    def objective(flat: Array) -> tuple[float, Array]:
        gradient = np.empty_like(x)
        return _objective(flat.reshape(x.shape), stress, gradient), gradient.ravel()

    return minimize(objective, x.ravel(), jac=True, method="L-BFGS-B", options={"ftol": 0, "gtol": 1e-10})


def in_columns(problem: DistanceProblem, points: Array) -> Array:
    """Points (points, 3) as the solver takes them: (3, points), contiguous, about their centroid [body sizes]."""
    return np.ascontiguousarray((points - points.mean(axis=0)).T / problem.body_size)
