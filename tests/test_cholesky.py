"""The Cholesky factor: what it multiplies to, and what it solves."""

import numpy as np
import pytest

from distretarget.ik.curvature import factorise, solve_factored


@pytest.mark.parametrize("zeros", [[], [(0, 1)], [(0, 1), (0, 2)], [(0, 1), (0, 2), (1, 2)]])
def test_the_factor_solves_what_the_curvature_multiplies(zeros):
    """With blocks of zeros, too."""
    draw = np.random.default_rng(0)
    half = draw.normal(size=(9, 9))
    H = half @ half.T + 30.0 * np.eye(9)
    for p, q in zeros:
        for row, column in ((p, q), (q, p)):
            H[3 * row : 3 * row + 3, 3 * column : 3 * column + 3] = 0.0
    U, active = H.copy(), np.array([0, 2, 3])
    factorise(U, 9)
    factor = np.triu(U, 1) + np.diag(1 / np.diag(U))
    np.testing.assert_allclose(factor.T @ factor, H)
    gradient, d = draw.normal(size=(2, 5, 3))
    solve_factored(U, active, gradient, d, np.empty(9))
    np.testing.assert_allclose(H @ d[active].ravel(), gradient[active].ravel())
    np.testing.assert_array_equal(d[[1, 4]], 0)
