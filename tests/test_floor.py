"""The floor: one-sided springs, their energy, gradient and curvature."""

import numpy as np
import pytest
from spring_case import Case, at

from distretarget.ik.springs import (
    FloorSprings,
    add_floor,
    floor_energy,
    room_for_springs,
)

UP = np.array([0.0, 1.0, 0.0])


def floor_under(case, depths, stiffness=3.0):
    """A floor that the first joints of the case are so far below."""
    x = case.positions(np.zeros(case.shape))
    joints = np.arange(len(depths))
    return FloorSprings(joints, x[joints] @ UP + depths, np.full(len(depths), stiffness), UP)


def energy_at(case, floor, x):
    case.scratch.x[:] = x
    case.scratch.gradient[:] = 0.0
    return floor_energy(case.scratch, floor), case.scratch.gradient.copy()


@pytest.mark.parametrize("seed", range(3))
def test_energy_and_gradient_are_those_of_the_formula(seed):
    case = Case(seed)
    floor = floor_under(case, np.array([0.2, -0.1, 0.05]))
    x = case.positions(np.zeros(case.shape))
    energy, gradient = energy_at(case, floor, x)
    assert energy == pytest.approx(0.5 * 3.0 * (0.2**2 + 0.05**2))
    for joint in range(3):
        for axis in range(3):
            step = np.zeros_like(x)
            step[joint, axis] = 1e-6
            slope = (energy_at(case, floor, x + step)[0] - energy_at(case, floor, x - step)[0]) / 2e-6
            assert gradient[joint, axis] == pytest.approx(slope, abs=1e-6)


def behind(springs, count):
    """Room for some springs behind given ones."""
    room = room_for_springs(len(springs.a) + count)
    for values, given in zip(room, springs, strict=True):
        values[: len(given)] = given
    return room


def test_the_curvature_has_a_spring_for_each_joint_below():
    case = Case(2)
    floor = floor_under(case, np.array([0.2, -0.1, 0.3]))
    springs = at(case.springs, 0)
    case.positions(np.zeros(case.shape))
    count, both = len(springs.a), behind(springs, 3)
    assert add_floor(case.scratch, floor, both, count) == count + 2
    assert both.a[: count + 2].tolist() == [*springs.a.tolist(), 0, 2]
    assert both.b[count : count + 2].tolist() == [-1, -1]
    np.testing.assert_allclose(both.A[count : count + 2], 3.0 * np.broadcast_to(np.outer(UP, UP), (2, 3, 3)))
    np.testing.assert_array_equal(both.A[:count], springs.A)
