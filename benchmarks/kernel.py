"""Measure the compiled stress and gradient, Eq. (2), against the same loop in C.

    python benchmarks/kernel.py [--joints 22] [--rounds 9]

The C loop is compiled with `cc -O3 -march=native -ffast-math`, and both run in this process, alternating; medians are
printed. Without a C compiler the script says so.
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from distretarget.distances import stress_and_gradient

Array = NDArray[np.float64]

REPEATS = 100_000  # evaluations in each measurement
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


def compiled_c(compiler: str, folder: Path) -> Callable[[int, Array, Array, Array, Array], float]:
    """The C loop, called as `_repeat` is."""
    source, library = folder / "stress.c", folder / "stress.so"
    source.write_text(SOURCE)
    flags = ["-O3", "-march=native", "-ffast-math", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", str(library), str(source), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).repeat
    function.restype = ctypes.c_double

    def call(repeats: int, x: Array, *arrays: Array) -> float:
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (x, *arrays)]
        return float(function(repeats, x.shape[1], *pointers))

    return call


def case(joints: int) -> tuple[Array, Array, Array, Array]:
    """A random posture, target distances, priorities, and room for the gradient."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=(3, joints))
    apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=0) * rng.uniform(0.7, 1.4, (joints, joints))
    priorities = rng.uniform(0.1, 1.0, (joints, joints))
    delta, pi = ((a + a.T) * (1.0 - np.eye(joints)) / 2 for a in (apart, priorities))
    return x, delta, pi, np.zeros_like(x)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--joints", type=int, default=22)
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    compiler = shutil.which("cc")
    if compiler is None:
        print("there is no C compiler here: no `cc`")
        return
    with tempfile.TemporaryDirectory() as folder:
        contestants = {"numba": _repeat, "C": compiled_c(compiler, Path(folder))}
        arrays = case(arguments.joints)
        values = {name: run(1, *arrays) for name, run in contestants.items()}
        seconds: dict[str, list[float]] = {name: [] for name in contestants}
        for _ in range(arguments.rounds):
            for name, run in contestants.items():
                started = time.process_time()
                run(REPEATS, *arrays)
                seconds[name].append((time.process_time() - started) / REPEATS)
    numba, c = (float(np.median(seconds[name])) for name in ("numba", "C"))
    print(f"sigma: {values['numba']:.12g}, in C {values['C']:.12g}")
    print(f"{arguments.joints} joints: {1e6 * numba:.3f} us, in C {1e6 * c:.3f} us, ratio {numba / c:.2f}")


if __name__ == "__main__":
    main()
