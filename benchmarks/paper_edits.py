"""The paper's walking posture after each edit: what its solver finds, and what becomes of it on exact bones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from timeit import repeat

import numpy as np
from numpy.typing import NDArray
from paper_case import EDITS, POSTURE, case
from paper_errors import bone_errors, direction_errors, distance_error
from paper_solver import Task, descended, descended_by_lbfgs, solve

Array = NDArray[np.float64]
REPEATS = 15  # of each solution that is timed; the fastest counts


@dataclass(frozen=True, kw_only=True)
class EditRow:
    """What the paper's solver finds from the rotation copy.

    Attributes:
        start, end: sigma [m^2].
        iterations, evaluations: of the solver.
        bones, largest_bone: the error of the bones' lengths, mean and largest [relative].
        distances: mean |D_source - D_result| over the pairs, at the start and at the end.
        lbfgs: how much sigma differs from that of scipy's L-BFGS-B from the same start [relative].
        time, lbfgs_time: [s].
    """

    edit: str
    start: float
    end: float
    iterations: int
    evaluations: int
    bones: float
    largest_bone: float
    distances: tuple[float, float]
    lbfgs: float
    time: float
    lbfgs_time: float


def edit_rows() -> Iterator[EditRow]:
    """A row for each edit."""
    return map(edit_row, EDITS)


def edit_row(edit: str) -> EditRow:
    """The row of one edit."""
    one = case(edit)
    posture, start = one.source.positions[POSTURE], one.copy[POSTURE]
    task = Task.of(one.problem, posture, start)
    points, minimum = solve(one.problem, posture, start)
    bones = bone_errors(points, one)
    oracle = descended_by_lbfgs(task)
    return EditRow(
        edit=edit,
        start=one.sigma(one.copy)[POSTURE],
        end=minimum.value * one.problem.body_size**2,
        iterations=minimum.iterations,
        evaluations=minimum.evaluations,
        bones=bones.mean(),
        largest_bone=bones.max(),
        distances=tuple(float(distance_error(x, posture, one)) for x in (start, points)),
        lbfgs=abs(minimum.value / oracle.fun - 1),
        time=_time(partial(descended, task.filled)),
        lbfgs_time=_time(partial(descended_by_lbfgs, task)),
    )


@dataclass(frozen=True, kw_only=True)
class MethodsRow:
    """What every method makes of the posture, in the order of `Case.postures`.

    Attributes:
        sigma: [m^2].
        largest_bone: the largest error of a bone's length [relative].
        direction: mean angle between bones and the source's [degrees].
        contact_error: over the whole walk, of rotation copy, exact bones and contact [D].
    """

    edit: str
    sigma: tuple[float, ...]
    largest_bone: tuple[float, ...]
    direction: tuple[float, ...]
    contact_error: tuple[float, ...]


def methods_rows() -> Iterator[MethodsRow]:
    """A row for each edit."""
    return map(methods_row, EDITS)


def methods_row(edit: str) -> MethodsRow:
    """The row of one edit."""
    one = case(edit)
    posture = one.source.positions[POSTURE]
    results = one.postures().values()
    return MethodsRow(
        edit=edit,
        sigma=tuple(one.sigma(points)[POSTURE] for points in results),
        largest_bone=tuple(bone_errors(points[POSTURE], one).max() for points in results),
        direction=tuple(direction_errors(points[POSTURE], posture, one).mean() for points in results),
        contact_error=one.figures("contact_error"),
    )


def _time(solution: Callable[[], object]) -> float:
    """The time of a solution, the fastest of several [s]."""
    return min(repeat(solution, number=1, repeat=REPEATS))
