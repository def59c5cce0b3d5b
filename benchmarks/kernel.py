"""Measure the compiled stress and gradient, Eq. (2), against the same loop in C.

    python benchmarks/kernel.py [--joints 22] [--rounds 9]

The C loop is compiled with `cc -O3 -march=native -ffast-math`, and both run in this process by turns; medians are
printed.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from timeit import timeit

import click
import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.distances import stress_and_gradient

Array = NDArray[np.float64]

REPEATS = 100_000  # evaluations in each measurement
COMPILE = "cc -O3 -march=native -ffast-math -shared -fPIC -o stress.so stress.c -lm"
SOURCE = """
#include <math.h>
double repeat(int repeats, int n, const double *x, const double *delta, const double *pi, double *gradient) {
    double total = 0.0;
    for (int r = 0; r < repeats; r++) {
        double sigma = 0.0;
        for (int u = 0; u < n; u++) {
            double gx = 0.0, gy = 0.0, gz = 0.0;
            for (int v = 0; v < n; v++) {
                double dx = x[u] - x[v], dy = x[n + u] - x[n + v], dz = x[2 * n + u] - x[2 * n + v];
                double d = sqrt(fmax(dx * dx + dy * dy + dz * dz, 1e-300));
                double off = d - delta[u * n + v], force = pi[u * n + v] * off;
                sigma += force * off;
                gx += force / d * dx;
                gy += force / d * dy;
                gz += force / d * dz;
            }
            gradient[u] = gx;
            gradient[n + u] = gy;
            gradient[2 * n + u] = gz;
        }
        total += 0.25 * sigma;
    }
    return total;
}
"""


@njit(fastmath=True, error_model="numpy")
def _repeat(repeats, x, delta, pi, gradient):  # type: ignore[no-untyped-def]
    total = 0.0
    for _ in range(repeats):
        total += stress_and_gradient(x, delta, pi, gradient)
    return total


def compiled_c() -> Callable[..., float]:
    """The C loop, with the arguments of `_repeat`."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "stress.c").write_text(SOURCE)
        subprocess.run(COMPILE.split(), cwd=folder, check=True)
        function = ctypes.CDLL(f"{folder}/stress.so").repeat
    function.restype = ctypes.c_double
    return lambda repeats, x, *arrays: function(
        repeats, x.shape[1], *(a.ctypes.data_as(ctypes.c_void_p) for a in (x, *arrays))
    )


def case(joints: int) -> tuple[Array, Array, Array, Array]:
    """A random posture, target distances, priorities, and an array for the gradient."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=(3, joints))
    apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=0) * rng.uniform(0.7, 1.4, (joints, joints))
    priorities = rng.uniform(0.1, 1.0, (joints, joints))
    delta, pi = ((a + a.T) * (1.0 - np.eye(joints)) / 2 for a in (apart, priorities))
    return x, delta, pi, np.zeros_like(x)


@click.command(help=__doc__)
@click.option("--joints", default=22)
@click.option("--rounds", default=9)
def main(joints: int, rounds: int) -> None:
    """Measure and print."""
    contestants, arrays = (_repeat, compiled_c()), case(joints)
    values = [run(1, *arrays) for run in contestants]  # compiles, too

    def seconds(run: Callable[..., float]) -> float:
        return timeit(lambda: run(REPEATS, *arrays), timer=time.process_time, number=1) / REPEATS

    numba, c = np.median([[seconds(run) for run in contestants] for _ in range(rounds)], axis=0)
    print(f"sigma: {values[0]:.12g}, in C {values[1]:.12g}")
    print(f"{joints} joints: {1e6 * numba:.3f} us, in C {1e6 * c:.3f} us, ratio {numba / c:.2f}")


if __name__ == "__main__":
    main()
