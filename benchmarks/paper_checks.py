"""What is known exactly about the paper's problem on the skeleton of its Table I, beside what the program finds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from paper_case import EDITS, POSTURE, Case, case, on_table_one
from paper_solver import least_sigma

from distretarget.objectives.paper import Postures, aligned, solve_postures

Check = tuple[str, str, str]
"""What is checked, the known answer, and what is found."""

MIRROR = np.array([-1.0, 1.0, 1.0])
SCALE = 1.6
ROUNDING = 1e-12  # a difference up to this comes from rounding
NEAR = 1e-7  # how far a solved point may be from its known place [m]
AGREEMENT = 1e-6  # how far two solvers may differ in the sigma they find [relative]


def checks() -> Iterator[Check]:
    """Every check."""
    yield from problem_checks()
    source, spine = on_table_one("walk"), case("spine +60 %")
    posture = source.positions[POSTURE]

    # Where no bone changes, the source's posture is the answer.
    same = solved(Case(source, source.skeleton), posture)
    yield "no bone changed: sigma, iterations", "0, 0", f"{zero(same.stress[0])}, {same.effort.iterations[0]}"

    # Where every bone is scaled by s, s times the posture is the answer; the start is the source's posture.
    larger = source.skeleton.with_offsets(SCALE * source.skeleton.offsets)
    scaled = solved(Case(source, larger), posture)
    expected = SCALE * (posture - posture.mean(axis=0))[None]
    off = np.abs(aligned(scaled.positions, expected) - expected).max()
    what = f"every bone times {SCALE}: sigma, points off {SCALE} times the posture [m]"
    yield what, f"0, < {NEAR:g}", f"{zero(scaled.stress[0])}, {less(off, NEAR)}"

    # A mirrored start gives the mirrored result, with the same sigma.
    one, other = (solved(spine, sign * spine.copy[POSTURE]) for sign in (1.0, MIRROR))
    off = np.abs(other.positions - MIRROR * one.positions).max()
    found = f"{zero(off)}, {zero(other.stress[0] - one.stress[0])}"
    yield "mirrored start: off the mirrored result [m], difference of sigma", "0, 0", found

    # Another solver, L-BFGS-B of scipy, finds the same minimum from the same start.
    differences = []
    for edit in map(case, EDITS):
        start = edit.copy[POSTURE]
        differences.append(abs(solved(edit, start).stress[0] / least_sigma(edit.problem, posture, start) - 1))
    what = "sigma after each edit against L-BFGS-B's, largest relative difference"
    yield what, f"< {AGREEMENT:g}", less(max(differences), AGREEMENT)


def solved(one: Case, start: np.ndarray) -> Postures:
    """The posture of a case, solved from a start, (joints, 3)."""
    return solve_postures(one.problem, one.source.positions[POSTURE][None], start[None])


def problem_checks() -> Iterator[Check]:
    """Pairs, path sizes and priorities."""
    problem, skeleton = case("spine +60 %").problem, on_table_one("walk").skeleton
    u, v = np.triu_indices(len(problem), 1)
    count = Counter(problem.sizes[u, v].astype(int).tolist())
    bones = np.arange(1, len(skeleton)), skeleton.parents[1:]
    wrists, longest = ((skeleton.index("RightWrist"), skeleton.index(other)) for other in ("LeftWrist", "RightToe"))
    yield "pairs of joints", "231", str(count.total())
    sizes = ", ".join(str(count[size]) for size in sorted(count))
    yield "pairs by path size, 2 to 12", "21, 24, 27, 28, 31, 28, 24, 22, 14, 8, 4", sizes
    yield "path size from RightWrist to RightToe, the largest", "12", f"{problem.sizes[longest]:.0f}"
    yield "priority of that pair, the smallest", "1/6", fraction(problem.priorities[u, v].min())
    yield "smallest priority of a bone", "1", fraction(problem.priorities[bones].min())
    yield "path size from RightWrist to LeftWrist", "9", f"{problem.sizes[wrists]:.0f}"
    yield "priority of that pair", "5/12", fraction(problem.priorities[wrists])


def fraction(value: float) -> str:
    """A number as a fraction with a small denominator if it is one, else with its digits."""
    nearest = Fraction(float(value)).limit_denominator(24)
    return str(nearest) if abs(value - nearest) < ROUNDING else f"{value:.12g}"


def zero(value: float) -> str:
    """The number, or 0 where only rounding separates it from 0."""
    return "0" if abs(value) < ROUNDING else f"{value:.2g}"


def less(value: float, bound: float) -> str:
    """`< bound` for a number below the bound, else the number."""
    return f"< {bound:g}" if value < bound else f"{value:.2g}"
