"""What start, tolerance and eta do to the iterations of the paper's solver, and to the minimum it ends in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from paper_case import Case, case
from paper_solver import solve

from distretarget.ik.spg import ETA, Reason

Array = NDArray[np.float64]

STUDIED = ("arms +60 %", "legs -30 %", "spine +60 %", "arms, legs, spine +60 %", "arms +60 %, legs -30 %")
"""The edits whose postures are solved in every frame of a clip."""
CLIPS = ("walk", "turn")  # straight ahead, and on the spot through 360 degrees
OFF = 0.05  # how far the start "copy, disturbed" is off in each coordinate, root mean square [body sizes]
CLOUD = 0.2  # the same of the start "random points" about the centroid [body sizes]
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-9, 1e-12)
ETAS = (0.0, 0.5, 0.85, 0.99, 1.0)
HIGHER = 1.01  # a minimum is another one if its sigma is more than this times the least known

Start = Callable[[Case, int, Array], Array]
"""The points to start frame t from, (joints, 3) [m], given the points solved for the frame before."""


@dataclass(frozen=True, eq=False)
class Solved:
    """A case solved in every frame.

    Attributes:
        points: (frames, joints, 3) [m].
        sigma: (frames,) [m^2].
        iterations, evaluations, reasons: (frames,).
    """

    points: Array
    sigma: Array
    iterations: NDArray[np.intp]
    evaluations: NDArray[np.intp]
    reasons: NDArray[np.intp]

    @property
    def unsolved(self) -> NDArray[np.bool_]:
        """(frames,), whether the solver stopped before it converged."""
        return self.reasons != Reason.CONVERGED


def from_source(case: Case, t: int, before: Array) -> Array:  # noqa: ARG001
    """The source's own posture."""
    return case.source.positions[t]


def from_copy(case: Case, t: int, before: Array) -> Array:  # noqa: ARG001
    """The rotation copy."""
    return case.copy[t]


def from_before(case: Case, t: int, before: Array) -> Array:
    """The posture solved for the frame before."""
    return before if t else case.copy[t]


def from_before_moved(case: Case, t: int, before: Array) -> Array:
    """The posture solved for the frame before, each joint moved as the rotation copy moves."""
    return before + case.copy[t] - case.copy[t - 1] if t else case.copy[t]


def from_disturbed(case: Case, t: int, before: Array) -> Array:  # noqa: ARG001
    """The rotation copy with every joint off its place."""
    return case.copy[t] + OFF * case.problem.body_size * np.random.default_rng(t).normal(size=case.copy[t].shape)


def from_cloud(case: Case, t: int, before: Array) -> Array:  # noqa: ARG001
    """Points without any order."""
    return CLOUD * case.problem.body_size * np.random.default_rng(t).normal(size=case.copy[t].shape)


STARTS: dict[str, Start] = {
    "rotation copy": from_copy,
    "source's posture": from_source,
    "frame before": from_before,
    "frame before, moved as the copy": from_before_moved,
    f"copy, disturbed by {OFF:.0%}": from_disturbed,
    "random points": from_cloud,
}


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


@cache
def solved_with(eta: float, edit: str) -> Solved:
    """The walk after an edit, solved from the rotation copy with this eta."""
    return solve_all(case(edit), from_copy, eta=eta) if eta != ETA else solved_from("rotation copy", edit)


@cache
def least_sigma(edit: str, clip: str) -> Array:
    """(frames,), the least sigma that any start leads to [m^2]."""
    return np.min([solved_from(start, edit, clip).sigma for start in STARTS], axis=0)


def elsewhere(solved: Solved, edit: str, clip: str = "walk") -> float:
    """The share of frames that end in a minimum higher than the least known."""
    return float((solved.sigma > HIGHER * least_sigma(edit, clip)).mean())


def mirrored(points: Array, case: Case) -> float:
    """The share of frames whose points, (frames, joints, 3), are nearer to the mirror image of the rotation copy."""
    x, copy = (each - each.mean(axis=1, keepdims=True) for each in (points, case.copy))
    return float((np.linalg.det(x.transpose(0, 2, 1) @ copy) < 0).mean())


@dataclass(frozen=True, kw_only=True)
class StartRow:
    """What a start does to a clip, means over the bodies of `STUDIED`.

    Attributes:
        iterations: per frame.
        sigma: [m^2].
        higher, mirrored: the shares of frames in a higher minimum, and mirrored.
    """

    iterations: float
    sigma: float
    higher: float
    mirrored: float


def start_rows() -> Iterator[tuple[str, list[StartRow]]]:
    """Each start, and what it does to each clip of `CLIPS`."""
    for start in STARTS:
        yield start, [start_row(start, clip) for clip in CLIPS]


def start_row(start: str, clip: str) -> StartRow:
    """What a start does to a clip."""
    runs = [(edit, solved_from(start, edit, clip)) for edit in STUDIED]
    return StartRow(
        iterations=float(np.mean([run.iterations.mean() for _, run in runs])),
        sigma=float(np.mean([run.sigma.mean() for _, run in runs])),
        higher=float(np.mean([elsewhere(run, edit, clip) for edit, run in runs])),
        mirrored=float(np.mean([mirrored(run.points, case(edit, clip)) for edit, run in runs])),
    )


def tolerance_rows() -> Iterator[tuple[float, float, float, float]]:
    """For each tolerance: iterations, and, against the smallest tolerance, how much higher sigma is [relative] and how
    far the points are off [m]; means.
    """
    exact = {edit: solve_all(case(edit), from_copy, tolerance=TOLERANCES[-1]) for edit in STUDIED}
    for tolerance in TOLERANCES:
        runs = [(solve_all(case(edit), from_copy, tolerance=tolerance), exact[edit]) for edit in STUDIED]
        yield (
            tolerance,
            np.mean([run.iterations.mean() for run, _ in runs]),
            np.mean([(run.sigma / best.sigma - 1).mean() for run, best in runs]),
            np.mean([np.linalg.norm(run.points - best.points, axis=-1).mean() for run, best in runs]),
        )


def eta_rows() -> Iterator[tuple[float, float, float, float, int]]:
    """For each eta: iterations, evaluations, the share of frames in a higher minimum, and the frames not solved."""
    for eta in ETAS:
        runs = [(edit, solved_with(eta, edit)) for edit in STUDIED]
        yield (
            eta,
            np.mean([run.iterations.mean() for _, run in runs]),
            np.mean([run.evaluations.mean() for _, run in runs]),
            np.mean([elsewhere(run, edit) for edit, run in runs]),
            sum(int(run.unsolved.sum()) for _, run in runs),
        )
