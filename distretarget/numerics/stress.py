"""The stress of a posture, Eq. (2) of the paper, and its gradient, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined

# [body sizes squared] The least squared distance. Two points in one place have a distance without a gradient; so
# bounded, their pair exerts no force.
NEAREST = 1e-300
LANES = 8  # numbers that a vector of a processor holds at most


def filled(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Arrays (..., columns), with columns of zeros behind up to a multiple of `LANES`: what is left over beside vectors
    would take as long as a vector for each column.
    """
    fill = -columns.shape[-1] % LANES
    return np.concatenate([columns, np.zeros((*columns.shape[:-1], fill))], axis=-1)


@inlined(fastmath=True)
def stress_and_gradient(
    x: NDArray[np.float64], delta: NDArray[np.float64], pi: NDArray[np.float64], gradient: NDArray[np.float64]
) -> float:
    """sigma(X) = 1/2 sum_{u<v} pi_uv (||x_u - x_v|| - delta_uv)^2, Eq. (2); its gradient is written to `gradient`.

    `x` and `gradient` are (3, columns), so that the inner loop runs along memory; `delta` and `pi` are
    (points, columns), symmetric, with zero diagonals. Columns behind the points (`filled`) count nothing if `pi` is
    zero there, and nothing is written to theirs.
    """
    sigma = 0.0
    points, columns = delta.shape
    for u in range(points):
        xu, yu, zu = x[0, u], x[1, u], x[2, u]
        gx, gy, gz = 0.0, 0.0, 0.0
        for v in range(columns):
            dx, dy, dz = xu - x[0, v], yu - x[1, v], zu - x[2, v]
            distance = np.sqrt(max(dx * dx + dy * dy + dz * dz, NEAREST))
            force = pi[u, v] * (distance - delta[u, v])
            sigma += force * (distance - delta[u, v])
            gx += force / distance * dx
            gy += force / distance * dy
            gz += force / distance * dz
        gradient[0, u], gradient[1, u], gradient[2, u] = gx, gy, gz
    return 0.25 * sigma


@inlined(fastmath=True)
def target_distances(x: NDArray[np.float64], ratio: NDArray[np.float64], delta: NDArray[np.float64]) -> None:
    """Write delta_uv = tau2_uv D_uv = (tau2_uv / tau1_uv) ||x_u - x_v||, Eq. (1).

    `x` is the source's posture, (3, columns); `ratio` is tau2 / tau1, (points, columns).
    """
    points, columns = ratio.shape
    for u in range(points):
        xu, yu, zu = x[0, u], x[1, u], x[2, u]
        for v in range(columns):
            dx, dy, dz = xu - x[0, v], yu - x[1, v], zu - x[2, v]
            delta[u, v] = ratio[u, v] * np.sqrt(dx * dx + dy * dy + dz * dz)
