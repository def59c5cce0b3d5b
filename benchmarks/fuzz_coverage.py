"""Let coverage guide what inputs the readers are given, until one goes wrong.

    python benchmarks/fuzz_coverage.py [CORPUS] [-runs=N] [-max_total_time=SECONDS]

Needs the package atheris; the arguments are those of libFuzzer. What reaches new code is kept in the folder CORPUS, an
input that goes wrong in a file `crash-...`, and the error is printed with the input.
"""

from __future__ import annotations

import sys

import atheris

import distretarget.numerics.kinematics  # noqa: F401 - first: numba cannot compile functions that are instrumented

with atheris.instrument_imports(include=["distretarget"]):
    import fuzz
from hypothesis import given


@given(fuzz.texts)
def try_one(case: tuple[str, str]) -> None:
    """Read a text, and fail unless it is written right or refused in one line."""
    outcome, known = fuzz.outcome_of(fuzz.read, case)
    if outcome not in (fuzz.RIGHT, fuzz.REFUSED):
        raise RuntimeError(f"{outcome}: {known}: {case!r}")


if __name__ == "__main__":
    atheris.Setup(sys.argv, try_one.hypothesis.fuzz_one_input)
    atheris.Fuzz()
